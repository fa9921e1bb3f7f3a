"""The exact distance from points to a triangle mesh: the search is that of libigl, the result is ours."""

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ...common.arrays import Array, IntArray, cross, norms
from ...common.errors import SkinCalibError
from ...common.packages import how_to_install
from .triangle_mesh import TriangleMesh

# [1] height to length of a triangle below which only its sides are used, because its normal is only rounding.
FLAT_TRIANGLE_RATIO = 1e-8
# [1] points of one search. The window waits for it, because libigl keeps Python's lock. Larger: it waits longer.
BLOCK_POINTS = 20_000


def closest(mesh: TriangleMesh, points: Array) -> tuple[Array, IntArray, Array]:
    """Return the distance (k,) [m] of points (k, 3) from a mesh, the nearest face (k,) and its nearest point (k, 3).

    The search tree of a mesh is built once. Of equally near faces any is returned.
    """
    tree, faces = _tree_of(mesh)
    blocks = [points[i : i + BLOCK_POINTS] for i in range(0, len(points), BLOCK_POINTS)]
    found = [tree.squared_distance(mesh.vertices, faces, np.asarray(block, float))[1] for block in blocks]
    face: IntArray = np.concatenate(found or [np.empty(0, np.int64)])
    nearest = closest_on_triangles(points, mesh.vertices[mesh.faces[face]])
    return norms(nearest - points), face, nearest


_trees: WeakKeyDictionary[TriangleMesh, tuple[Any, IntArray]] = WeakKeyDictionary()


def _tree_of(mesh: TriangleMesh) -> tuple[Any, IntArray]:
    """Return the search tree of a mesh, and the faces (f, 3) that are in it."""
    if mesh not in _trees:
        try:
            import igl  # here: it takes time, and many commands need no distance
        except ImportError as error:
            raise SkinCalibError(
                f"Distances to a mesh need libigl, which is missing: {how_to_install('igl')}"
            ) from error
        tree, faces = igl.AABB(), _with_segments(mesh)
        tree.init(mesh.vertices, faces)
        _trees[mesh] = tree, faces
    return _trees[mesh]


def _with_segments(mesh: TriangleMesh) -> IntArray:
    """Return the faces (f, 3), flat ones as their longest side: libigl overestimates distances to flat triangles."""
    corners = mesh.faces
    is_flat = 2 * mesh.face_areas <= FLAT_TRIANGLE_RATIO * mesh.longest_sides**2
    if not is_flat.any():
        return np.ascontiguousarray(corners, np.int64)
    sides = np.stack(
        [norms(mesh.vertices[np.roll(corners, -1, axis=1)[:, k]] - mesh.vertices[corners[:, k]]) for k in range(3)]
    )
    first = sides.argmax(axis=0)
    rows = np.arange(len(corners))
    start, stop = corners[rows, first], corners[rows, (first + 1) % 3]
    return np.where(is_flat[:, None], np.stack((start, stop, stop), axis=1), corners)


def closest_on_triangles(points: Array, triangles: Array) -> Array:
    """Return the nearest point (k, 3) of each triangle (k, 3, 3) to each point (k, 3) [m].

    As in Ericson, Real-Time Collision Detection, 5.1.5.
    """
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    ab, ac, ap = b - a, c - a, points - a
    normal = cross(ab, ac)
    square = dots(normal, normal)
    flat = square <= (FLAT_TRIANGLE_RATIO * np.maximum(dots(ab, ab), dots(ac, ac))) ** 2
    square = np.where(flat, 1.0, square)
    v = dots(cross(ap, ac), normal) / square
    w = dots(cross(ab, ap), normal) / square
    best = a + v[:, None] * ab + w[:, None] * ac
    outside = (v < 0) | (w < 0) | (v + w > 1) | flat
    if outside.any():
        p = points[outside]
        best_edge = np.full(len(p), np.inf)
        for start, stop in ((a, b), (b, c), (c, a)):
            s, e = start[outside], stop[outside] - start[outside]
            t = np.clip(dots(p - s, e) / np.maximum(dots(e, e), 1e-300), 0, 1)
            q = s + t[:, None] * e
            d = dots(p - q, p - q)
            better = d < best_edge
            best_edge = np.where(better, d, best_edge)
            if start is a:
                edge = q
            else:
                edge[better] = q[better]
        best[outside] = edge
    return best


def dots(a: Array, b: Array) -> Array:
    """Return the dot products of vectors a and b, shapes (k, 3), as an array (k,)."""
    return np.einsum("kc,kc->k", a, b)
