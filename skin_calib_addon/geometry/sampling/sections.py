"""Sections of a mesh with planes: all planes in one pass, as segments on which rays can be cast."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray, along, locked, ranges, unit
from ..mesh.triangle_mesh import TriangleMesh
from .planes import Planes

# [fraction of the mesh size] height of a vertex above or below a plane within which it is on the plane. It covers the
# rounding of files in single precision: 0.02 um on a link of 200 mm. Larger: planes near a rim are moved onto it.
ON_PLANE_FRACTION = 1e-7

# [1] faces from which on only those near the planes are cut. Smaller: sorting them takes longer than cutting all.
MIN_SORTED_FACES = 30_000
# [1] steps of the components of a direction, so that planes with small tilts use the same sorted faces. Larger: fewer
# faces are near, and the faces are sorted more often.
DIRECTION_STEPS = 8
# [cosine] between a plane's normal and this direction below which all faces are cut.
MIN_STACK_COSINE = 0.5
# [fraction of the mesh size] extent below which faces are in one class. Larger: more faces are compared.
SMALLEST_EXTENT = 1e-3


@dataclass(frozen=True, eq=False)
class Sections:
    """Segments in which planes cut the faces of a mesh, ordered by plane; row i of each array is one segment."""

    plane: IntArray  # (s,) index of the plane
    face: IntArray  # (s,) index of the face
    ends: Array  # (s, 2, 3) [m]; (end - start) x plane normal points out of the face
    planes: int  # number of planes, including those that cut nothing


def cut_sections(mesh: TriangleMesh, planes: Planes, values: Array | None = None) -> Sections:
    """Cut a mesh with every plane at once.

    A vertex on a plane counts as below it, so that no position is degenerate. A plane through the upper rim of the mesh
    would then miss it. The section therefore also has the edges in the plane where the mesh ends: a face is below, and
    none is above. The formula for the cut of an edge is symmetric in its vertices, so that the two adjacent faces agree
    to the bit:

        p = (h_a p_b - h_b p_a) / (h_a - h_b)

    with the vertices p_a and p_b and their heights h_a and h_b above the plane [m].
    """
    values, slack = mesh.vertices if values is None else values, ON_PLANE_FRACTION * mesh.size
    parallel = planes.are_parallel()
    near = _faces_near(mesh, planes, slack, parallel)
    part, used = (mesh, slice(None)) if near is None else _part_of(mesh, near)
    if parallel:
        height = coordinates(mesh, planes.normals[0])[used]
        sections = _cut_parallel(part, height, slack, planes, values[used])
    else:
        sections = _cut_any(part, slack, planes, values[used])
    return sections if near is None else replace(sections, face=near[sections.face])


def coordinates(mesh: TriangleMesh, direction: Array) -> Array:
    """Return the components of the vertices of a mesh along a direction, shape (v,) [m]; the last ones are kept."""
    return _coordinates(mesh, direction.tobytes())


@lru_cache(maxsize=12)  # previews cut one mesh along the same axes
def _coordinates(mesh: TriangleMesh, direction: bytes) -> Array:
    return locked(along(mesh.vertices, np.frombuffer(direction)))


# Indexed by the corners above a plane (sum of 1, 2 and 4 for the first, second and third corner): the corner that is
# alone on its side, and the corners at the ends of the edges where the cut starts and stops. Segments of faces with the
# tip above and below the plane have opposite directions.
TIP = np.array((0, 0, 1, 2, 2, 1, 0, 0))
START = np.array((0, 1, 2, 1, 0, 0, 2, 0))
STOP = np.array((0, 2, 0, 0, 1, 2, 1, 0))


@dataclass(frozen=True, eq=False)
class _Part:
    """Some faces of a mesh, with their own numbers of vertices, in the order of the mesh."""

    vertices: Array  # (v, 3) [m]
    faces: IntArray  # (f, 3)
    corners: tuple[IntArray, IntArray, IntArray]  # columns of ``faces``


def _part_of(mesh: TriangleMesh, faces: IntArray) -> tuple[_Part, IntArray]:
    """Return the part of a mesh with some faces (ascending), and the indices of its vertices in the mesh."""
    corners = [corner[faces] for corner in mesh.corners]
    is_used = np.zeros(len(mesh.vertices), bool)
    for corner in corners:
        is_used[corner] = True
    used = np.flatnonzero(is_used)
    number = np.empty(len(is_used), np.int64)
    number[used] = np.arange(len(used))
    a, b, c = (number[corner] for corner in corners)
    return _Part(mesh.vertices[used], np.stack((a, b, c), axis=1), (a, b, c)), used


def _faces_near(mesh: TriangleMesh, planes: Planes, slack: float, parallel: bool) -> IntArray | None:
    """Return the faces that may touch a plane, ascending; None for all faces, where finding them takes longer."""
    if len(mesh.faces) < MIN_SORTED_FACES:
        return None
    towards = planes.normals[0]
    if not parallel or len(planes) == 1:  # one sorting serves tilted planes
        towards = unit(np.rint(towards * DIRECTION_STEPS))
    stack = _stack(mesh, towards.tobytes())
    stack.uses += 1
    if stack.uses == 1:
        return None
    cosine = along(planes.normals, towards)
    if cosine.min() < MIN_STACK_COSINE:
        return None
    sine = np.linalg.norm(planes.normals - cosine[:, None] * towards, axis=1)
    # Where the plane meets the mesh, it is at most this far from the height of its own point.
    margin = (2 * slack + sine * (stack.radius + stack.across(planes.points))) / cosine
    level = along(planes.points, towards)
    return stack.between(level - margin, level + margin)


class _Stack:
    """The faces of a mesh, sorted by their heights along a direction from the second use on."""

    def __init__(self, mesh: TriangleMesh, towards: Array):
        self.mesh, self.towards, self.uses = mesh, towards, 0

    @cached_property
    def middle(self) -> Array:
        """Return the mean vertex, shape (3,) [m]."""
        return self.mesh.vertices.mean(axis=0)

    @cached_property
    def radius(self) -> float:
        """Return the largest distance of a vertex from the line through the middle along the direction [m]."""
        return float(self.across(self.mesh.vertices).max())

    def across(self, points: Array) -> Array:
        """Return the distances of points (k, 3) from this line, shape (k,) [m]."""
        arms = points - self.middle
        return np.linalg.norm(arms - along(arms, self.towards)[:, None] * self.towards, axis=1)

    @cached_property
    def classes(self) -> list[tuple[IntArray, Array, Array, float]]:
        """Return faces of similar extents: their indices, their lower ends in ascending order, upper ends, extent."""
        height = coordinates(self.mesh, self.towards)
        a, b, c = (height[corner] for corner in self.mesh.corners)
        low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        order = np.argsort(low)
        kind = np.clip(np.ceil(np.log2((high - low) / self.mesh.size + SMALLEST_EXTENT)), None, 0).astype(int)[order]
        found = []
        for one in np.unique(kind):
            faces = order[kind == one]
            found.append((faces, low[faces], high[faces], float((high - low)[faces].max())))
        return found

    def between(self, low: Array, high: Array) -> IntArray:
        """Return the faces that are partly within any of some intervals (k,), ascending."""
        is_near = np.zeros(len(self.mesh.faces), bool)
        for faces, start, stop, extent in self.classes:
            first, last = np.searchsorted(start, low - extent), np.searchsorted(start, high, side="right")
            count = np.maximum(last - first, 0)
            index = ranges(first, count)
            is_near[faces[index[stop[index] >= np.repeat(low, count)]]] = True
        return np.flatnonzero(is_near)


@lru_cache(maxsize=4)  # previews cut one mesh along few directions
def _stack(mesh: TriangleMesh, towards: bytes) -> _Stack:
    return _Stack(mesh, np.frombuffer(towards))


def _cut_parallel(mesh: TriangleMesh | _Part, height: Array, slack: float, planes: Planes, values: Array) -> Sections:
    """Cut with parallel planes: the rank of the height of each vertex among the planes gives all cuts."""
    level = along(planes.points, planes.normals[0])
    order = np.argsort(level, kind="stable")
    rank = np.zeros(len(height), np.int16)  # number of planes below each vertex
    for one in level:  # a comparison per level is faster than a bisection per vertex
        rank += height > one + slack
    next_level = np.append(level[order], np.inf)[rank]
    on_plane = height >= next_level - slack
    a, b, c = (rank[corner] for corner in mesh.corners)
    first = np.minimum(np.minimum(a, b), c)
    count = np.maximum(np.maximum(a, b), c) - first
    cut = np.flatnonzero(count)
    count, first = count[cut].astype(np.int64), first[cut].astype(np.int64)
    part = np.repeat(np.arange(len(cut)), count)
    level_index = ranges(first, count)
    is_above = [rank[cut][part] > level_index for rank in (a, b, c)]
    above = is_above[0] + 2 * is_above[1] + 4 * is_above[2]
    face = cut[part]
    if on_plane.any():
        height = np.where(on_plane, next_level, height)
        rims = _rims_of_ranks(mesh, level[order], rank.astype(np.int64), on_plane)
        level_index, face, above = (np.concatenate(x) for x in zip((level_index, face, above), rims))
    by_plane = (
        np.lexsort((face, order[level_index]))
        if on_plane.any()
        else np.argsort(order[level_index].astype(np.int16), kind="stable")
    )
    face, above, plane = face[by_plane], above[by_plane], order[level_index[by_plane]]
    lift = level[plane]
    ends = _segments(mesh, values, face, above, lambda vertex: height[vertex] - lift)
    return Sections(plane, face, ends, len(planes))


def _cut_any(mesh: TriangleMesh | _Part, slack: float, planes: Planes, values: Array) -> Sections:
    """Cut with planes of any direction: each vertex is compared with each plane."""
    # Not by BLAS, whose rounding depends on its number of threads, and on the vertices that are compared together: a
    # program and a window must give the same bytes.
    height = sum(map(np.multiply.outer, planes.normals.T, mesh.vertices.T))
    height = height - (planes.points * planes.normals).sum(axis=1)[:, None]
    is_higher = height > slack
    on_plane = is_higher != (height >= -slack)
    near = _near(mesh, is_higher, on_plane)
    corners = [corner[near] for corner in mesh.corners]
    side = is_higher.view(np.int8)
    a, b, c = (side[:, corner] for corner in corners)
    above = a + 2 * b + 4 * c
    is_cut = (above > 0) & (above < 7)
    if on_plane.any():
        height[on_plane] = 0.0
        a, b, c = (on_plane[:, corner].astype(np.int8) for corner in corners)
        on = a + 2 * b + 4 * c
        plane, face = np.nonzero((on == 3) | (on == 5) | (on == 6))
        rim = _are_rims(mesh, plane, near[face], on[plane, face], above[plane, face] > 0)
        plane, face = plane[rim], face[rim]
        above[plane, face], is_cut[plane, face] = on[plane, face], True
    plane, face = np.nonzero(is_cut)
    ends = _segments(mesh, values, near[face], above[plane, face], lambda vertex: height[plane, vertex])
    return Sections(plane, near[face], ends, len(planes))


def _near(mesh: TriangleMesh | _Part, is_higher: BoolArray, on_plane: BoolArray) -> IntArray:
    """Return the faces with corners on both sides of a plane, or on a plane; the sides of eight planes are one byte."""
    on_any = on_plane.any(axis=0)
    found = on_any[mesh.corners[0]] | on_any[mesh.corners[1]] | on_any[mesh.corners[2]]
    for sides in np.packbits(is_higher, axis=0):
        a, b, c = (sides[corner] for corner in mesh.corners)
        found |= (a | b | c) != (a & b & c)
    return np.flatnonzero(found)


def _rims_of_ranks(
    mesh: TriangleMesh | _Part, level: Array, rank: IntArray, on_plane: BoolArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return the rims (r,) in parallel planes: index of the level, face, and the corners on the plane as in ``TIP``."""
    are_on = [on_plane[corner] for corner in mesh.corners]
    near = np.flatnonzero((are_on[0] & are_on[1]) | (are_on[1] & are_on[2]) | (are_on[2] & are_on[0]))
    a, b, c = (
        np.where(is_on[near], rank[corner[near]], -1 - i) for i, (is_on, corner) in enumerate(zip(are_on, mesh.corners))
    )
    on = 3 * (a == b) + 6 * (b == c) + 5 * (c == a)  # 14: all corners are on one plane
    edges = (on == 3) | (on == 6) | (on == 5)
    face, on = near[edges], on[edges]
    first = mesh.faces[face, np.where(on == 6, 1, 0)]
    tip = mesh.faces[face, TIP[on]]
    level_index = rank[first]
    rim = _are_rims(mesh, level_index, face, on, rank[tip] > level_index)
    level_index, face, on = level_index[rim], face[rim], on[rim]
    equal = np.searchsorted(level, level[level_index], side="right") - level_index  # planes at this height
    part = np.repeat(np.arange(len(face)), equal)
    return ranges(level_index, equal), face[part], on[part]


def _are_rims(
    mesh: TriangleMesh | _Part, plane: IntArray, face: IntArray, on: IntArray, is_above: BoolArray
) -> BoolArray:
    """Return which edges (k,) in a plane are rims: the first face below each edge without a face above it."""
    corners = mesh.faces[face]
    edge = np.sort(
        np.stack((corners[np.arange(len(face)), START[on]], corners[np.arange(len(face)), STOP[on]])), axis=0
    )
    order = np.lexsort((~is_above, edge[1], edge[0], plane))  # a face above the edge comes first
    key = np.stack((plane, *edge))[:, order]
    first = np.append(True, (key[:, 1:] != key[:, :-1]).any(axis=0))[: len(order)]
    rims = np.zeros(len(face), bool)
    rims[order] = first & ~is_above[order]
    return rims


def _segments(
    mesh: TriangleMesh | _Part, values: Array, face: IntArray, above: IntArray, height: Callable[[IntArray], Array]
) -> Array:
    """Return the ends of the segment in which a plane cuts each face, shape (s, 2, c)."""
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
        for vertex, is_on in ((other, other_height == 0), (tip, tip_height == 0)):  # the vertex itself, not rounded
            if is_on.any():
                for end, column in zip(ends, columns):
                    end[i][is_on] = column[vertex[is_on]]
    return ends.transpose(2, 1, 0)
