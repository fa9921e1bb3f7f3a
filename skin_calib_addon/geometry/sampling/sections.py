"""Sections of a mesh with planes: all planes in one pass, as segments on which rays can be cast."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...common.arrays import Array, IntArray, along
from ..mesh.triangle_mesh import TriangleMesh
from .planes import Planes


@dataclass(frozen=True, eq=False)
class Sections:
    """Segments in which planes cut the faces of a mesh, ordered by plane; row i of each array is one segment."""

    plane: IntArray  # (s,) index of the plane
    face: IntArray  # (s,) index of the face
    ends: Array  # (s, 2, 3) [m]; (end - start) x plane normal points out of the face
    planes: int  # number of planes, including those that cut nothing


def cut_sections(mesh: TriangleMesh, planes: Planes, values: Array | None = None) -> Sections:
    """Cut a mesh with every plane at once.

    A vertex on a plane counts as below it, so that no position is degenerate. The formula for the cut of an edge is
    symmetric in its vertices, so that the two adjacent faces agree to the bit:

        p = (h_a p_b - h_b p_a) / (h_a - h_b)

    with the vertices p_a and p_b and their heights h_a and h_b above the plane [m].

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh, [m] in the link frame.
    planes : Planes
        For parallel planes sorted heights are sufficient; for others each vertex is compared with each plane.
    values : array, shape (v, c), optional
        Values of the vertices to interpolate instead of their coordinates, such as plane coordinates.

    Returns
    -------
    Sections
    """
    cut = _cut_parallel if planes.are_parallel() else _cut_any
    return cut(mesh, planes, mesh.vertices if values is None else values)


# Indexed by the corners above a plane (sum of 1, 2 and 4 for the first, second and third corner): the corner that is
# alone on its side, and the corners at the ends of the edges where the cut starts and stops. Segments of faces with the
# tip above and below the plane have opposite directions.
TIP = np.array((0, 0, 1, 2, 2, 1, 0, 0))
START = np.array((0, 1, 2, 1, 0, 0, 2, 0))
STOP = np.array((0, 2, 0, 0, 1, 2, 1, 0))


def _cut_parallel(mesh: TriangleMesh, planes: Planes, values: Array) -> Sections:
    """Cut with parallel planes: the rank of the height of each vertex among the planes gives all cuts."""
    level = along(planes.points, planes.normals[0])
    order = np.argsort(level, kind="stable")
    height = along(mesh.vertices, planes.normals[0])
    rank = np.zeros(len(height), np.int16)  # number of planes below each vertex
    for one in level:  # a comparison per level is faster than a bisection per vertex
        rank += height > one
    a, b, c = (rank[corner] for corner in mesh.corners)
    first = np.minimum(np.minimum(a, b), c)
    count = np.maximum(np.maximum(a, b), c) - first
    cut = np.flatnonzero(count)
    count, first = count[cut].astype(np.int64), first[cut].astype(np.int64)
    part = np.repeat(np.arange(len(cut)), count)
    level_index = np.arange(len(part)) + np.repeat(first - np.cumsum(count) + count, count)
    by_plane = np.argsort(order[level_index].astype(np.int16), kind="stable")
    part, level_index = part[by_plane], level_index[by_plane]
    plane = order[level_index]
    is_above = [rank[cut][part] > level_index for rank in (a, b, c)]
    above = is_above[0] + 2 * is_above[1] + 4 * is_above[2]
    face, lift = cut[part], level[plane]
    ends = _segments(mesh, values, face, above, lambda vertex: height[vertex] - lift)
    return Sections(plane, face, ends, len(planes))


def _cut_any(mesh: TriangleMesh, planes: Planes, values: Array) -> Sections:
    """Cut with planes of any direction: each vertex is compared with each plane."""
    height = planes.normals @ mesh.vertices.T - (planes.points * planes.normals).sum(axis=1)[:, None]
    side = (height > 0).astype(np.int8)
    a, b, c = (side[:, corner] for corner in mesh.corners)
    above = a + 2 * b + 4 * c
    plane, face = np.nonzero((above > 0) & (above < 7))
    ends = _segments(mesh, values, face, above[plane, face], lambda vertex: height[plane, vertex])
    return Sections(plane, face, ends, len(planes))


def _segments(
    mesh: TriangleMesh, values: Array, face: IntArray, above: IntArray, height: Callable[[IntArray], Array]
) -> Array:
    """Return the ends of the segment in which a plane cuts each face, shape (s, 2, c).

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh, [m] in the link frame.
    values : array, shape (v, c)
        To interpolate.
    face : array of int, shape (s,)
        Index of the face of each segment.
    above : array of int, shape (s,)
        Which corners are above the plane, as in ``TIP``.
    height : function
        Returns the heights of one vertex of each segment above its plane [m].
    """
    corners, base = mesh.faces.reshape(-1), 3 * face
    tip = corners[base + TIP[above]]
    tip_height = height(tip)
    columns = np.ascontiguousarray(values.T)
    tips = [column[tip] for column in columns]
    ends = np.empty((len(columns), 2, len(face)))
    for i, table in enumerate((START, STOP)):
        other = corners[base + table[above]]
        other_height = height(other)
        between = tip_height - other_height
        for end, column, tip_value in zip(ends, columns, tips):
            # The result is the same to the bit for both orders of the vertices, so the adjacent faces agree.
            end[i] = (tip_height * column[other] - other_height * tip_value) / between
    return ends.transpose(2, 1, 0)
