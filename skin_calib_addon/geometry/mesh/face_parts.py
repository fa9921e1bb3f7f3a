"""Faces as congruent parts."""

import numpy as np

from ...common.arrays import Array, IntArray
from .triangle_mesh import TriangleMesh

# [1] most parts of one side of a face. Larger: denser samples on long faces, more memory.
MAX_PARTS = 64


def split_faces(mesh: TriangleMesh, size: float) -> tuple[Array, IntArray, IntArray]:
    """Split long faces into congruent triangles with sides of at most ``size``, and return their centres."""
    corners = mesh.triangles
    parts = np.clip(np.ceil(mesh.longest_sides / size).astype(int), 1, MAX_PARTS)
    centres, face = [], []
    for k in np.unique(parts):
        chosen = np.flatnonzero(parts == k)
        i, j = (x.ravel() for x in np.meshgrid(np.arange(k), np.arange(k), indexing="ij"))
        up, down = i + j < k, i + j < k - 1  # triangles oriented like the face, and rotated by half a turn
        a = np.r_[i[up] + 1 / 3, i[down] + 2 / 3] / k
        b = np.r_[j[up] + 1 / 3, j[down] + 2 / 3] / k
        centres.append(np.einsum("sb,fbc->fsc", np.column_stack((1 - a - b, a, b)), corners[chosen]).reshape(-1, 3))
        face.append(np.repeat(chosen, len(a)))
    return np.concatenate(centres), np.concatenate(face), parts
