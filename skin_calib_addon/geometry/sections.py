"""Where planes cut a mesh: all planes in one pass, as segments that a ray fan can be cast on."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, BoolArray, IntArray, along
from .mesh import TriangleMesh
from .planes import Planes


@dataclass(frozen=True, eq=False)
class Sections:
    """Segments in which planes cut the faces of a mesh, ordered by plane; row i of each array is one segment."""

    plane: IntArray  # (s,) which plane
    face: IntArray  # (s,) which face
    ends: Array  # (s, 2, 3) [m]; from first to second, the face's normal is to the right as the plane's normal sees it
    planes: int  # how many planes were cut, those that meet nothing included


def cut_sections(mesh: TriangleMesh, planes: Planes, values: Array | None = None) -> Sections:
    """Cut a mesh with every plane at once.

    A vertex that lies on a plane counts as below it, so that no position is degenerate; each edge is cut with its
    vertices in the order of their index, so that the two faces beside it agree to the bit.

    Parameters
    ----------
    mesh : TriangleMesh
    planes : Planes
        Parallel planes are found from the sorted heights alone; others are compared with every vertex.
    values : array, shape (v, c), optional
        What the ends of the segments tell of the vertices in place of their coordinates, such as plane coordinates.

    Returns
    -------
    Sections
    """
    cut = _cut_parallel if planes.are_parallel() else _cut_any
    return cut(mesh, planes, mesh.vertices if values is None else values)


def _cut_parallel(mesh: TriangleMesh, planes: Planes, values: Array) -> Sections:
    """Cut with parallel planes: each vertex has one height, and its rank among the levels tells all crossings."""
    level = along(planes.points, planes.normals[0])
    order = np.argsort(level, kind="stable")
    height = along(mesh.vertices, planes.normals[0])
    rank = np.zeros(len(height), np.int16)  # how many planes lie below each vertex
    for one in level:  # a comparison per level is faster than a bisection per vertex
        rank += height > one
    a, b, c = (rank[corner] for corner in mesh.corners)
    first = np.minimum(np.minimum(a, b), c)
    count = np.maximum(np.maximum(a, b), c) - first
    cut = np.flatnonzero(count)
    count, first = count[cut].astype(np.int64), first[cut].astype(np.int64)
    face = np.repeat(cut, count)
    place = np.arange(len(face)) + np.repeat(first - np.cumsum(count) + count, count)
    by_plane = np.argsort(order[place].astype(np.int16), kind="stable")
    face, place = face[by_plane], place[by_plane]
    plane = order[place]
    ends = _segments(
        mesh,
        values,
        face,
        lambda vertex: height[vertex] - level[plane],
        *(rank[corner[face]] > place for corner in mesh.corners),
    )
    return Sections(plane, face, ends, len(planes))


def _cut_any(mesh: TriangleMesh, planes: Planes, values: Array) -> Sections:
    """Cut with planes of any direction: each vertex is compared with each plane."""
    height = planes.normals @ mesh.vertices.T - (planes.points * planes.normals).sum(axis=1)[:, None]
    side = height > 0
    a, b, c = (side[:, corner] for corner in mesh.corners)
    plane, face = np.nonzero((a != b) | (b != c))
    sides = (x[plane, face] for x in (a, b, c))
    ends = _segments(mesh, values, face, lambda vertex: height[plane, vertex], *sides)
    return Sections(plane, face, ends, len(planes))


def _segments(
    mesh: TriangleMesh,
    values: Array,
    face: IntArray,
    height: Callable[[IntArray], Array],
    a_above: BoolArray,
    b_above: BoolArray,
    c_above: BoolArray,
) -> Array:
    """Ends of the segment in which a plane cuts each face, shape (s, 2, c).

    Parameters
    ----------
    height : function
        Heights above its plane [m] of one vertex for each segment.
    a_above, b_above, c_above : array of bool, shape (s,)
        On which side of the plane the corners lie.
    """
    # The corner that is alone on its side comes first; the winding of the face is kept.
    alone = np.where(a_above == b_above, 2, np.where(a_above == c_above, 1, 0))
    a, b, c = (corner[face] for corner in mesh.corners)
    tip, following, last = (np.choose(alone, turn) for turn in ((a, b, c), (b, c, a), (c, a, b)))
    upward = np.choose(alone, (a_above, b_above, c_above))
    ends = np.empty((len(face), 2, values.shape[1]))
    # A tip above the plane and one below it see their segment run in opposite directions.
    for i, other in enumerate((np.where(upward, following, last), np.where(upward, last, following))):
        low, high = np.minimum(tip, other), np.maximum(tip, other)
        low_height = height(low)
        part = low_height / (low_height - height(high))
        start = values[low]
        ends[:, i] = start + part[:, None] * (values[high] - start)
    return ends
