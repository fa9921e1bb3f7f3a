"""How an author holds a net in place: by a point and a direction."""

import numpy as np
from numpy.typing import ArrayLike

from ...common.arrays import Array, IntArray, cross, unit
from ...common.errors import InvalidPlan
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.centre import shares_before
from .geodesic import trace
from .net import Net
from .relax import Ties

# Steps of the geodesics that tell the direction: one crosses knots, where the surface's third derivatives jump.
PARTS = 2
# Parts of the lines to which it is measured how far nodes are from the edges, on either side of each.
HALF_LINE = 16
# A direction with less than this share in the surface stands upright.
UPRIGHT = 0.05


def row_axis(surface: BSplineSurface, uv: Array, direction: ArrayLike) -> Array:
    """The part of a direction in the surface at ``uv``, unit, shape (3,).

    Raises
    ------
    InvalidPlan
        If it has next to none.
    """
    normal, wanted = surface.normals(uv[None])[0], np.asarray(direction, float)
    tangent = wanted - (wanted @ normal) * normal
    if np.linalg.norm(tangent) < UPRIGHT * np.linalg.norm(wanted) or not wanted.any():
        raise InvalidPlan(
            f'"direction" {wanted.tolist()} stands upright on the surface at the origin; give one along the rows'
        )
    return unit(tangent)


def pinned(surface: BSplineSurface, net: Net, uv: Array, along: Array, centre: bool = False) -> Ties:
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
    pin, beside = net.pin, net.beside_pin
    r = surface.derivatives(uv[pin])[:, :, 0]
    here, across = r[0, 0], cross(unit(cross(r[1, 0], r[0, 1])), along)
    reach = np.linalg.norm(net.flat[beside], axis=1)
    ways = net.flat[beside] @ np.stack((along, across)) / reach[:, None]
    # A geodesic turns on its way, by what its end tells.
    path, tangents = trace(surface, np.repeat(uv[[pin]], len(beside), axis=0), ways, reach[:, None] / PARTS, PARTS)
    r = surface.derivatives(path[-1])
    sides = cross(unit(cross(r[1, 0], r[0, 1])), tangents[-1]) * (reach / (reach**2).sum())[:, None]
    nodes, place = np.full((1, 2, 2), pin), uv[[pin]].copy()
    for axis, closed in enumerate(surface.closed):
        if centre and not closed:
            ends, shift = centring(surface, uv, axis)
            nodes[0, axis], place[0, axis] = ends, uv[ends, axis].mean() + shift
    return Ties(nodes, place, pin, beside, r[0, 0] - here, sides, rigid_loads(net, *flat_axes(surface, net, uv)))


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
    shares, growth = shares_before(surface, uv[ends], axis, HALF_LINE)
    return ends, float((1 - shares.sum()) / growth.sum())


def rigid_loads(net: Net, x_axis: Array, y_axis: Array) -> Array:
    """Forces on all nodes that push a net along its x and y axes, and that turn it, shape (3, n, 3)."""
    x, y = (net.flat - net.shares @ net.flat).T / max(float(np.ptp(net.flat)), net.pitch)
    return np.stack((x_axis, y_axis, x[:, None] * y_axis - y[:, None] * x_axis)) * net.shares[:, None]


def flat_axes(surface: BSplineSurface, net: Net, uv: Array) -> tuple[Array, Array]:
    """Where the axes of the flat net point at each node, unit, shapes (n, 3): as the pairs there say on the mean."""
    r = surface.derivatives(uv)
    points, normals = r[0, 0], unit(cross(r[1, 0], r[0, 1]))
    chords = points[net.pairs[:, 1]] - points[net.pairs[:, 0]]
    x, y = (part @ chords for part in net.arms_at_nodes)
    x_axis = x - cross(normals, y)  # each chord, turned back by the angle of its arm
    x_axis = unit(x_axis - (x_axis * normals).sum(axis=1, keepdims=True) * normals)
    return x_axis, cross(normals, x_axis)
