"""From a link's mesh to its cover: keep what is outside, and cut it with planes."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial import ConvexHull, Delaunay, QhullError, cKDTree

from ...common.arrays import Array, BoolArray, IntArray, locked, unit
from ...common.errors import InvalidMesh, InvalidPlan
from ..components import components
from .closest import split_faces
from .triangle_mesh import TriangleMesh, weld
from .visibility import visibility

# [fraction of the area] A shell with more of its area inside the hull of the shells kept so far is an inner part.
# Larger: more inner parts are kept.
INNER_AREA_FRACTION = 0.5
# [fraction of the distance from the middle] by which a point must be inside a hull. Larger: parts that are flush with
# it are no inner parts; smaller: rounding decides.
HULL_TOLERANCE = 1e-6
# [fraction of the distance from the middle] by which a shell must be outside the hull of those kept so far to make it
# larger. Larger: faster for links with many parts, and less exact.
HULL_GROWTH = 1e-4
# [fraction of the root of the area of a shell] longest side of the parts that are inside the hull or not. Larger: less
# accurate fractions, which depend on the faces.
SHELL_PART_FRACTION = 0.03
# [size of the mesh] distance from a cut up to which a vertex is on it. Larger: rims are less even; smaller: rounding
# leaves faces without area.
ON_PLANE = 1e-9
# [largest coordinate] distance up to which vertices are the same for shells: rounding to single precision moves two
# equal points apart by up to 0.87 of it. Larger: narrow gaps between parts are closed.
ROUNDING = 2.0**-22


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


@lru_cache(maxsize=1)  # as visibility
def seen_faces(mesh: TriangleMesh) -> TriangleMesh:
    """Return the faces of all shells that can be seen from outside.

    Raises
    ------
    InvalidPlan
        If there is none.
    """
    seen = visibility(mesh).seen
    if not seen.any():
        raise InvalidPlan('No face of the mesh can be seen from outside. Set "shell": "outer".')
    return mesh if seen.all() else weld(mesh.vertices, mesh.faces[seen])


@lru_cache(maxsize=4)  # the sketch of the cuts and the fit need the same
def kept_side(mesh: TriangleMesh, point: tuple[float, ...], normal: tuple[float, ...]) -> TriangleMesh:
    """Return the part of a mesh on the side of a plane to which its normal points.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh to cut.
    point : tuple of float
        Of the plane [m].
    normal : tuple of float
        Unit normal of the plane.

    Returns
    -------
    TriangleMesh

    Raises
    ------
    InvalidMesh
        If it is empty.
    """
    return weld(*one_side(mesh, np.array(point), np.array(normal))[:2])


def one_side(mesh: TriangleMesh, point: Array, normal: Array) -> tuple[Array, IntArray, IntArray]:
    """Return the part of a mesh on the side of a plane to which its normal points; it may be empty.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh to cut.
    point : array, shape (3,)
        Of the plane [m].
    normal : array, shape (3,)
        Unit normal of the plane.

    Returns
    -------
    vertices : array, shape (v, 3)
        [m]
    faces : array of int, shape (f, 3)
        Indices of vertices. No face has two equal corners.
    of : array of int, shape (f,)
        The face of the mesh that each of them is a part of.
    """
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


@lru_cache(maxsize=4)
def is_outer(mesh: TriangleMesh) -> BoolArray:
    """Return whether each face belongs to an outer shell, shape (f,), read-only."""
    return are_outer(mesh, shells(mesh))


def are_outer(mesh: TriangleMesh, shell: IntArray) -> BoolArray:
    """Return which faces belong to an outer shell, shape (f,), read-only.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh.
    shell : array of int, shape (f,)
        Number of the shell of each face.
    """
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
    """Return the fraction of the area of some faces that is inside a convex hull; 1 for faces without area.

    Parameters
    ----------
    hull : Delaunay or None
        Of ``convex_hull``.
    mesh : TriangleMesh
        The mesh of the faces.
    faces : array of int, shape (n,)
        Indices of the faces.

    Returns
    -------
    float
    """
    shell = TriangleMesh(mesh.vertices, mesh.faces[faces])
    if shell.face_areas.sum() == 0:
        return 1.0
    if hull is None:
        return 0.0
    if is_inside(hull, shell.triangles.reshape(-1, 3), -HULL_TOLERANCE).all():
        return 1.0
    # Small parts, so that the fraction does not depend on the size of the faces.
    centres, face, parts = split_faces(shell, SHELL_PART_FRACTION * float(np.sqrt(shell.face_areas.sum())))
    areas = shell.face_areas[face] / parts[face] ** 2
    return float(areas[is_inside(hull, centres, -HULL_TOLERANCE)].sum() / areas.sum())


def is_inside(hull: Delaunay, points: Array, growth: float) -> BoolArray:
    """Return which points are inside a hull of another size, shape (k,).

    Parameters
    ----------
    hull : Delaunay
        Of ``convex_hull``.
    points : array, shape (k, 3)
        [m]
    growth : float
        Fraction by which the hull is made larger about its middle; below zero it becomes smaller.
    """
    middle = hull.points.mean(axis=0)
    inside: BoolArray = hull.find_simplex(middle + (1 - growth) * (points - middle)) >= 0
    return inside


def shells(mesh: TriangleMesh) -> IntArray:
    """Return the number of the shell of each face, shape (f,): an edge connects faces if it belongs to exactly two.

    Vertices that differ by the rounding of single precision are the same: some files have other ones in each face.
    Faces that are back to back count as one: edges of a mesh whose faces are doubled belong to four faces.
    """
    connected, number = _connected(mesh)
    return connected.pieces[number]


def shells_after(mesh: TriangleMesh, cuts: Sequence[tuple[Array, Array]]) -> IntArray:
    """Return the number of the shell of each face of a mesh as far as cuts leave it, shape (f,).

    An edge then connects its two faces if the cuts leave a part of it.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh without cuts.
    cuts : sequence of (point, normal)
        Points of planes [m], and their normals to the kept side.
    """
    connected, number = _connected(mesh)
    first, second = connected.adjacency
    start, stop = np.zeros(len(first)), np.ones(len(first))  # of what is left of each edge, from its first vertex
    for point, normal in cuts:
        a, b = _heights(connected, point, normal)[connected.shared_edges].T
        with np.errstate(invalid="ignore", divide="ignore"):
            at = a / (a - b)
        start = np.where((a < 0) & (b >= 0), np.maximum(start, at), start)
        stop = np.where((b < 0) & (a >= 0), np.minimum(stop, at), stop)
        stop[(a < 0) & (b < 0)] = 0.0
    left = start < stop
    return components(len(connected.faces), first[left], second[left])[number]


@lru_cache(maxsize=4)
def _connected(mesh: TriangleMesh) -> tuple[TriangleMesh, IntArray]:
    """Return a mesh with the same shells that merges what counts as one, and the number of each face in it, (f,)."""
    found = _single(mesh)
    if found[0].pieces.max() == 0:
        return found
    distance = ROUNDING * float(np.abs(mesh.vertices).max())
    pairs = cKDTree(mesh.vertices).query_pairs(distance, output_type="ndarray")
    if len(pairs) == 0:
        return found
    same = components(len(mesh.vertices), *pairs.T)
    chosen = np.unique(same, return_index=True)[1]
    return _single(TriangleMesh(mesh.vertices, chosen[same][mesh.faces]))


def _single(mesh: TriangleMesh) -> tuple[TriangleMesh, IntArray]:
    """Return a mesh without doubled faces if its faces are not connected, and the number of each face in it, (f,)."""
    every = np.arange(len(mesh.faces))
    if mesh.pieces.max() == 0:
        return mesh, every
    single, number = np.unique(np.sort(mesh.faces, axis=1), axis=0, return_inverse=True)
    return (mesh, every) if len(single) == len(mesh.faces) else (TriangleMesh(mesh.vertices, single), number.ravel())


def convex_hull(points: Array) -> Delaunay | None:
    """Return the convex hull of points (k, 3) as tetrahedra; None if the points are flat."""
    try:
        return Delaunay(points[ConvexHull(points).vertices])
    except QhullError:
        return None
