"""Points on the faces of a mesh: spread over each of them, or a number of them even by area."""

import numpy as np

from ...common.arrays import Array, IntArray, ranges
from .triangle_mesh import TriangleMesh

GOLDEN_RATIO = (1 + 5**0.5) / 2


def sample_faces(mesh: TriangleMesh, distance: float) -> tuple[Array, IntArray, Array]:
    """Return points (k, 3) spread over the faces, at least one on each, their face, and the area [m^2] of each.

    Along its longest side a face has columns of equal width; each column has points at equal distances. So narrow faces
    have points up to their tips.
    """
    triangles, f = mesh.triangles, np.arange(len(mesh.faces))
    squares = [np.square(triangles[:, (k + 1) % 3] - triangles[:, k]).sum(axis=1) for k in range(3)]
    first = np.argmax(squares, axis=0)
    a, b, c = (triangles[f, (first + k) % 3] for k in range(3))
    length = mesh.longest_sides
    foot = np.clip(np.einsum("fc,fc->f", c - a, b - a) / length**2, 0, 1)
    height = 2 * mesh.face_areas / length
    columns = np.maximum(np.ceil(length / distance).astype(np.int64), 1)
    of = np.repeat(f, columns)  # face of each column
    x = (ranges(0, columns) + 0.5) / columns[of]
    # Height of the triangle over the middle of the column, as a fraction of its largest height.
    top = np.minimum(x / np.maximum(foot[of], x), (1 - x) / np.maximum(1 - foot[of], 1 - x))
    rows = np.maximum(np.ceil(top * height[of] / distance).astype(np.int64), 1)
    column = np.repeat(np.arange(len(of)), rows)
    y = (ranges(0, rows) + 0.5) / rows[column] * top[column]
    face = of[column]
    of_b = x[column] - y * foot[face]
    points = np.column_stack(
        [(1 - of_b - y) * p[face] + of_b * q[face] + y * r[face] for p, q, r in zip(a.T, b.T, c.T)]
    )
    weights = (top / rows)[column]
    return points, face, weights * (mesh.face_areas / np.bincount(face, weights, len(f)))[face]


def points_by_area(mesh: TriangleMesh, count: int) -> tuple[IntArray, Array]:
    """Return faces (k,) and positions (k, 2) along their sides from the first corner: ``count`` points, even by area.

    Turk, Generating Random Points in Triangles, 1990, with even numbers instead of random ones.
    """
    ends = np.cumsum(mesh.face_areas)
    at = (np.arange(count) + 0.5) / count * ends[-1]
    face = np.minimum(np.searchsorted(ends, at), len(ends) - 1)
    a = np.sqrt(np.clip((ends[face] - at) / mesh.face_areas[face], 0, 1))
    b = np.arange(count) * GOLDEN_RATIO % 1
    return face, np.stack((a * (1 - b), a * b), axis=1)


def points_at(mesh: TriangleMesh, face: IntArray, at: Array) -> Array:
    """Return the points (k, 3) at positions (k, 2) along the sides of faces (k,) from their first corner."""
    first, second, third = (mesh.triangles[face, corner] for corner in range(3))
    a, b = at[:, :1], at[:, 1:]
    return first + a * (second - first) + b * (third - first)
