"""The shells of a mesh, and which of them are inside of others."""

from functools import lru_cache

import numpy as np
from scipy.spatial import ConvexHull, Delaunay, QhullError, cKDTree

from ...common.arrays import Array, BoolArray, IntArray, locked
from ..components import components
from .triangle_mesh import TriangleMesh
from .visibility import sample_faces

# [fraction of the area] A shell with more of its area inside the hull of the shells kept so far is an inner part.
# Larger: more inner parts are kept.
INNER_AREA_FRACTION = 0.5
# [fraction of the distance from the middle] by which a point must be inside a hull. Larger: parts that are flush with
# it are no inner parts; smaller: rounding decides.
HULL_TOLERANCE = 1e-6
# [fraction of the distance from the middle] by which a shell must be outside the hull of those kept so far to make it
# larger. Larger: faster for links with many parts, and less exact.
HULL_GROWTH = 1e-4
# [fraction of the root of the area of a shell] distance of the points that are inside the hull or not. Larger: less
# accurate fractions, which depend on the faces.
SHELL_PART_FRACTION = 0.03
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
    largest, *others = np.argsort(-np.bincount(shell, mesh.face_areas), kind="stable")
    kept = shell == largest
    hull = convex_hull(mesh.triangles[kept].reshape(-1, 3)) if others else None
    for i in others:
        faces = np.flatnonzero(shell == i)
        if fraction_inside(hull, mesh, faces) < INNER_AREA_FRACTION:
            kept[faces] = True
            corners = mesh.triangles[faces].reshape(-1, 3)
            if hull is None:
                hull = convex_hull(mesh.triangles[kept].reshape(-1, 3))
            elif not is_inside(hull, corners, HULL_GROWTH).all():
                hull = convex_hull(np.concatenate((hull.points, corners)))
    return locked(kept)


def fraction_inside(hull: Delaunay | None, mesh: TriangleMesh, faces: IntArray) -> float:
    """Return the fraction of the area of some faces that is inside a convex hull; 1 for faces without area."""
    shell = TriangleMesh(mesh.vertices, mesh.faces[faces])
    if shell.face_areas.sum() == 0:
        return 1.0
    if hull is None:
        return 0.0
    if is_inside(hull, shell.triangles.reshape(-1, 3), -HULL_TOLERANCE).all():
        return 1.0
    # Many points, so that the fraction does not depend on the size of the faces.
    points, _, areas = sample_faces(shell, SHELL_PART_FRACTION * float(np.sqrt(shell.face_areas.sum())))
    return float(areas[is_inside(hull, points, -HULL_TOLERANCE)].sum() / areas.sum())


def is_inside(hull: Delaunay, points: Array, growth: float) -> BoolArray:
    """Return which points are inside a hull of another size, shape (k,)."""
    middle = hull.points.mean(axis=0)
    inside: BoolArray = hull.find_simplex(middle + (1 - growth) * (points - middle)) >= 0
    return inside


def convex_hull(points: Array) -> Delaunay | None:
    """Return the convex hull of points (k, 3) as tetrahedra; None if the points are flat."""
    try:
        return Delaunay(points[ConvexHull(points).vertices])
    except QhullError:
        return None
