r"""Compute the wrench cone of a flat contact with friction: linear constraints for a controller.

The force at each point is in a friction pyramid:

.. math::
    |f_x| \le \mu f_z , \qquad |f_y| \le \mu f_z .

The pyramid circumscribes the cone of Coulomb: 21.7 % of its (fx, fy) are outside the circle. The pyramid of
``mu / sqrt(2)`` is inside; use it for safety.

A wrench is [fx fy fz tx ty tz] [N, N m] about the origin of the polygon's coordinates, along their axes, with z out of
the ground. It is feasible if ``A @ wrench <= 0`` for the rows A.
"""

import math
from typing import Any

import numpy as np

from skin_calib_addon.runtime import Polygon

from .checks import Array, BoolArray

CORNER_SIGNS = np.array(((1, 1), (1, -1), (-1, 1), (-1, -1)))
# Which of the four bounds of a vertex are active, for each of its two ends: if the sum of the outer two is larger, both
# of these and one of the inner ones; else both inner ones and one of the outer ones.
ACTIVE_BOUNDS = np.array((((1, 1, 0, 1), (1, 0, 1, 1)), ((1, 1, 1, 0), (0, 1, 1, 1))), bool)
# Distance of two rows of length one up to which they are one row [1]. Larger: fewer rows for nearly parallel edges, and
# a less exact cone; smaller: the same row twice.
ROW_TOLERANCE = 1e-9


def wrench_rays(polygon: Polygon, friction: float) -> Array:
    """Return the rays (4k, 6) of the wrench cone: unit normal force, at each edge of the pyramid of each of k corners.

    The wrench of a corner p and a force f is ``[f; p x f]``. All feasible wrenches are sums of rays.

    Parameters
    ----------
    polygon : Polygon
        The contact [m].
    friction : float
        Coefficient mu.

    Raises
    ------
    ValueError
        If the friction is not a positive number.
    """
    _check(friction)
    corners = np.repeat(polygon.corners, 4, axis=0)
    forces = np.tile(np.column_stack((friction * CORNER_SIGNS, np.ones(4))), (len(polygon.corners), 1))
    return np.column_stack((forces, np.cross(np.column_stack((corners, np.zeros(len(corners)))), forces)))


def rectangle_cone(low: Any, high: Any, friction: float) -> Array:
    r"""Return the rows A (16, 6) of a rectangle: a wrench is feasible if ``A @ wrench <= 0``.

    These are the rows of Caron (thesis eq. 4.32 to 4.39), for a rectangle at any position. For the limits
    :math:`x_m, x_M, y_m, y_M` they are, before scaling to length one:

    .. math::
        |f_x| \le \mu f_z , \qquad |f_y| \le \mu f_z , \qquad
        y_m f_z \le \tau_x \le y_M f_z , \qquad -x_M f_z \le \tau_y \le -x_m f_z ,

    and for each of the four corners :math:`(a, b)`, with the signs :math:`s = 1` at :math:`x_m` and :math:`-1` at
    :math:`x_M`, :math:`t = 1` at :math:`y_m` and :math:`-1` at :math:`y_M`:

    .. math::
        \tau_z + b f_x - a f_y + \mu (s a + t b) f_z - \mu t \tau_x + \mu s \tau_y &\le 0 , \\
        -\tau_z - b f_x + a f_y + \mu (s a + t b) f_z - \mu t \tau_x + \mu s \tau_y &\le 0 .

    As printed, eq. 4.40 and 4.41 of the thesis and its torque rows accept nearly nothing.

    Parameters
    ----------
    low, high : array, shape (2,)
        Minimum and maximum coordinates of the rectangle [m].
    friction : float
        Coefficient mu.

    Raises
    ------
    ValueError
        If the rectangle has no area or the friction is not a positive number.
    """
    _check(friction)
    (x, y), (u, v) = (map(float, corner) for corner in (low, high))
    if not (x < u and y < v and math.isfinite(u - x + v - y)):
        raise ValueError(f"a rectangle from {(x, y)} to {(u, v)} m has no area; low must be below high")
    edges = np.array([(0, 0, y, -1, 0, 0), (0, 0, -u, 0, -1, 0), (0, 0, -v, 1, 0, 0), (0, 0, x, 0, 1, 0)])
    torque_rows = []
    for a, s in ((x, 1), (u, -1)):
        for b, t in ((y, 1), (v, -1)):  # the distance to a corner along both axes is linear on the rectangle
            torque_rows.append((b, -a, friction * (s * a + t * b), -friction * t, friction * s, 1))
    return _sorted(_friction_rows(friction), edges, _both_signs(np.array(torque_rows)))


def wrench_cone(polygon: Polygon, friction: float) -> Array | None:
    r"""Return the rows A (r, 6) of any polygon: a wrench is feasible if ``A @ wrench <= 0``; None without an area.

    The rows have length one. The first 4 limit the lateral forces. Then there is one row for each edge, which keeps the
    centre of pressure inside: for the outward normal (a, b) and the offset c of the edge,

    .. math::
        -a\,\tau_y + b\,\tau_x \le c f_z .

    The last rows limit the torque about z. Their number grows with the square of the number of corners. A polygon with
    few corners, for example of :func:`.inscribed.largest_box`, has few rows.

    Each torque row has a point :math:`(x_0, y_0)` and a linear function :math:`m` with
    :math:`m(x, y) \ge |x - x_0| + |y - y_0|` at each corner. The necessary rows are the vertices of the set of all such
    pairs. For the slope :math:`-\mathbf{n}` of :math:`m`, the best :math:`m` and :math:`(x_0, y_0)` follow from the
    four values :math:`s(\mathbf{n} + (\pm 1, \pm 1))` of the support function :math:`s` of the polygon. It is linear
    between the normals of the edges. A vertex therefore has its :math:`\mathbf{n}` at one of three kinds of points: at
    one of :math:`(\pm 1, \pm 1)`; at the intersection of two edge normals drawn from these points; or at the
    intersection of one such normal with the line on which both sums of opposite support values are equal.

    Parameters
    ----------
    polygon : Polygon
        The contact [m].
    friction : float
        Coefficient mu.

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
    torque_rows = np.column_stack((y0, -x0, -friction * m0, -friction * my, friction * mx, np.ones(len(m0))))
    normals, offsets = Polygon(corners).half_planes
    nothing = np.zeros(len(normals))
    edges = np.column_stack((nothing, nothing, -offsets, normals[:, 1], -normals[:, 0], nothing))
    return _sorted(
        _friction_rows(friction), _moved(edges, centre, size), _moved(_both_signs(torque_rows), centre, size)
    )


def margin(rows: Array | None, wrench: Any) -> float:
    """Return the smallest distance of a wrench to the rows of a cone: positive inside, -inf if it is not a number.

    It is also -inf without a cone: no wrench is feasible at a contact without an area.

    Parameters
    ----------
    rows : array, shape (r, 6), or None
        Of :func:`wrench_cone` or :func:`rectangle_cone`.
    wrench : array, shape (6,)
        [N, N m].
    """
    if rows is None:
        return -math.inf
    depth = -(rows @ np.asarray(wrench, float)).max()
    return float(depth) if not math.isnan(depth) else -math.inf


def _check(friction: float) -> None:
    if not (friction > 0 and math.isfinite(friction)):
        raise ValueError(f"friction {friction} must be a positive number")


def _friction_rows(friction: float) -> Array:
    """Return the 4 rows that limit fx and fy."""
    return np.array([(s * (1 - k), s * k, -friction, 0, 0, 0) for k in (0, 1) for s in (1, -1)], float)


def _both_signs(rows: Array) -> Array:
    """Return the rows that limit the torque about z from both sides: fx, fy and tz change their sign."""
    return np.concatenate((rows, rows * (-1, -1, 1, 1, 1, -1)))


def _moved(rows: Array, centre: Array, size: float) -> Array:
    """Return rows about the origin, in metres, from rows about a centre whose lengths are in units of a size."""
    x, y = centre / size
    a, b, c, p, q, r = rows.T
    p, q, r = p / size, q / size, r / size
    return np.column_stack((a + r * centre[1], b - r * centre[0], c - p * centre[1] + q * centre[0], p, q, r))


def _sorted(friction_rows: Array, edges: Array, torque_rows: Array) -> Array:
    """Return all rows with length one; the torque rows sorted by value and without duplicates."""
    friction_rows, edges, torque_rows = (
        rows / np.linalg.norm(rows, axis=1, keepdims=True) for rows in (friction_rows, edges, torque_rows)
    )
    _, once = np.unique(np.rint(torque_rows / ROW_TOLERANCE), axis=0, return_index=True)
    return np.concatenate((friction_rows, edges, torque_rows[once])) + 0.0


def _vertices(corners: Array) -> tuple[Array, Array, Array]:
    """Return points (2, n), slopes (2, n) and constants (n,) of the linear functions that limit the torque about z."""
    edges = np.roll(corners, -1, axis=0) - corners
    rays = np.stack((edges[:, 1], -edges[:, 0]), axis=1) / np.hypot(*edges.T)[:, None]
    found = [_extreme_functions(corners, -CORNER_SIGNS, np.eye(4, dtype=bool))]
    for k, start in enumerate(-CORNER_SIGNS):
        along = [np.zeros((len(rays), 1))]
        for l in range(4):
            if l == k:
                continue
            t = _ray_intersections(start, -CORNER_SIGNS[l], rays)
            i, j = np.isfinite(t).nonzero()
            found.append(_extreme_functions(corners, start + t[i, j][:, None] * rays[i], np.isin(np.arange(4), (k, l))))
            along.append(t)
        equal = _equal_sums(corners, start, rays, np.hstack(along))
        found.append(_extreme_functions(corners, equal, np.zeros(4, bool)))
    points, slopes, constants = (np.concatenate(parts, axis=-1) for parts in zip(*found))
    return points, slopes, constants


def _ray_intersections(start: Array, other: Array, rays: Array) -> Array:
    """Return at which distance along each ray (k,) the same rays from another start meet it (k, k); inf if never."""
    gap = other - start
    cross = rays[:, None, 0] * rays[None, :, 1] - rays[:, None, 1] * rays[None, :, 0]
    to_other = gap[0] * rays[:, 1] - gap[1] * rays[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t, u = to_other[None, :] / cross, to_other[:, None] / cross
    return np.where((cross != 0) & (t >= 0) & (u >= 0) & np.isfinite(t), t, np.inf)


def _equal_sums(corners: Array, start: Array, rays: Array, along: Array) -> Array:
    """Return the points (n, 2) on rays, between marks (k, m), at which both sums of opposite values are equal."""
    along = np.sort(along, axis=1)
    is_finite = np.isfinite(along)
    at = start + np.where(is_finite, along, 0.0)[:, :, None] * rays[:, None, :]
    values = _support_values(corners, at.reshape(-1, 2)) @ (1, -1, -1, 1)
    values = np.where(is_finite, values.reshape(along.shape), np.nan)
    before, after = values[:, :-1], values[:, 1:]
    i, j = ((before < 0) & (after > 0) | (before > 0) & (after < 0)).nonzero()
    fraction = before[i, j] / (before[i, j] - after[i, j])
    return start + (along[i, j] + fraction * (along[i, j + 1] - along[i, j]))[:, None] * rays[i]


def _support_values(corners: Array, slopes: Array) -> Array:
    """Return the support function of the polygon at slopes (n, 2), shifted by each of the four signs: (n, 4)."""
    return ((slopes @ corners.T)[:, None, :] + CORNER_SIGNS @ corners.T).max(axis=2)


def _extreme_functions(corners: Array, slopes: Array, bounds: BoolArray) -> tuple[Array, Array, Array]:
    """Return the smallest functions of slopes -n (n, 2) at both ends of their points, if the ``bounds`` are active."""
    s = _support_values(corners, slopes)
    outer, inner = (s[:, 0] + s[:, 3]) / 2, (s[:, 1] + s[:, 2]) / 2
    constant = np.maximum(outer, inner)
    is_outer = outer >= inner
    is_even = np.abs(outer - inner) <= ROW_TOLERANCE * (1 + np.abs(constant))
    found = []
    for end in (0, 1):
        total = np.where(is_outer, (s[:, 0] - s[:, 3]) / 2, s[:, 0] - constant if end == 0 else constant - s[:, 3])
        difference = np.where(is_outer, s[:, 1] - constant if end == 0 else constant - s[:, 2], (s[:, 1] - s[:, 2]) / 2)
        is_active = (ACTIVE_BOUNDS[np.where(is_outer, 0, 1), end] | ~bounds).all(axis=1) | is_even
        found.append(np.stack(((total + difference) / 2, (total - difference) / 2, *-slopes.T, constant))[:, is_active])
    table = np.concatenate(found, axis=1)
    return table[:2], table[2:4], table[4]
