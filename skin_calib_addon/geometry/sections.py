"""Where planes cut a mesh: all planes in one pass, as segments that a ray fan can be cast on."""

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from .mesh import TriangleMesh
from .planes import Planes


@dataclass(frozen=True, eq=False)
class Sections:
    """Segments in which planes cut the faces of a mesh, ordered by plane; row i of each array is one segment."""

    plane: IntArray  # (s,) which plane
    face: IntArray  # (s,) which face
    ends: Array  # (s, 2, 3) [m]; from first to second, the face's normal is to the right as the plane's normal sees it
    planes: int  # how many planes were cut, those that meet nothing included


def cut_sections(mesh: TriangleMesh, planes: Planes) -> Sections:
    """Cut a mesh with every plane at once.

    A vertex that lies on a plane counts as below it, so that no position is degenerate; each edge is cut with its
    vertices in the order of their index, so that the two faces beside it agree to the bit.

    Parameters
    ----------
    mesh : TriangleMesh
    planes : Planes
        Parallel planes are found from the sorted heights alone; others are compared with every vertex.

    Returns
    -------
    Sections
    """
    if planes.are_parallel():
        plane, face, above, height = _cut_parallel(mesh, planes)
    else:
        plane, face, above, height = _cut_any(mesh, planes)
    return Sections(plane, face, _segments(mesh, face, above, height), len(planes))


def _cut_parallel(mesh: TriangleMesh, planes: Planes) -> tuple[IntArray, IntArray, BoolArray, Array]:
    """Pairs of plane and face that meet, and each corner's side and height there; shapes (s,), (s,), (s, 3) twice."""
    level = planes.points @ planes.normals[0]
    order = np.argsort(level, kind="stable")
    vertex_height = mesh.vertices @ planes.normals[0]
    rank = np.searchsorted(level[order], vertex_height, side="left")[mesh.faces]  # how many planes lie below
    first = rank.min(axis=1)
    count = rank.max(axis=1) - first
    cut = np.flatnonzero(count)
    first, count = first[cut], count[cut]
    face = np.repeat(cut, count)
    place = np.arange(len(face)) + np.repeat(first - np.cumsum(count) + count, count)
    by_plane = np.argsort(order[place], kind="stable")
    face, place = face[by_plane], place[by_plane]
    above = rank[face] > place[:, None]
    height = vertex_height[mesh.faces[face]] - level[order][place][:, None]
    return order[place], face, above, height


def _cut_any(mesh: TriangleMesh, planes: Planes) -> tuple[IntArray, IntArray, BoolArray, Array]:
    """The same for planes of any direction."""
    vertex_height = planes.normals @ mesh.vertices.T - (planes.points * planes.normals).sum(axis=1)[:, None]
    side = vertex_height > 0
    a, b, c = (side[:, mesh.faces[:, k]] for k in range(3))
    plane, face = np.nonzero((a != b) | (b != c))
    corners = mesh.faces[face]
    return plane, face, side[plane[:, None], corners], vertex_height[plane[:, None], corners]


def _segments(mesh: TriangleMesh, face: IntArray, above: BoolArray, height: Array) -> Array:
    """Ends of the segment in which a plane cuts each face, shape (s, 2, 3)."""
    up = above.sum(axis=1) == 1
    # The corner that is alone on its side comes first; the winding of the face is kept.
    alone = np.where(up, above.argmax(axis=1), above.argmin(axis=1))
    row = np.arange(len(face)) * 3
    corner_of, height_of = mesh.faces[face].ravel(), height.ravel()
    tip = row + alone
    ends = np.empty((2, len(face), 3))
    # Seen against the plane's normal, the segment of an upward face runs one way, of a downward one the other.
    for step, end in ((1, np.where(up, 0, 1)), (2, np.where(up, 1, 0))):
        other = row + (alone + step) % 3
        lower = corner_of[tip] < corner_of[other]
        i, j = np.where(lower, tip, other), np.where(lower, other, tip)
        start = mesh.vertices[corner_of[i]]
        part = height_of[i] / (height_of[i] - height_of[j])
        ends[end, np.arange(len(face))] = start + part[:, None] * (mesh.vertices[corner_of[j]] - start)
    return ends.transpose(1, 0, 2)
