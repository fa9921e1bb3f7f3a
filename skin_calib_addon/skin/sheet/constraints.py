"""How an author holds a net in place: by a point and a direction."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...common.arrays import Array, IntArray, cross, unit
from ...common.errors import InvalidPlan
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.centre import length_fractions
from .geodesic import trace
from .net import Net

# Steps of the geodesics that tell the direction: one crosses knots, where the surface's third derivatives jump.
GEODESIC_STEPS = 2
# Parts of the lines to which it is measured how far nodes are from the edges, on either side of each.
HALF_LINE = 16
# A direction with less than this share in the surface stands upright.
MIN_DIRECTION_SINE = 0.05


@dataclass(frozen=True, eq=False)
class Constraints:
    """What holds a net in place, and the forces that may do it.

    A force on one node would draw the net to a point, more so the finer it is; forces that are spread leave its strain
    smooth, as glue or friction do.
    """

    nodes: IntArray  # (k, 2, 2) for each of the two parameters: two nodes, or twice the same, whose mean is held
    uv: Array  # (k, 2) where it is held
    pin: int  # the node about which others must not turn
    turning: IntArray  # (m,) these others; none, or some
    vectors: Array  # (m, 3) from the pinned node to them [m]
    side_vectors: Array  # (m, 3) across their ways, so that what they are off adds up to an angle [1/m]
    loads: Array  # (2 k, or 2 k + 1 where some must not turn, n, 3)

    def rows(self, basis: Array) -> Array:
        """How each tie changes with the parameters of each node, shape (ties, n, 2)."""
        rows = np.zeros((len(self.loads), len(basis), 2))
        for k, held in enumerate(self.nodes):
            for axis in (0, 1):
                np.add.at(rows, (2 * k + axis, held[axis], axis), 0.5)
        if len(self.turning):
            rows[-1, self.turning] = np.matmul(basis[self.turning], self.side_vectors[..., None])[..., 0]
            rows[-1, self.pin] -= basis[self.pin] @ self.side_vectors.sum(axis=0)
        return rows

    def violations(self, uv: Array, points: Array) -> Array:
        """By how much each tie is not kept, shape (ties,)."""
        held = np.stack([uv[self.nodes[:, axis], axis].mean(axis=1) for axis in (0, 1)], axis=1)
        violations = (held - self.uv).ravel()
        if len(self.turning) == 0:
            return violations
        return np.append(
            violations, ((points[self.turning] - points[self.pin] - self.vectors) * self.side_vectors).sum()
        )


def row_axis(surface: BSplineSurface, uv: Array, direction: ArrayLike) -> Array:
    """The part of a direction in the surface at ``uv``, unit, shape (3,).

    Raises
    ------
    InvalidPlan
        If it has next to none.
    """
    normal, wanted = surface.normals(uv[None])[0], np.asarray(direction, float)
    tangent = wanted - (wanted @ normal) * normal
    if np.linalg.norm(tangent) < MIN_DIRECTION_SINE * np.linalg.norm(wanted) or not wanted.any():
        raise InvalidPlan(
            f'"direction" {wanted.tolist()} stands upright on the surface at the origin; give one along the rows'
        )
    return unit(tangent)


def pin_constraints(surface: BSplineSurface, net: Net, uv: Array, along: Array, centre: bool = False) -> Constraints:
    """Hold the pinned node where it is, and the ways from it to those beside it, its x axis running ``along``.

    Parameters
    ----------
    uv : array, shape (n, 2)
        A first guess of all nodes.
    along : array, shape (3,)
        Unit tangent at the pinned node.
    centre : bool
        Whether, instead of the node, the outermost nodes are held so that as much is free beyond one as the other.
    """
    pin, adjacent = net.pin, net.adjacent_to_pin
    r = surface.derivatives(uv[pin])[:, :, 0]
    here, across = r[0, 0], cross(unit(cross(r[1, 0], r[0, 1])), along)
    distances = np.linalg.norm(net.flat[adjacent], axis=1)
    headings = net.flat[adjacent] @ np.stack((along, across)) / distances[:, None]
    # A geodesic turns on its way, by what its end tells.
    path, tangents = trace(
        surface,
        np.repeat(uv[[pin]], len(adjacent), axis=0),
        headings,
        distances[:, None] / GEODESIC_STEPS,
        GEODESIC_STEPS,
    )
    r = surface.derivatives(path[-1])
    sides = cross(unit(cross(r[1, 0], r[0, 1])), tangents[-1]) * (distances / (distances**2).sum())[:, None]
    nodes, held_uv = np.full((1, 2, 2), pin), uv[[pin]].copy()
    for axis, closed in enumerate(surface.closed):
        if centre and not closed:
            ends, shift = centring(surface, uv, axis)
            nodes[0, axis], held_uv[0, axis] = ends, uv[ends, axis].mean() + shift
    return Constraints(
        nodes, held_uv, pin, adjacent, r[0, 0] - here, sides, rigid_loads(net, *flat_axes(surface, net, uv))
    )


def centring(surface: BSplineSurface, uv: Array, axis: int) -> tuple[IntArray, float]:
    """The outermost nodes of a net along an open parameter, and by how much it is to grow for the net to be centred.

    Centred is a net with as much of the surface free beyond the one as beyond the other, to the lengths of the
    coordinate lines through them. A Newton step: of a net that is nearly centred the rest is nothing.

    Parameters
    ----------
    uv : array, shape (n, 2)
    axis : int

    Returns
    -------
    ends : array of int, shape (2,)
    shift : float
    """
    ends = np.array((np.argmin(uv[:, axis]), np.argmax(uv[:, axis])))
    load_fractions, growth = length_fractions(surface, uv[ends], axis, HALF_LINE)
    return ends, float((1 - load_fractions.sum()) / growth.sum())


def rigid_loads(net: Net, x_axis: Array, y_axis: Array) -> Array:
    """Forces on all nodes that push a net along its x and y axes, and that turn it, shape (3, n, 3)."""
    x, y = (net.flat - net.load_fractions @ net.flat).T / max(float(np.ptp(net.flat)), net.pitch)
    return np.stack((x_axis, y_axis, x[:, None] * y_axis - y[:, None] * x_axis)) * net.load_fractions[:, None]


def flat_axes(surface: BSplineSurface, net: Net, uv: Array) -> tuple[Array, Array]:
    """Where the axes of the flat net point at each node, unit, shapes (n, 3): as the pairs there say on the mean."""
    r = surface.derivatives(uv)
    points, normals = r[0, 0], unit(cross(r[1, 0], r[0, 1]))
    chords = points[net.pairs[:, 1]] - points[net.pairs[:, 0]]
    x, y = (part @ chords for part in net.incident_vectors)
    x_axis = x - cross(normals, y)  # each chord, turned back by the angle of its arm
    x_axis = unit(x_axis - (x_axis * normals).sum(axis=1, keepdims=True) * normals)
    return x_axis, cross(normals, x_axis)
