"""The shells of a mesh, and which of them are inside of others."""

from functools import lru_cache

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from ...common.arrays import Array, BoolArray, IntArray, locked
from ..components import components
from .distance import closest, dots
from .face_points import points_at, points_by_area, sample_faces
from .triangle_mesh import TriangleMesh

# [fraction of the area] A shell with more of its area inside the hull of the shells kept so far is an inner part.
# Larger: more inner parts are kept.
INNER_AREA_FRACTION = 0.5
# [fraction of the distance from the middle] by which a point must be inside a hull. Larger: parts that are flush with
# it are no inner parts; smaller: rounding decides.
HULL_TOLERANCE = 1e-6
# [fraction of the distance from the middle] by which a shell must be outside the hull of those kept so far to make it
# larger. Larger: faster for links with many parts, and less exact.
HULL_GROWTH = 1e-4
# [fraction of the area of the mesh] from which a shell can make this hull larger. Larger: stray faces cost less, and
# what is inside of small parts that stick out is kept.
HULL_AREA = 1e-3
# [1] points, even by area, that are inside the hull or not. Larger: more accurate fractions, more time.
PART_POINTS = 1000
# [fraction of the root of the area of the mesh] distance of these points for smaller shells, each face having at least
# one. Larger: less accurate fractions, less time.
SMALL_PART_FRACTION = 0.003
# [largest coordinate] distance up to which vertices are the same for shells: rounding to single precision moves two
# equal points apart by up to 0.87 of it. Larger: narrow gaps between parts are closed.
ROUNDING = 2.0**-22


def shells(mesh: TriangleMesh) -> IntArray:
    """Return the number of the shell of each face, shape (f,): an edge connects faces if it belongs to exactly two.

    Vertices that differ by the rounding of single precision are the same: some files have other ones in each face.
    Faces that are back to back count as one: edges of a mesh whose faces are doubled belong to four faces.
    """
    joined, number = merged(mesh)
    return joined.pieces[number]


@lru_cache(maxsize=4)
def merged(mesh: TriangleMesh) -> tuple[TriangleMesh, IntArray]:
    """Return a mesh with the same shells that merges what counts as one, and the number of each face in it, (f,)."""
    found = without_doubled(mesh)
    joined = mesh if found[0].pieces.max() == 0 else rounded(mesh)
    return found if joined is mesh else without_doubled(joined)


@lru_cache(maxsize=4)
def rounded(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh whose vertices are the same if they differ by the rounding of single precision; its faces stay.

    A mesh that is all connected stays as it is.
    """
    if mesh.pieces.max() == 0:
        return mesh
    distance = ROUNDING * float(np.abs(mesh.vertices).max())
    pairs = cKDTree(mesh.vertices).query_pairs(distance, output_type="ndarray")
    if len(pairs) == 0:
        return mesh
    same = components(len(mesh.vertices), *pairs.T)
    chosen = np.unique(same, return_index=True)[1]
    return TriangleMesh(mesh.vertices, chosen[same][mesh.faces])


def without_doubled(mesh: TriangleMesh) -> tuple[TriangleMesh, IntArray]:
    """Return a mesh with one of faces that are back to back, wound anyhow, and the number of each face in it, (f,).

    Faces that are all connected are not doubled: edges of doubled ones belong to more than two faces.
    """
    every = np.arange(len(mesh.faces))
    if mesh.pieces.max() == 0:
        return mesh, every
    kept, number = np.unique(np.sort(mesh.faces, axis=1), axis=0, return_inverse=True)
    return (mesh, every) if len(kept) == len(mesh.faces) else (TriangleMesh(mesh.vertices, kept), number.ravel())


@lru_cache(maxsize=4)
def is_outer(mesh: TriangleMesh) -> BoolArray:
    """Return whether each face belongs to an outer shell, shape (f,), read-only."""
    return are_outer(mesh, shells(mesh))


def are_outer(mesh: TriangleMesh, shell: IntArray) -> BoolArray:
    """Return which faces belong to an outer shell, shape (f,), read-only."""
    if (shell == shell[0]).all():
        return locked(np.ones(len(shell), bool))
    areas = np.bincount(shell, mesh.face_areas)
    largest, *others = np.argsort(-areas, kind="stable")
    kept = np.arange(len(areas)) == largest
    hull = convex_hull(mesh.triangles[shell == largest].reshape(-1, 3))
    for i in others:
        if areas[i] < HULL_AREA * areas.sum():
            break
        part = TriangleMesh(mesh.vertices, mesh.faces[shell == i])
        points = points_at(part, *points_by_area(part, PART_POINTS))
        kept[i] = hull is None or is_inside(hull, points, -HULL_TOLERANCE).mean() < INNER_AREA_FRACTION
        if kept[i]:
            corners = part.triangles.reshape(-1, 3)
            if hull is None:
                hull = convex_hull(mesh.triangles[kept[shell]].reshape(-1, 3))
            elif not is_inside(hull, corners, HULL_GROWTH).all():
                hull = convex_hull(np.concatenate((hull.vertices, corners)))
    is_small = (areas > 0) & (areas < HULL_AREA * areas.sum())
    if is_small.any():
        faces = np.flatnonzero(is_small[shell])
        distance = SMALL_PART_FRACTION * float(np.sqrt(areas.sum()))
        points, face, weights = sample_faces(TriangleMesh(mesh.vertices, mesh.faces[faces]), distance)
        inside = np.zeros(len(points)) if hull is None else is_inside(hull, points, -HULL_TOLERANCE)
        inner = np.bincount(shell[faces[face]], weights * inside, len(areas))
        kept[is_small] = (inner < INNER_AREA_FRACTION * areas)[is_small]
    return locked(kept[shell])


def is_inside(hull: TriangleMesh, points: Array, growth: float) -> BoolArray:
    """Return which points are inside a hull of another size, shape (k,)."""
    middle = hull.vertices.mean(axis=0)
    points = middle + (1 - growth) * (points - middle)
    nearest = closest(hull, points)[2]
    # Of a point outside, the nearest point of a convex body is on the side of the middle, and inside it is not.
    inside: BoolArray = dots(points - nearest, nearest - middle) <= 0
    return inside


def convex_hull(points: Array) -> TriangleMesh | None:
    """Return the convex hull of points (k, 3); None if the points are flat."""
    try:
        hull = ConvexHull(points)
    except QhullError:
        return None
    return TriangleMesh(points[hull.vertices], np.searchsorted(hull.vertices, hull.simplices))
