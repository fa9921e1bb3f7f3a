"""Regions that may carry skin: full turns about axes, and faces in all directions."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..common.arrays import Array, BoolArray, unit
from ..common.warnings import point_of
from ..geometry.grid.axis import Axis
from ..geometry.grid.grids import Across, Region, Tube
from ..geometry.mesh.cover import CoverSpec, Cut, cut_cover
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..geometry.mesh.visibility import view_frames
from ..skin.boards.ground import MAX_DISTANCE
from .link_points import POINT_DISTANCE, LinkPoints

# [cosine] between a normal and the rays of a region above which the region can cover a point.
MIN_RAY_COSINE = 0.5
# [1] directions of faces, of those with the most area around them. Larger: more surfaces are tried, more
# time (half: 921, double: 950 instead of 943 cm^2 on four links of the G1, the latter in 1.6 times the time).
FACES = 24
# [cosine] between a direction and the normals of the area around it. Larger: directions of smaller faces come
# first (12 degrees: 946, 50 degrees: 938 instead of 943 cm^2 on four links of the G1).
NEAR_COSINE = np.cos(np.deg2rad(25.0))
# [cosine] between two directions of faces above which only the first is tried. Larger: more are tried that are
# nearly the same, more time (4 degrees: no effect on four links of the G1; 16 degrees: one surface less).
SAME_COSINE = np.cos(np.deg2rad(8.0))
# [m] height above a face from which on another part of the link is in front of it. Larger: narrower gaps of forks and
# grippers have no skin. Derived: an inclined face rises by less within a cell of ``POINT_DISTANCE``.
MIN_GAP = 2.5 * POINT_DISTANCE
# [cosine] between the normals of a flat face and their mean. Larger: faces that bend a little are not flat.
FLAT_COSINE = np.cos(np.deg2rad(2.0))
# [m] width of the rim of a flat face that shows whether the face ends at edges. Larger: rounder edges are edges.
RIM_WIDTH = 12e-3
# [cosine] between the normals of a flat face and its rim above which the face continues there. Larger: as RIM_WIDTH.
RIM_COSINE = np.cos(np.deg2rad(30.0))
# [1] Largest area of the rim where a flat face continues, in areas of the face. Larger: flat parts are cut out of bent
# shells (without a limit 751 instead of 925 boards on the trunk of a T1); smaller: soles with round edges have no
# surface of their own (that of the T1 has 0.09).
MAX_SMOOTH_RIM = 0.12
# [cosine] between the direction of a round end and the normals on it. Larger: smaller ends; smaller: boards on it and
# on the tube around it overlap (capsules with radii of 8 to 14 mm have 3 to 11 boards of 3 mm within 45
# degrees of the pole, without such ends 0 to 2).
END_COSINE = np.cos(np.deg2rad(50.0))
# [1] decimals of the heights of cuts [m]. Larger: small differences of the mesh move them.
CUT_DECIMALS = 3
# [1] decimals of points [m] and directions. Larger: Blender has another plan. Format: what single precision keeps.
DECIMALS = 6


@dataclass(frozen=True)
class Candidate:
    """A region, and what it is called in reasons."""

    region: Region
    words: str
    cuts: tuple[Cut, ...] = ()  # they remove what rays would hit first

    @property
    def cover(self) -> CoverSpec:
        """Return the cover of its surface."""
        return CoverSpec("seen", self.cuts)

    def mesh(self, seen: TriangleMesh) -> TriangleMesh:
        """Return its part of the faces of the link that can be seen."""
        return cut_cover(seen, CoverSpec("all", self.cuts)) if self.cuts else seen

    def rays(self, points: Array) -> Array:
        """Return the directions of the rays through points (k, 3), shape (k, 3)."""
        region = self.region
        if isinstance(region, Across):
            return np.broadcast_to(unit(region.normal), points.shape)
        assert region.axis is not None
        direction, arms = unit(region.axis.direction), points - region.axis.point
        return unit(arms - (arms @ direction)[:, None] * direction)

    def bound(self, on: LinkPoints) -> float:
        """Return an upper bound of the area that it adds [m^2]."""
        faces_rays = (on.normals * self.rays(on.points)).sum(axis=1) > MIN_RAY_COSINE
        for cut in self.cuts:
            faces_rays &= (on.points - cut.point) @ np.array(cut.normal) > 0
        return float(on.areas[on.wanted & faces_rays].sum())


def candidates(on: LinkPoints, axes: Iterable[tuple[Axis, str]], least: float) -> Iterator[Candidate]:
    """Yield the regions that are tried on a link."""
    for axis, words in (*axes, *own_axes(on)):
        yield Candidate(Tube(axis), f"tube about {words}")
    for k, normal in enumerate(face_directions(on)):
        region = Across(normal=tuple(np.round(normal, DECIMALS).tolist()))
        yield Candidate(region, f"face {k}")
        for cut in cuts_in_front(on, np.array(region.normal), least):
            yield Candidate(region, f"face {k}, behind another part of the link", (cut,))


def flat_faces(on: LinkPoints, least: float) -> Iterator[tuple[Candidate, BoolArray]]:
    """Yield the flat faces of at least an area [m^2], the largest of each direction first, and their points (k,)."""
    left = on.free.copy()
    for direction in face_directions(on):
        while True:
            facing = on.wanted & left & (on.normals @ direction > SAME_COSINE)
            normal = unit(on.areas[facing] @ on.normals[facing])
            rows = np.flatnonzero(on.wanted & left & (on.normals @ normal > FLAT_COSINE))
            rows = rows[np.argsort(on.points[rows] @ normal, kind="stable")]
            heights, areas = on.points[rows] @ normal, np.append(0.0, np.cumsum(on.areas[rows]))
            ends = np.searchsorted(heights, heights + MAX_DISTANCE)
            sums = areas[ends] - areas[:-1]
            if sums.max(initial=0.0) < least:
                break
            first = int(sums.argmax())
            points = np.zeros(len(left), bool)
            points[rows[first : ends[first]]] = True
            if ends_at_edges(on, points, normal):
                yield Candidate(Across(normal=tuple(np.round(normal, DECIMALS).tolist())), "flat face"), points
            left &= ~points


def ends_at_edges(on: LinkPoints, points: BoolArray, normal: Array) -> bool:
    """Return whether a link bends away around a flat face; if it does not, one surface covers more than the face."""
    around = ~points & np.isfinite(cKDTree(on.points[points]).query(on.points, distance_upper_bound=RIM_WIDTH)[0])
    smooth = around & (on.normals @ normal > RIM_COSINE)
    return bool(on.areas[smooth].sum() <= MAX_SMOOTH_RIM * on.areas[points].sum())


def round_ends(on: LinkPoints) -> Iterator[tuple[Candidate, BoolArray]]:
    """Yield the faces across both ends of the longest direction of a link, and their points (k,)."""
    axis, _ = next(own_axes(on))
    for sign in (1.0, -1.0):
        normal = sign * unit(axis.direction)
        points = on.wanted & (on.normals @ normal > END_COSINE)
        if points.any():
            yield Candidate(Across(normal=tuple(np.round(normal, DECIMALS).tolist())), "round end"), points


def cuts_in_front(on: LinkPoints, normal: Array, least: float) -> Iterator[Cut]:
    """Yield cuts across a direction that remove what is in front of free faces, those with the most area behind first.

    Parallel rays along the direction hit the outermost part of a link, such as the outer side of a fork, and not the
    inner side of its other tine.
    """
    facing = on.free & (on.normals @ normal > NEAR_COSINE)
    foot, front = on.points[facing] @ normal, heights_in_front(on, on.points[facing], normal)
    hidden = np.isfinite(front)
    begin, end, areas = foot[hidden] + MAX_DISTANCE, front[hidden] - MAX_DISTANCE, on.areas[facing][hidden]
    while len(begin):
        levels = np.concatenate((begin, end))
        order = np.argsort(levels, kind="stable")
        behind = np.cumsum(np.concatenate((areas, -areas))[order])
        most = int(behind.argmax())
        if behind[most] < least:
            return
        level = float(np.round((levels[order[most]] + levels[order[most + 1]]) / 2, CUT_DECIMALS))
        yield Cut(point_of(np.round(level * normal, DECIMALS) + 0.0), point_of(0.0 - normal))
        others = (begin > level) | (end < level)
        begin, end, areas = begin[others], end[others], areas[others]


def heights_in_front(on: LinkPoints, points: Array, normal: Array) -> Array:
    """Return the height (n,) [m] of the next part of the link above points, at least ``MIN_GAP``, or infinity."""
    every = np.vstack((on.seen_points, points))
    heights = every @ normal
    places = np.floor(every @ np.linalg.svd(normal[None])[2][1:].T / POINT_DISTANCE)  # in two directions across it
    x, y = (places - places.min(axis=0)).T
    extent = np.ptp(heights) + 2 * MIN_GAP
    starts = (x * (y.max() + 1) + y) * extent  # of the columns, one above the other
    parts, feet = np.split(starts + heights - heights.min(), [len(on.seen_points)])
    parts = np.append(np.sort(parts), np.inf)
    found = parts[np.searchsorted(parts, feet + MIN_GAP)]
    is_in_column = found < starts[len(on.seen_points) :] + extent
    return np.where(is_in_column, points @ normal + found - feet, np.inf)


def own_axes(on: LinkPoints) -> Iterator[tuple[Axis, str]]:
    """Yield the axes that follow from the shape: principal axes, and the direction that normals avoid."""
    weights = on.areas * on.free
    middle = weights @ on.points / weights.sum()
    arms = (on.points - middle) * np.sqrt(weights)[:, None]
    for k, direction in enumerate(np.linalg.eigh(arms.T @ arms)[1].T[::-1]):
        yield axis_between(on, direction), f"principal axis {k + 1}"
    normals = on.normals * np.sqrt(weights)[:, None]
    yield axis_between(on, np.linalg.eigh(normals.T @ normals)[1][:, 0]), "the direction that its normals avoid"


def axis_between(on: LinkPoints, direction: Array) -> Axis:
    """Return the axis of a direction that the normals of free points meet most nearly."""
    towards = on.normals @ direction
    across = unit(on.normals - towards[:, None] * direction)
    weights = on.areas * on.free * np.maximum(1 - towards**2, np.finfo(float).eps)
    middle = weights @ on.points / weights.sum()
    # The point p with the least sum of squared distances from the lines: sum w (I - n n^T - d d^T) (x - p) = 0.
    projections = np.eye(3) - across[:, :, None] * across[:, None] - np.multiply.outer(direction, direction)
    matrix = np.einsum("k,kij->ij", weights, projections) / weights.sum()
    right = np.einsum("k,kij,kj->i", weights, projections, on.points - middle) / weights.sum()
    point = middle + np.linalg.lstsq(matrix, right, rcond=1e-3)[0]
    return axis_of(point, direction)


def axis_of(point: Array, direction: Array) -> Axis:
    """Return an axis through a point (3,) [m] along a direction (3,), rounded as Blender keeps it."""
    (x, y, z), (a, b, c) = np.round(point, DECIMALS).tolist(), np.round(direction, DECIMALS).tolist()
    return Axis((x, y, z), (a, b, c))


def face_directions(on: LinkPoints) -> Array:
    """Return the directions that most of the free area faces, shape (k, 3)."""
    half = view_frames()[:, 2]
    directions = np.concatenate((half, -half))
    free = on.free
    weights = (on.normals[free] @ directions.T > NEAR_COSINE).T @ on.areas[free]
    chosen: list[Array] = []
    for k in np.argsort(-weights, kind="stable"):
        near = on.normals[free] @ directions[k] > NEAR_COSINE
        direction = unit(on.areas[free][near] @ on.normals[free][near])
        if weights[k] and all(direction @ other < SAME_COSINE for other in chosen):
            chosen.append(direction)
        if len(chosen) == FACES:
            break
    return np.array(chosen).reshape(-1, 3)
