"""Individual planes: from the lines of another grid, and edits of a row of planes."""

import numpy as np
from scipy.spatial.transform import Rotation

from ...common.arrays import Array, unit
from ...common.errors import InvalidPlan
from ..sampling.lines import LineGrid
from ..sampling.planes import Planes

MIN_V_PLANES = 2  # [1] full planes of a closed grid
# [1] second singular value of the normals below which planes are parallel and have no common line. Larger: more planes
# are refused.
PARALLEL_TOLERANCE = 1e-3


def planes_of(lines: LineGrid) -> tuple[Planes, Planes]:
    """Return the u-planes and v-planes of the lines of a grid, exactly or approximately.

    Full planes have lines on both sides of the axis. The lines of a closed grid with uneven angles or a bent axis are
    in no such planes. Their v-planes contain the straight line nearest to the axis, at even angles from the first line.
    """
    if lines.closed:
        return lines.planes_u, _turned(lines)
    return lines.planes_u, _across(lines)


def _turned(lines: LineGrid) -> Planes:
    centres = lines.origins.mean(axis=1)
    centre = centres.mean(axis=0)
    along = np.linalg.svd(centres - centre)[2][0]
    if along @ (centres[-1] - centres[0]) < 0:
        along = -along
    first = lines.directions[:, 0].mean(axis=0)
    normal = unit(np.cross(first, along))  # the first line of these planes is the first of the grid, not its opposite
    count = max(MIN_V_PLANES, len(lines.v_names) // 2)
    return Planes(np.tile(centre, (count, 1)), _fan(normal, along, count))


def _fan(normal: Array, axis: Array, count: int) -> Array:
    """Return the normals of planes about an axis at even angles over half a turn, shape (count, 3)."""
    return np.asarray(Rotation.from_rotvec(np.outer(np.arange(count) * np.pi / count, axis)).apply(np.array(normal)))


def _across(lines: LineGrid) -> Planes:
    points, normals = [], []
    for j in range(len(lines.v_names)):
        origins = lines.origins[:, j]
        centre = origins.mean(axis=0)
        scale = np.linalg.norm(origins - centre, axis=1).max() or 1.0
        spread = np.linalg.svd(np.concatenate((lines.directions[:, j], (origins - centre) / scale)))[2]
        points.append(centre)
        normals.append(spread[2])
    rows = np.array(normals)
    next_one = np.roll(lines.origins + lines.directions, -1, axis=1) - lines.origins - lines.directions
    ahead = next_one[:, :-1].mean(axis=(0, 1))
    return Planes(np.array(points), rows * np.where(rows @ ahead < 0, -1.0, 1.0)[:, None])


def between(planes: Planes, i: int) -> tuple[Array, Array]:
    """Return the plane halfway from plane ``i`` to the next, or half a step beyond the last."""
    if len(planes) == 1:
        return planes.points[0], planes.normals[0]
    if i + 1 < len(planes):
        one, other, fraction = i, i + 1, 0.5
    else:
        one, other, fraction = i - 1, i, 1.5
    points, normals = planes.points, _aligned(planes.normals)
    return points[one] + fraction * (points[other] - points[one]), unit(
        (1 - fraction) * normals[one] + fraction * normals[other]
    )


def through(planes: Planes, point: Array, around: bool) -> tuple[int, Array, Array]:
    """Return a plane through a point, and where it belongs in a row of planes.

    Between two planes, its normal is between theirs: it contains the line in which they intersect. Before the first and
    beyond the last it is parallel to the nearest.
    """
    points, normals = planes.points, _aligned(planes.normals)
    if around and len(planes) >= MIN_V_PLANES:
        points, normals = np.concatenate((points, points[:1])), np.concatenate((normals, -normals[:1]))
    heights = ((point - points) * normals).sum(axis=1)
    passed = np.flatnonzero(np.sign(heights[:-1]) != np.sign(heights[1:]))
    if len(passed):
        one = int(passed[np.argmin(np.abs(heights[passed]) + np.abs(heights[passed + 1]))])
        below, above = np.abs(heights[[one, one + 1]]) / np.abs(heights[[one, one + 1]]).sum()
        normal = unit(above * normals[one] + below * normals[one + 1])
        at, index = above * points[one] + below * points[one + 1], one + 1
    else:
        is_last = abs(heights[-1]) < abs(heights[0]) if len(planes) > 1 else heights[0] > 0
        at, normal, index = (points[-1], normals[-1], len(planes)) if is_last else (points[0], normals[0], 0)
    return index, at + ((point - at) @ normal) * normal, normal


def spread(planes: Planes, around: bool) -> Planes:
    """Return planes at even steps from the first to the last, or at even angles."""
    if around:
        return _spread_around(planes)
    fraction, normals = np.linspace(0, 1, len(planes))[:, None], _aligned(planes.normals)
    points = planes.points[0] + fraction * (planes.points[-1] - planes.points[0])
    return Planes(points, unit(normals[0] + fraction * (normals[-1] - normals[0])))


def _spread_around(planes: Planes) -> Planes:
    """Return planes about the line nearest to all planes, from the first on, in the direction of the second."""
    count, (_, sizes, axes) = len(planes), np.linalg.svd(planes.normals)
    if count < MIN_V_PLANES or sizes[1] < PARALLEL_TOLERANCE:
        raise InvalidPlan("The planes are parallel, so they have no common line. Rotate one of them first.")
    axis = axes[2] if axes[2] @ np.cross(planes.normals[0], planes.normals[1]) >= 0 else -axes[2]
    levels = (planes.points * planes.normals).sum(axis=1)
    point = np.linalg.lstsq(planes.normals, levels, rcond=PARALLEL_TOLERANCE)[0]
    point = point + ((planes.points.mean(axis=0) - point) @ axis) * axis
    return Planes(np.tile(point, (count, 1)), _fan(planes.normals[0], axis, count))


def mirrored(planes: Planes, i: int) -> Planes:
    """Return the planes up to ``i``, followed by their mirror images; later planes are replaced."""
    if i == 0:
        raise InvalidPlan("There is no plane before the first one. Choose the plane of symmetry.")
    centre, normal = planes.points[i], planes.normals[i]
    points, normals = planes.points[i - 1 :: -1], planes.normals[i - 1 :: -1]
    points = points - 2 * ((points - centre) @ normal)[:, None] * normal
    normals = -(normals - 2 * (normals @ normal)[:, None] * normal)
    return Planes(np.concatenate((planes.points[: i + 1], points)), np.concatenate((planes.normals[: i + 1], normals)))


def _aligned(normals: Array) -> Array:
    """Return the normals, each reversed if it is opposite to the one before it."""
    signs = np.cumprod(np.r_[1.0, np.where((normals[1:] * normals[:-1]).sum(axis=1) < 0, -1.0, 1.0)])
    return normals * signs[:, None]
