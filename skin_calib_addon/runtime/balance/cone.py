"""The wrench cone: what a flat contact with friction can apply to the robot, as rows for a controller's program.

Friction holds each point's force in a pyramid, ``|fx| <= mu fz`` and ``|fy| <= mu fz``, which circumscribes Coulomb's
cone: 21.7 % of its (fx, fy) lie outside of the circle. For safety pass ``mu / sqrt(2)``, whose pyramid lies within.
Wrenches are [fx fy fz tx ty tz] about the origin of the polygon's coordinates, in their axes, z out of the ground.
"""

import math
from typing import Any

import numpy as np

from ...common.arrays import Array, BoolArray, product
from .polygon import Polygon

SIGNS = np.array(((1, 1), (1, -1), (-1, 1), (-1, -1)))
# Of the four bounds of a vertex, those that hold it: where the outer two (or the inner two) are further apart, both and
# the first (or the last) of the others.
HOLDS = np.array((((1, 1, 0, 1), (1, 0, 1, 1)), ((1, 1, 1, 0), (0, 1, 1, 1))), bool)
SAME = 1e-9  # rows of length one that are as near to each other are one


def wrench_rays(polygon: Polygon, friction: float) -> Array:
    """Wrenches (4k, 6) of unit normal force at the edges of the friction pyramid of each of k corners.

    Raises
    ------
    ValueError
        If the friction is not a positive number.
    """
    _check(friction)
    corners = np.repeat(polygon.corners, 4, axis=0)
    forces = np.tile(np.column_stack((friction * SIGNS, np.ones(4))), (len(polygon.corners), 1))
    return np.column_stack((forces, np.cross(np.column_stack((corners, np.zeros(len(corners)))), forces)))


def rectangle_cone(low: Any, high: Any, friction: float) -> Array:
    """Rows A (16, 6) of the rectangle between two corners (2,) [m]: feasible are wrenches with ``A @ wrench <= 0``.

    Caron's rows (thesis 4.32 to 4.39) moved to a rectangle that may lie anywhere. As printed, the thesis's own (4.40,
    4.41 and those of the torque) admit next to nothing. Rows have length one.

    Raises
    ------
    ValueError
        If the rectangle has no area or the friction is not a positive number.
    """
    _check(friction)
    (x, y), (u, v) = (map(float, corner) for corner in (low, high))
    if not (x < u and y < v and math.isfinite(u - x + v - y)):
        raise ValueError(f"a rectangle from {(x, y)} to {(u, v)} has no area")
    edges = np.array([(0, 0, y, -1, 0, 0), (0, 0, -u, 0, -1, 0), (0, 0, -v, 1, 0, 0), (0, 0, x, 0, 1, 0)])
    twists = []
    for a, s in ((x, 1), (u, -1)):
        for b, t in ((y, 1), (v, -1)):  # at each corner the distance to it along both axes is linear on all of it
            twists.append((b, -a, friction * (s * a + t * b), -friction * t, friction * s, 1))
    return _sorted(_slides(friction), edges, _both_ways(np.array(twists)))


def wrench_cone(polygon: Polygon, friction: float) -> Array | None:
    """Rows A (r, 6) of any polygon with an area: feasible are wrenches with ``A @ wrench <= 0``; None without an area.

    First the 4 bounds of the forces, then one for each edge, which keeps the centre of pressure inside, then those of
    the torque about z; rows have length one. Their number grows with the square of the number of corners; a polygon of
    few, such as :func:`.inscribed.largest_box` gives, needs few.

    A row that bounds the torque about z by 1 has a point (x0, y0) and a linear function m for which at each corner
    m(x, y) >= |x - x0| + |y - y0|; the rows needed are the vertices of all these. For the slope -n of m the best m and
    (x0, y0) follow from four values, s(n + (1, 1)) to s(n - (1, 1)), of the polygon's support function s. That
    function is linear between the normals of the edges, and so a vertex has its n at one of (1, 1) to (-1, -1), or
    where two normals drawn from these meet, or one and the line on which both sums of opposite values are the same.

    Raises
    ------
    ValueError
        If the friction is not a positive number.
    """
    _check(friction)
    if polygon.kind != "area":
        return None
    low, high = polygon.corners.min(axis=0), polygon.corners.max(axis=0)
    centre, size = low + (high - low) / 2, float((high - low).max())
    corners = (polygon.corners - centre) / size
    (x0, y0), (mx, my), m0 = _vertices(corners)
    twists = np.column_stack((y0, -x0, -friction * m0, -friction * my, friction * mx, np.ones(len(m0))))
    normals, offsets = Polygon(corners).half_planes
    nothing = np.zeros(len(normals))
    edges = np.column_stack((nothing, nothing, -offsets, normals[:, 1], -normals[:, 0], nothing))
    return _sorted(_slides(friction), _moved(edges, centre, size), _moved(_both_ways(twists), centre, size))


def margin(rows: Array, wrench: Any) -> float:
    """How far a wrench (6,) is inside of all rows of a cone, negative outside; -inf where it is no number."""
    depth = -(rows @ np.asarray(wrench, float)).max()
    return float(depth) if not math.isnan(depth) else -math.inf


def _check(friction: float) -> None:
    if not (friction > 0 and math.isfinite(friction)):
        raise ValueError(f"friction {friction} must be a positive number")


def _slides(friction: float) -> Array:
    """The bounds of fx and fy."""
    return np.array([(s * (1 - k), s * k, -friction, 0, 0, 0) for k in (0, 1) for s in (1, -1)], float)


def _both_ways(rows: Array) -> Array:
    """Bounds of the torque about z from both sides: with fx, fy and tz, it turns its sign."""
    return np.concatenate((rows, rows * (-1, -1, 1, 1, 1, -1)))


def _moved(rows: Array, centre: Array, size: float) -> Array:
    """Rows about a centre, with lengths in some size, as rows about the origin in metres."""
    x, y = centre / size
    a, b, c, p, q, r = rows.T
    p, q, r = p / size, q / size, r / size
    return np.column_stack((a + r * centre[1], b - r * centre[0], c - p * centre[1] + q * centre[0], p, q, r))


def _sorted(slides: Array, edges: Array, twists: Array) -> Array:
    """All rows with length one, the last ones in the order of their numbers, and each of those once."""
    slides, edges, twists = (rows / np.linalg.norm(rows, axis=1, keepdims=True) for rows in (slides, edges, twists))
    _, once = np.unique(np.rint(twists / SAME), axis=0, return_index=True)
    return np.concatenate((slides, edges, twists[once])) + 0.0


def _vertices(corners: Array) -> tuple[Array, Array, Array]:
    """Points (2, n), slopes (2, n) and constants (n,) of the linear functions that bound the torque about z."""
    edges = np.roll(corners, -1, axis=0) - corners
    rays = np.stack((edges[:, 1], -edges[:, 0]), axis=1) / np.hypot(*edges.T)[:, None]
    found = [_ends(corners, -SIGNS, np.eye(4, dtype=bool))]
    for k, start in enumerate(-SIGNS):
        along = [np.zeros((len(rays), 1))]
        for l in range(4):
            if l == k:
                continue
            t = _meetings(start, -SIGNS[l], rays)
            i, j = np.isfinite(t).nonzero()
            found.append(_ends(corners, start + t[i, j][:, None] * rays[i], np.isin(np.arange(4), (k, l))))
            along.append(t)
        level = _level(corners, start, rays, np.hstack(along))
        found.append(_ends(corners, level, np.zeros(4, bool)))
    points, slopes, constants = (np.concatenate(parts, axis=-1) for parts in zip(*found))
    return points, slopes, constants


def _meetings(start: Array, other: Array, rays: Array) -> Array:
    """How far from a start along each ray (k,) each of the same rays from another start is met (k, k); inf if not."""
    gap = other - start
    cross = rays[:, None, 0] * rays[None, :, 1] - rays[:, None, 1] * rays[None, :, 0]
    to_other = gap[0] * rays[:, 1] - gap[1] * rays[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t, u = to_other[None, :] / cross, to_other[:, None] / cross
    return np.where((cross != 0) & (t >= 0) & (u >= 0) & np.isfinite(t), t, np.inf)


def _level(corners: Array, start: Array, rays: Array, along: Array) -> Array:
    """Where on rays, between marks along them (k, m), the two sums of opposite support values are the same (n, 2)."""
    along = np.sort(along, axis=1)
    reached = np.isfinite(along)
    at = start + np.where(reached, along, 0.0)[:, :, None] * rays[:, None, :]
    values = _supports(corners, at.reshape(-1, 2)) @ (1, -1, -1, 1)
    values = np.where(reached, values.reshape(along.shape), np.nan)
    before, behind = values[:, :-1], values[:, 1:]
    i, j = ((before < 0) & (behind > 0) | (before > 0) & (behind < 0)).nonzero()
    share = before[i, j] / (before[i, j] - behind[i, j])
    return start + (along[i, j] + share * (along[i, j + 1] - along[i, j]))[:, None] * rays[i]


def _supports(corners: Array, slopes: Array) -> Array:
    """The support function of the polygon at slopes (n, 2), moved by each of the signs: (n, 4)."""
    return (product(slopes, corners.T)[:, None, :] + SIGNS @ corners.T).max(axis=2)


def _ends(corners: Array, slopes: Array, of: BoolArray) -> tuple[Array, Array, Array]:
    """For slopes -n (n, 2) the least functions with both ends of their points, where bounds ``of`` hold these."""
    s = _supports(corners, slopes)
    outer, inner = (s[:, 0] + s[:, 3]) / 2, (s[:, 1] + s[:, 2]) / 2
    constant = np.maximum(outer, inner)
    is_outer = outer >= inner
    is_even = np.abs(outer - inner) <= SAME * (1 + np.abs(constant))
    found = []
    for end in (0, 1):
        total = np.where(is_outer, (s[:, 0] - s[:, 3]) / 2, s[:, 0] - constant if end == 0 else constant - s[:, 3])
        apart = np.where(is_outer, s[:, 1] - constant if end == 0 else constant - s[:, 2], (s[:, 1] - s[:, 2]) / 2)
        held = (HOLDS[np.where(is_outer, 0, 1), end] | ~of).all(axis=1) | is_even
        found.append(np.stack(((total + apart) / 2, (total - apart) / 2, *-slopes.T, constant))[:, held])
    table = np.concatenate(found, axis=1)
    return table[:2], table[2:4], table[4]
