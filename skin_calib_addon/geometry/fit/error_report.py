"""Distances between a surface and its mesh, in both directions: dense samples, and a search around the largest."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, IntArray, cross, distinct, norms, pairs_of, unit
from ...common.errors import EmptySection
from ...common.surface_errors import DistanceStatistics
from ..mesh.distance import closest, dots
from ..mesh.face_points import GOLDEN_RATIO, points_at, points_by_area
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.samples import RaySamples
from ..surface.bspline import BSplineSurface
from ..surface.distance import dense_lines, is_sampled
from ..surface.footpoints import footpoints, near_footpoints

# [1] points of the mesh, evenly by area, that count in its means. Larger: more accurate means, more time.
MESH_POINTS = 8_000
# [1] most points for these, where the surface covers only a small part of the mesh. Larger: more accurate means there,
# more time.
MAX_MESH_POINTS = 16 * MESH_POINTS
# [1] parts, per direction, of a cell of the surface that is only partly measured. Larger: more accurate, more time.
PARTS = 4
# [1] samples around which a maximum is searched in each round, by distance and by slope each. Larger: a safer maximum,
# more time.
PEAKS = 40
ROUNDS = 8  # [1] rounds of this search, in smaller and smaller cells. Larger: a more accurate maximum, more time
PEAK_POINTS = 3  # [1] points of a cell, per direction, from edge to edge. Larger: a safer maximum, more time
# [distance of samples] from a sample that counts up to which the cells of others are searched, too. Larger: a safer
# maximum at the border of what counts, more time; smaller: cells at this border are left out.
BORDER = 2.0
# [1] ratio of the distance of a vertex, which is an estimate, to the largest of the samples from which on the surface
# below it is measured. Larger: less time, and a maximum below a corner of facets can be missed.
FOOT_RATIO = 0.9
EXACT_VERTICES = 30  # [1] vertices farthest by their estimates whose distance is computed exactly. Larger: more time
# [1] mean sign of the cosines between the rays and the faces that they hit from which on the winding counts: inner
# walls, which face the other side, are no cover. Larger: inner walls count on meshes with some wrong faces.
MIN_MEAN_FACING = 0.5
# [cosine] between the normals of a face and of the surface above which the face belongs to the cover, not to a wall.
# Larger: fewer faces count.
MIN_COVER_COSINE = 0.5
# [standard deviations] half width of a 95 % confidence interval. Contract: as the documentation states it.
CONFIDENCE_FACTOR = 1.96
NOT_COUNTED = -1.0  # [m] instead of the distance of a point that does not count

IsCover = Callable[[Array], BoolArray]  # from points (k, 3) [m] of a mesh to those that count
# From parameters (k, 2) on faces (k,) of a mesh, or of a surface, to distances (k,) [m], their slopes (k, 2) by the
# parameters [m], and whether they count (k,)
Distances = Callable[[IntArray, Array], tuple[Array, Array, BoolArray]]


@dataclass(frozen=True, eq=False)
class VertexFeet:
    """Nearly the footpoints of the vertices of a mesh."""

    vertices: IntArray  # (k,) those with faces
    uv: Array  # (k, 2)
    distances: Array  # (k,) [m]
    normals: Array  # (k, 3) of the surface

    @classmethod
    def of(cls, mesh: TriangleMesh, surface: BSplineSurface) -> "VertexFeet":
        """Return those of the vertices that belong to faces."""
        vertices = distinct(mesh.faces)
        return cls(vertices, *near_footpoints(surface, mesh.vertices[vertices]))


def statistics_of(distances: Array, weights: Array, largest: float) -> DistanceStatistics:
    """Return the statistics of samples (k,) [m]; the samples are at least as accurate as random ones."""
    fraction = weights / weights.sum()
    mean, square = float((fraction * distances).sum()), float((fraction * distances**2).sum())
    spread = max(square - mean**2, 0.0) * float((fraction**2).sum())
    return DistanceStatistics(mean, square**0.5, largest, CONFIDENCE_FACTOR * spread**0.5)


def largest_around(
    distances: Distances,
    face: IntArray,
    at: Array,
    width: Array,
    found: tuple[Array, Array, BoolArray],
    largest: float,
    is_open: BoolArray,
) -> tuple[float, IntArray, Array | None]:
    """Return the largest distance in cells around samples [m], with face and parameters (2,) if above ``largest``.

    Each round divides the open cells with the largest distances at their centres (k, 2), and those whose slopes allow
    the largest distances. ``width`` (k, 2) is half of their width. A cell whose centre does not count is open next to
    what counts, because the distance may be largest at the border between them.
    """
    step, of, where = np.linspace(-1, 1, PEAK_POINTS), face[0], None
    offsets = pairs_of(step, step)
    for _ in range(ROUNDS):
        distance, slopes, counts = found
        limits = np.where(is_open, distance + dots(slopes, width), NOT_COUNTED)
        sizes = np.where(counts, distance, NOT_COUNTED), limits
        peaks = np.unique([np.argsort(-x, kind="stable")[:PEAKS] for x in sizes])
        peaks = peaks[limits[peaks] > largest]
        if len(peaks) == 0:
            break
        at = (at[peaks, None] + offsets * width[peaks, None]).reshape(-1, 2)
        face, width = face[peaks].repeat(len(offsets)), (width[peaks] / (PEAK_POINTS - 1)).repeat(len(offsets), axis=0)
        found = distances(face, at)
        distance = np.where(found[2], found[0], NOT_COUNTED)
        is_open = found[2].reshape(-1, len(offsets)).any(axis=1).repeat(len(offsets))
        best = int(np.argmax(distance))
        if distance[best] > largest:
            largest, of, where = float(distance[best]), face[best], at[best]
    return largest, of, where


def distances_at(mesh: TriangleMesh, surface: BSplineSurface, at: Array) -> tuple[Array, Array, Array]:
    """Return distances (k,) [m] of a surface from a mesh at parameters (k, 2), slopes (k, 2), area elements (k,)."""
    r = surface.derivatives(at)
    found, _, foot = closest(mesh, r[0, 0])
    normals = cross(r[1, 0], r[0, 1])
    slopes = _sine(r[0, 0] - foot, unit(normals))[:, None] * np.stack((norms(r[1, 0]), norms(r[0, 1])), axis=1)
    return found, slopes, norms(normals)


def mean_to_mesh(mesh: TriangleMesh, surface: BSplineSurface, is_measured: Callable[[Array], BoolArray]) -> float:
    """Return the mean of ``surface_to_mesh`` alone [m]."""
    at, width = measured_samples(surface, is_measured)
    distances, _, areas = distances_at(mesh, surface, at)
    return float(np.average(distances, weights=areas * width.prod(axis=1)))


def surface_to_mesh(
    mesh: TriangleMesh, surface: BSplineSurface, is_measured: Callable[[Array], BoolArray], feet: VertexFeet
) -> tuple[DistanceStatistics, Array]:
    """Return the distances from a surface to the mesh where it is measured, and the parameters (2,) of the largest.

    It is often largest below a vertex, but not larger than the distance of that vertex from the surface.
    """

    def distances(face: IntArray, at: Array) -> tuple[Array, Array, BoolArray]:
        for axis in (0, 1):
            at[:, axis] = at[:, axis] % 1.0 if surface.closed[axis] else np.clip(at[:, axis], 0, 1)
        found, slopes = np.full(len(at), NOT_COUNTED), np.zeros((len(at), 2))
        counts = is_measured(at)
        found[counts], slopes[counts], _ = distances_at(mesh, surface, at[counts])
        return found, slopes, counts

    at, width = measured_samples(surface, is_measured)
    found, slopes, areas = distances_at(mesh, surface, at)
    even, weights = found, areas * width.prod(axis=1)
    below = feet.uv[feet.distances > FOOT_RATIO * found.max()]
    below = below[is_measured(below)]
    more, more_slopes, _ = distances_at(mesh, surface, below)
    at, found, slopes = (np.concatenate(pair) for pair in ((at, below), (found, more), (slopes, more_slopes)))
    width = np.concatenate((width, np.tile(width.max(axis=0), (len(below), 1))))
    best, face, all_count = int(np.argmax(found)), np.zeros(len(at), np.int64), np.ones(len(at), bool)
    samples = found, slopes, all_count
    largest, _, where = largest_around(distances, face, at, width, samples, float(found[best]), all_count)
    return statistics_of(even, weights, largest), at[best] if where is None else where


def measured_samples(surface: BSplineSurface, is_measured: Callable[[Array], BoolArray]) -> tuple[Array, Array]:
    """Return parameters (k, 2) in the cells that are measured, and half of the widths (k, 2) of the cells.

    Each row and each column of samples has another position in its cells, because samples with the period of facets
    see only a part of them. Cells next to others that are not measured are divided, because a boundary cuts them.
    """
    u, v = dense_lines(surface)
    width = np.array((0.5 / len(u), 0.5 / len(v)))
    shifts = [(GOLDEN_RATIO * np.arange(len(x)) % 1 * 2 - 1) * half for x, half in zip((v, u), width)]
    uv = np.stack((u[:, None] + shifts[0], v + shifts[1][:, None]), axis=2).reshape(-1, 2)
    grid = is_measured(uv).reshape(len(u), len(v)).astype(np.int8)
    if surface.closed[1]:
        grid = np.hstack((grid[:, -1:], grid, grid[:, :1]))
    least, most = (f(grid, 3, mode="nearest") for f in (minimum_filter, maximum_filter))
    if surface.closed[1]:
        least, most = least[:, 1:-1], most[:, 1:-1]
    whole, cut = np.flatnonzero(least), np.flatnonzero(most > least)
    middle = (np.arange(PARTS) + 0.5) / PARTS * 2 - 1
    parts = (pairs_of(u, v)[cut, None] + pairs_of(middle, middle) * width).reshape(-1, 2)
    parts = parts[is_measured(parts)]
    if len(whole) + len(parts) == 0:
        raise EmptySection("No sample ray hit the mesh next to another one, so the error is unknown. Move the planes.")
    widths = np.concatenate((np.tile(width, (len(whole), 1)), np.tile(width / PARTS, (len(parts), 1))))
    return np.concatenate((uv[whole], parts)), widths


def mesh_to_surface(
    mesh: TriangleMesh,
    surface: BSplineSurface,
    known: BoolArray,
    side: int,
    feet: VertexFeet,
    is_cover: IsCover | None = None,
) -> DistanceStatistics:
    """Return the distances from the mesh to the surface.

    Only those parts of the mesh count that have their footpoint inside the surface, over sites that hit the mesh, with
    a normal nearly parallel to that of the surface. Where the winding of the faces is mixed, it may be antiparallel.
    They count at any distance: a fold that the surface misses is an error, and a part below it is not distinguished.
    """
    sides = mesh.triangles[:, 1:] - mesh.triangles[:, :1]

    def distances(face: IntArray, at: Array) -> tuple[Array, Array, BoolArray]:
        at[:, 0] = np.clip(at[:, 0], 0, 1)
        at[:, 1] = np.clip(at[:, 1], 0, 1 - at[:, 0])
        places, of_faces = points_at(mesh, face, at), mesh.face_normals[face]
        uv, found, normals = near_footpoints(surface, places)
        counts = is_inside(surface, uv, known) & is_parallel(of_faces, normals, side)
        if is_cover is not None:
            counts[counts] = is_cover(places[counts])
        return found, _sine(of_faces, normals)[:, None] * norms(sides[face]), counts

    count = MESH_POINTS
    face, at = points_by_area(mesh, count)
    found = distances(face, at)
    total = int(found[2].sum())
    if total < MESH_POINTS / 2:
        count = min(MESH_POINTS**2 // max(total, 1), MAX_MESH_POINTS)
        face, at = points_by_area(mesh, count)
        found = distances(face, at)
        total = int(found[2].sum())
    largest = largest_of_vertices(mesh, surface, known, side, feet, is_cover)
    if total:
        apart = np.sqrt(mesh.face_areas.sum() / count)
        width = np.repeat(apart / np.sqrt(8 * mesh.face_areas[face, None]), 2, axis=1)
        places = points_at(mesh, face, at)
        near = np.isfinite(cKDTree(places[found[2]]).query(places, distance_upper_bound=BORDER * apart)[0])
        _, best, where = largest_around(distances, face, at, width, found, largest, near)
        if where is not None:  # the search has estimates
            largest = max(largest, float(footpoints(surface, points_at(mesh, best[None], where[None]))[1][0]))
    if largest < 0:
        raise EmptySection("No mesh face is near the surface with a matching normal. Move the planes.")
    return statistics_of(found[0][found[2]], np.ones(total), largest)


def largest_of_vertices(
    mesh: TriangleMesh,
    surface: BSplineSurface,
    known: BoolArray,
    side: int,
    feet: VertexFeet,
    is_cover: IsCover | None,
) -> float:
    """Return the largest distance of a vertex that counts, because one of its faces does [m]; -1 if none counts."""
    normals = np.zeros(mesh.vertices.shape)
    normals[feet.vertices] = feet.normals
    parallel = [is_parallel(mesh.face_normals, normals[corner], side) for corner in mesh.corners]
    counts = np.bincount(np.concatenate(mesh.corners), np.concatenate(parallel), len(normals))[feet.vertices] > 0
    counts &= is_inside(surface, feet.uv, known)
    if is_cover is not None:
        counts[counts] = is_cover(mesh.vertices[feet.vertices[counts]])
    farthest = np.argsort(-feet.distances[counts], kind="stable")[:EXACT_VERTICES]
    points = mesh.vertices[feet.vertices[counts][farthest]]
    return float(footpoints(surface, points)[1].max(initial=NOT_COUNTED))


def winding(mesh: TriangleMesh, samples: RaySamples) -> int:
    """Return 1 if the faces that the rays hit face outward, -1 if they face inward, and 0 if they are mixed."""
    hit = ~np.isnan(samples.residuals)
    facing = np.sign((samples.rays[hit] * mesh.face_normals[samples.faces[hit]]).sum(axis=1)).mean()
    return int(np.sign(facing)) if abs(facing) > MIN_MEAN_FACING else 0


def is_parallel(normals: Array, of_surface: Array, side: int) -> BoolArray:
    """Return which normals of faces are nearly parallel to those of the surface."""
    cosine = dots(normals, of_surface)
    return (side * cosine if side else np.abs(cosine)) > MIN_COVER_COSINE


def is_inside(surface: BSplineSurface, foot: Array, known: BoolArray) -> BoolArray:
    """Return which footpoints (k, 2) are inside the surface, over sites that hit the mesh (``known``)."""
    inside = is_sampled(surface, foot, known)
    for axis in (0, 1):
        if not surface.closed[axis]:
            inside &= (foot[:, axis] > 0) & (foot[:, axis] < 1)
    return inside


def _sine(directions: Array, normals: Array) -> Array:
    """Return the sine of the angle between directions (k, 3) of any length and unit normals (k, 3); 0 without one."""
    return np.sqrt(np.clip(1 - dots(unit(directions), normals) ** 2, 0, 1))
