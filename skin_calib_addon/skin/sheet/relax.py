"""Bring a net to rest on a surface: the least strain that its ties allow."""

from dataclasses import dataclass

import numpy as np

from ...common.arrays import Array, IntArray, cross, unit
from ...common.errors import InvalidPlan
from ...geometry.surface.bspline import BSplineSurface
from .equations import equations_of
from .net import Net

MOST_STEPS = 30
# A step that raises the sum of squares by more than this is taken back. Less is no sign of harm: the pulls are those of
# geodesics, the lengths those of cubics, and the rest of the one is not quite the least of the other.
RISE = 1.01
# Ties that are off by less, in parameters or radians, are kept.
KEPT = 1e-6
# Where nothing else is said, a step is the last when the next would move no node by more than this share of the pitch.
SETTLED = 1e-4


@dataclass(frozen=True, eq=False)
class Ties:
    """What holds a net in place, and the forces that may do it.

    A force on one node would draw the net to a point, more so the finer it is; forces that are spread leave its strain
    smooth, as glue or friction do.
    """

    nodes: IntArray  # (k, 2, 2) for each of the two parameters: two nodes, or twice the same, whose mean is held
    uv: Array  # (k, 2) where it is held
    pin: int  # the node about which others must not turn
    turning: IntArray  # (m,) these others; none, or some
    ways: Array  # (m, 3) from the pinned node to them [m]
    sides: Array  # (m, 3) across their ways, so that what they are off adds up to an angle [1/m]
    loads: Array  # (2 k, or 2 k + 1 where some must not turn, n, 3)

    def rows(self, basis: Array) -> Array:
        """How each tie changes with the parameters of each node, shape (ties, n, 2)."""
        rows = np.zeros((len(self.loads), len(basis), 2))
        for k, held in enumerate(self.nodes):
            for axis in (0, 1):
                np.add.at(rows, (2 * k + axis, held[axis], axis), 0.5)
        if len(self.turning):
            rows[-1, self.turning] = np.matmul(basis[self.turning], self.sides[..., None])[..., 0]
            rows[-1, self.pin] -= basis[self.pin] @ self.sides.sum(axis=0)
        return rows

    def off(self, uv: Array, points: Array) -> Array:
        """By how much each tie is not kept, shape (ties,)."""
        held = np.stack([uv[self.nodes[:, axis], axis].mean(axis=1) for axis in (0, 1)], axis=1)
        off = (held - self.uv).ravel()
        if len(self.turning) == 0:
            return off
        return np.append(off, ((points[self.turning] - points[self.pin] - self.ways) * self.sides).sum())


def relax(
    surface: BSplineSurface, net: Net, uv: Array, ties: Ties, weights: Array | None = None, settled: float = SETTLED
) -> Array:
    """Newton's method on the parameters of the nodes until their strains have the least sum of squares.

    A step that raises the sum much, and not to keep the ties, is taken back, and the next one leaves the strains' own
    stiffness out (Gauss-Newton).

    Parameters
    ----------
    uv : array, shape (n, 2)
        A first guess.
    weights : array, shape (e,), optional
        Of the strain of each pair.
    settled : float
        A step is the last when the next would move no node by more than this share of the pitch.

    Returns
    -------
    array, shape (n, 2)

    Raises
    ------
    InvalidPlan
        If the surface is too sharply bent for the net to come to rest.
    """
    system, (start, stop) = equations_of(net), net.pairs.T
    scale = np.ones(len(net.pairs)) if weights is None else np.sqrt(weights)
    per_length = (scale / net.lengths)[:, None, None]
    x, best, least, amiss, full = uv, uv, np.inf, 0.0, True
    last = net.pitch
    for _ in range(MOST_STEPS):
        r = surface.derivatives(x)
        points, basis = r[0, 0], np.stack((r[1, 0], r[0, 1]), axis=1)
        normals = unit(cross(r[1, 0], r[0, 1]))
        measured, pull = pair_lengths(points, normals, net.pairs, net.straight)
        strain = scale * (measured / net.lengths - 1)
        energy, off = float(strain @ strain), ties.off(x, points)
        mended = amiss > KEPT and np.abs(off).max() < amiss / 2
        if energy > RISE * least and not mended:
            x, full = (best + x) / 2, False
            continue
        best, least, amiss = x, energy if mended else min(energy, least), float(np.abs(off).max())
        ends = np.stack((basis[start], basis[stop]), axis=1)
        slopes = np.matmul(ends, pull[..., None])[..., 0] * per_length
        across = cross(np.stack((normals[start], normals[stop]), axis=1), pull)
        sideways = np.matmul(ends, across[..., None])[..., 0] * per_length
        loads = np.matmul(basis, ties.loads[..., None])[..., 0]
        rows = ties.rows(basis)
        step = None
        if full:
            step = system.step(slopes, sideways, 1 - net.lengths / measured, strain, rows, off, loads)
        if step is None:  # compressed beyond what keeps it flat: without its own stiffness it has a way down
            full = False
            step = system.step(slopes, sideways, None, strain, rows, off, loads)
        if step is None:
            raise InvalidPlan(
                "the skin finds no rest on this surface, which is folded or too sharply bent under it; fit a smoother "
                "surface, or lay the skin elsewhere"
            )
        x = x + step
        moved = float(np.linalg.norm(np.matmul(step[:, None], basis)[:, 0], axis=1).max())
        # The next step is to this one what this one is to the last, or less: the first to a pitch.
        if moved * min(moved / last, 1.0) < settled * net.pitch:
            break
        last = moved
    return x


def pair_lengths(points: Array, normals: Array, pairs: IntArray, straight: bool = False) -> tuple[Array, Array]:
    """Distances between pairs of points of a surface, and how they change when an end moves.

    Along the surface a chord is lengthened to the arc of the cubic that leaves and meets the surface at the ends'
    slopes: for slopes s and t it is longer by the share (2 s^2 - s t + 2 t^2) / 30.

    Returns
    -------
    lengths : array, shape (e,) [m]
    pull : array, shape (e, 2, 3)
        Gradient of each length with respect to its two ends.
    """
    chord = points[pairs[:, 1]] - points[pairs[:, 0]]
    length = np.linalg.norm(chord, axis=1)
    heading = chord / length[:, None]
    if straight:
        return length, heading[:, None] * np.array((-1.0, 1.0))[:, None]
    sines = np.einsum("ec,ekc->ek", heading, normals[pairs])
    s, t = np.arcsin(np.clip(sines, -1, 1)).T
    arcs = length * (1 + (2 * s * s - s * t + 2 * t * t) / 30)
    # The first variation of a geodesic's length: minus its tangent at the start, plus its tangent at the end.
    tangents = unit(heading[:, None] - sines[..., None] * normals[pairs])
    return arcs, tangents * np.array((-1.0, 1.0))[:, None]
