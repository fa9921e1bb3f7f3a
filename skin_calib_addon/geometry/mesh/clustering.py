"""A mesh of fewer faces about the same surface, for previews."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from ...common.arrays import IntArray
from .cover import CoverSpec, cut_cover
from .triangle_mesh import TriangleMesh, at_rims, weld

# [1] about the number of faces of a coarse mesh. Larger: more exact previews, which take longer.
COARSE_FACES = 6_000
# [1] weight of a vertex at an open rim to others. Larger: rims stay where they are; at 1 they move inward.
RIM_WEIGHT = 1e3
# Derived: faces around a vertex of an even mesh to those around a cell of the clusters, which a surface cuts obliquely.
FACES_PER_CELL = 3.0


def coarse_cover(mesh: TriangleMesh, spec: CoverSpec) -> TriangleMesh:
    """Return about what :func:`~skin_calib_addon.geometry.mesh.cover.cut_cover` does, with few faces.

    Inner parts are those of the mesh without cuts; clusters do not connect faces as the mesh does.
    """
    kept = cut_cover(mesh, replace(spec, cuts=()))
    return cut_cover(coarse_mesh(kept), CoverSpec("all", spec.cuts))


@lru_cache(maxsize=4)  # while a cut moves, the mesh is the same
def coarse_mesh(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh of about ``COARSE_FACES`` faces on the same surface; the mesh itself if it has no more.

    Vertices in one cubic cell become one at their mean (Rossignac and Borrel, Multi-resolution 3D approximations, 1993)
    if their normals have the same main direction, so that both sides of a thin wall stay apart.
    """
    if len(mesh.faces) <= COARSE_FACES:
        return mesh
    cell = float(np.sqrt(FACES_PER_CELL * mesh.face_areas.sum() / COARSE_FACES))
    places = np.floor((mesh.vertices - mesh.vertices.min(axis=0)) / cell).astype(np.int64)
    x, y, z = places.max(axis=0) + 1
    number = ((places[:, 0] * y + places[:, 1]) * z + places[:, 2]) * 6 + _main_directions(mesh)
    _, cluster = np.unique(number, return_inverse=True)
    weights = np.where(at_rims(mesh.faces, len(mesh.vertices)), RIM_WEIGHT, 1.0)
    total = np.bincount(cluster, weights)
    means = [np.bincount(cluster, weights * mesh.vertices[:, k]) / total for k in range(3)]
    return weld(np.column_stack(means), cluster[mesh.faces])


def _main_directions(mesh: TriangleMesh) -> IntArray:
    """Return the axis, and the direction along it, that is nearest to the normal of each vertex, 0 to 5, shape (v,)."""
    vectors = mesh.face_normals * mesh.face_areas[:, None]
    normals = np.zeros((len(mesh.vertices), 3))
    for corner in mesh.corners:
        for k in range(3):
            normals[:, k] += np.bincount(corner, vectors[:, k], len(normals))
    axis = np.abs(normals).argmax(axis=1)
    found: IntArray = 2 * axis + (normals[np.arange(len(normals)), axis] < 0)
    return found
