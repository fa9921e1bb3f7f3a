"""Bring a net to rest on a surface: the least strain that its ties allow."""

import numpy as np

from ...common.arrays import Array, IntArray, cross, unit
from ...common.errors import InvalidPlan
from ...geometry.surface.bspline import BSplineSurface
from .constraints import Constraints
from .equations import equations_of
from .net import Net

MAX_NEWTON_STEPS = 30
# A step that raises the sum of squares by more than this is taken back. Less is no sign of harm: the pulls are those of
# geodesics, the lengths those of cubics, and the rest of the one is not quite the least of the other.
MAX_ENERGY_RATIO = 1.01
# Ties that are off by less, in parameters or radians, are kept.
CONSTRAINT_TOLERANCE = 1e-6
# Where nothing else is said, a step is the last when the next would move no node by more than this share of the pitch.
STEP_TOLERANCE = 1e-4


def relax(
    surface: BSplineSurface,
    net: Net,
    uv: Array,
    constraints: Constraints,
    weights: Array | None = None,
    step_tolerance: float = STEP_TOLERANCE,
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
    x, best, lowest_energy, violation, use_turn_stiffness = uv, uv, np.inf, 0.0, True
    last_move = net.pitch
    for _ in range(MAX_NEWTON_STEPS):
        r = surface.derivatives(x)
        points, basis = r[0, 0], np.stack((r[1, 0], r[0, 1]), axis=1)
        normals = unit(cross(r[1, 0], r[0, 1]))
        measured, pull = pair_lengths(points, normals, net.pairs, net.straight)
        strain = scale * (measured / net.lengths - 1)
        energy, violations = float(strain @ strain), constraints.violations(x, points)
        closer = violation > CONSTRAINT_TOLERANCE and np.abs(violations).max() < violation / 2
        if energy > MAX_ENERGY_RATIO * lowest_energy and not closer:
            x, use_turn_stiffness = (best + x) / 2, False
            continue
        best, lowest_energy, violation = (
            x,
            energy if closer else min(energy, lowest_energy),
            float(np.abs(violations).max()),
        )
        ends = np.stack((basis[start], basis[stop]), axis=1)
        slopes = np.matmul(ends, pull[..., None])[..., 0] * per_length
        across = cross(np.stack((normals[start], normals[stop]), axis=1), pull)
        sideways = np.matmul(ends, across[..., None])[..., 0] * per_length
        loads = np.matmul(basis, constraints.loads[..., None])[..., 0]
        rows = constraints.rows(basis)
        step = None
        if use_turn_stiffness:
            step = system.step(slopes, sideways, 1 - net.lengths / measured, strain, rows, violations, loads)
        if step is None:  # compressed beyond what keeps it flat: without its own stiffness it has a way down
            use_turn_stiffness = False
            step = system.step(slopes, sideways, None, strain, rows, violations, loads)
        if step is None:
            raise InvalidPlan(
                "the skin finds no rest on this surface, which is folded or too sharply bent under it; fit a smoother "
                "surface, or lay the skin elsewhere"
            )
        x = x + step
        moved = float(np.linalg.norm(np.matmul(step[:, None], basis)[:, 0], axis=1).max())
        # The next step is to this one what this one is to the last, or less: the first to a pitch.
        if moved * min(moved / last_move, 1.0) < step_tolerance * net.pitch:
            break
        last_move = moved
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
