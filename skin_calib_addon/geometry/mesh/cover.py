"""From a link's mesh to its cover: keep what is outside, and cut it with planes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray, unit
from ...common.errors import InvalidMesh, InvalidPlan
from ..components import components
from .defects import MAX_DOUBLED_FRACTION, coherent
from .shells import is_outer, merged, rounded, without_doubled
from .triangle_mesh import TriangleMesh, weld
from .visibility import visibility

# [size of the mesh] distance from a cut up to which a vertex is on it. Larger: rims are less even; smaller: rounding
# leaves faces without area.
ON_PLANE = 1e-9


@dataclass(frozen=True)
class Cut:
    """A plane through the link; the side to which ``normal`` points is kept."""

    point: tuple[float, float, float]  # [m], link frame
    normal: tuple[float, float, float]


@dataclass(frozen=True)
class CoverSpec:
    """The part of the mesh that the skin covers."""

    shell: str = "outer"  # or "seen", or "all"
    cuts: tuple[Cut, ...] = ()


def cut_cover(mesh: TriangleMesh, spec: CoverSpec) -> TriangleMesh:
    """Return the part of a mesh that the skin covers.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh of the link.
    spec : CoverSpec
        The cuts, and which shells are kept.

    Returns
    -------
    TriangleMesh
        In metres in the link frame.

    Raises
    ------
    InvalidPlan
        If a cut removes everything, or its normal is zero; or if nothing can be seen.
    """
    mesh = single_faces(mesh)
    if spec.shell == "seen":
        mesh = seen_faces(mesh)  # before the cuts: through them one would see the inside
    for i, cut in enumerate(spec.cuts):
        normal = unit(cut.normal)
        if not normal.any():
            raise InvalidPlan(f"The normal of cut {i} is zero. Give the direction of the side to keep.")
        try:
            mesh = kept_side(mesh, tuple(map(float, cut.point)), tuple(normal.tolist()))
        except InvalidMesh as error:
            raise InvalidPlan(
                f"Cut {i} removes the whole mesh. A cut keeps the side to which its normal points. "
                "Reverse the normal, or move the plane."
            ) from error
    return outer_shells(mesh) if spec.shell == "outer" else mesh


def inner_parts(mesh: TriangleMesh, spec: CoverSpec) -> TriangleMesh | None:
    """Return the shells that ``cut_cover`` leaves out as inner parts; None without any."""
    if spec.shell != "outer":
        return None
    whole = cut_cover(mesh, replace(spec, shell="all"))
    inner = ~is_outer(whole)
    return TriangleMesh(whole.vertices, whole.faces[inner]) if inner.any() else None


@lru_cache(maxsize=4)  # while cuts move, the mesh is the same
def single_faces(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh that has, of faces that are back to back, the one whose normal points outward.

    Both would count in areas, and the normal of the other one would be that of no skin.
    """
    mesh = _joined_if_doubled(mesh)
    number = without_doubled(mesh)[1]
    if number.max() + 1 == len(number):
        return mesh
    doubled = np.bincount(number)[number] > 1
    # What can be seen takes long; if doubled faces are few, the others of their part say which side is outside.
    are_few = mesh.face_areas[doubled].sum() < MAX_DOUBLED_FRACTION * mesh.face_areas.sum()
    sides = np.ones(len(number)) if are_few else visibility(mesh).sides
    order = np.lexsort((-sides, number))
    _, first = np.unique(number[order], return_index=True)
    kept = coherent(weld(mesh.vertices, mesh.faces[order[first]]))
    return weld(kept.vertices, kept.faces)


def _joined_if_doubled(mesh: TriangleMesh) -> TriangleMesh:
    """Join vertices within rounding if more faces are back to back then; else return the same mesh."""
    joined = rounded(mesh)
    if joined is mesh:
        return mesh
    close = weld(joined.vertices, joined.faces)
    found, found_close = (len(m.faces) - len(without_doubled(m)[0].faces) for m in (mesh, close))
    return close if found_close > found else mesh


@lru_cache(maxsize=1)  # as visibility
def seen_faces(mesh: TriangleMesh) -> TriangleMesh:
    """Return the faces of all shells that can be seen from outside."""
    mesh = single_faces(mesh)
    seen = visibility(mesh).seen
    if not seen.any():
        raise InvalidPlan("No face of the mesh can be seen from outside. Use the outer shell.")
    return mesh if seen.all() else weld(mesh.vertices, mesh.faces[seen])


@lru_cache(maxsize=4)  # the sketch of the cuts and the fit need the same
def kept_side(mesh: TriangleMesh, point: tuple[float, ...], normal: tuple[float, ...]) -> TriangleMesh:
    """Return the part of a mesh on the side of a plane to which its normal points."""
    return weld(*one_side(mesh, np.array(point), np.array(normal))[:2])


def one_side(mesh: TriangleMesh, point: Array, normal: Array) -> tuple[Array, IntArray, IntArray]:
    """Return vertices [m], faces, and their face of the mesh (f,), on the positive side of a plane."""
    heights = _heights(mesh, point, normal)
    kept = heights >= 0
    count = kept[mesh.faces].sum(axis=1)

    def crossing(a: IntArray, b: IntArray) -> Array:
        """Return where edges cross the plane: the same numbers for both faces of an edge, so that they stay joined."""
        start, end = np.minimum(a, b), np.maximum(a, b)
        part = heights[start] / (heights[start] - heights[end])
        points = mesh.vertices[start] + part[:, None] * (mesh.vertices[end] - mesh.vertices[start])
        return np.where(heights[end, None] == 0, mesh.vertices[end], points)

    whole, one, two = (np.flatnonzero(count == k) for k in (3, 1, 2))
    corner, b, c = _from_corner(mesh.faces[one], kept).T
    tips = np.stack((mesh.vertices[corner], crossing(corner, b), crossing(corner, c)), axis=1)
    has_tip = heights[corner] > 0  # else it touches the plane
    corner, b, c = _from_corner(mesh.faces[two], ~kept).T
    p, q = crossing(b, corner), crossing(c, corner)
    rest = [np.stack(three, axis=1) for three in ((mesh.vertices[b], mesh.vertices[c], q), (mesh.vertices[b], q, p))]
    has_rest = heights[c] > 0, heights[b] > 0
    new = np.concatenate((tips[has_tip], *(part[k] for part, k in zip(rest, has_rest)))).reshape(-1, 3)
    faces = (mesh.faces[whole], len(mesh.vertices) + np.arange(len(new)).reshape(-1, 3))
    of = np.concatenate((whole, one[has_tip], *(two[k] for k in has_rest)))
    return np.concatenate((mesh.vertices, new)), np.concatenate(faces), of


def _heights(mesh: TriangleMesh, point: Array, normal: Array) -> Array:
    """Return the heights of the vertices above a plane, zero for those on it, shape (v,) [m]."""
    heights: Array = (mesh.vertices - point) @ normal
    heights[np.abs(heights) < ON_PLANE * mesh.size] = 0
    return heights


def _from_corner(faces: IntArray, chosen: BoolArray) -> IntArray:
    """Return faces with one chosen vertex each so that they begin with it; their winding stays."""
    first = chosen[faces].argmax(axis=1)
    return np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1)


@lru_cache(maxsize=4)  # as kept_side
def outer_shells(mesh: TriangleMesh) -> TriangleMesh:
    """Remove the inner parts: shells that are mostly inside the convex hull of larger ones."""
    kept = is_outer(mesh)
    return mesh if kept.all() else weld(mesh.vertices, mesh.faces[kept])


def shells_after(mesh: TriangleMesh, cuts: Sequence[tuple[Array, Array]]) -> IntArray:
    """Return the number of the shell of each face of a mesh as far as cuts leave it, shape (f,).

    An edge then connects its two faces if the cuts leave a part of it.
    """
    joined, number = merged(mesh)
    first, second = joined.adjacency
    start, stop = np.zeros(len(first)), np.ones(len(first))  # of what is left of each edge, from its first vertex
    for point, normal in cuts:
        a, b = _heights(joined, point, normal)[joined.shared_edges].T
        with np.errstate(invalid="ignore", divide="ignore"):
            at = a / (a - b)
        start = np.where((a < 0) & (b >= 0), np.maximum(start, at), start)
        stop = np.where((b < 0) & (a >= 0), np.minimum(stop, at), stop)
        stop[(a < 0) & (b < 0)] = 0.0
    left = start < stop
    return components(len(joined.faces), first[left], second[left])[number]
