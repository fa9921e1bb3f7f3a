"""From a link's mesh to its cover: cut with planes, then keep the shells that one sees from outside."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError
from trimesh.intersections import slice_faces_plane

from ...common.arrays import Array, BoolArray, IntArray, unit
from ...common.errors import InvalidMesh, InvalidPlan
from .triangle_mesh import TriangleMesh, weld

# A shell with more of its area than this inside the hull of the shells kept so far is an inner part.
INNER_AREA_FRACTION = 0.5


@dataclass(frozen=True)
class Cut:
    """A plane through the link; the side to which ``normal`` points is kept."""

    point: tuple[float, float, float]  # [m], link frame
    normal: tuple[float, float, float]


@dataclass(frozen=True)
class CoverSpec:
    """What of the mesh is covered with skin."""

    shell: str = "outer"  # or "all"
    cuts: tuple[Cut, ...] = ()


def cut_cover(mesh: TriangleMesh, spec: CoverSpec) -> TriangleMesh:
    """The part of a mesh that the skin covers.

    Raises
    ------
    InvalidPlan
        If a cut removes everything, or its normal is zero.
    """
    for i, cut in enumerate(spec.cuts):
        normal = unit(cut.normal)
        if not normal.any():
            raise InvalidPlan(f"the normal of cut {i} is zero; give the direction of the side to keep")
        try:
            mesh = weld(*one_side(mesh, np.asarray(cut.point, float), normal))
        except InvalidMesh as error:
            raise InvalidPlan(
                f"cut {i} removes the whole mesh; a cut keeps the side that its normal points to: turn it round?"
            ) from error
    if spec.shell == "all":
        return mesh
    return outer_shells(mesh)


def one_side(mesh: TriangleMesh, point: Array, normal: Array) -> tuple[Array, IntArray]:
    """Vertices and faces of what lies on the side of a plane to which its unit normal points; perhaps none."""
    vertices, faces, _ = slice_faces_plane(mesh.vertices, mesh.faces, plane_normal=normal, plane_origin=point)
    return vertices, faces


def outer_shells(mesh: TriangleMesh) -> TriangleMesh:
    """Drop the inner parts: shells that lie mostly inside the convex hull of larger ones."""
    kept = is_seen(mesh)
    return mesh if kept.all() else weld(mesh.vertices, mesh.faces[kept])


def is_seen(mesh: TriangleMesh) -> BoolArray:
    """Whether each face belongs to an outer shell, shape (f,)."""
    shell = shells(mesh)
    largest, *others = np.argsort(-np.bincount(shell, mesh.face_areas), kind="stable")
    kept = shell == largest
    hull = None
    for i in others:
        faces = np.flatnonzero(shell == i)
        if hull is None:
            hull = hull_planes(mesh.triangles[kept].reshape(-1, 3))
        if fraction_inside(hull, mesh, faces) < INNER_AREA_FRACTION:
            kept[faces], hull = True, None
    return kept


def fraction_inside(hull: Array, mesh: TriangleMesh, faces: IntArray) -> float:
    """Share of the area of some faces that lies inside a hull; 1 for faces without area."""
    centres, areas = mesh.triangles[faces].mean(axis=1), mesh.face_areas[faces]
    inside = (centres @ hull[:, :3].T + hull[:, 3] < 0).all(axis=1) & (len(hull) > 0)
    return float(areas[inside].sum() / areas.sum()) if areas.sum() > 0 else 1.0


def shells(mesh: TriangleMesh) -> IntArray:
    """Number of the shell of each face, shape (f,): faces are joined over edges that exactly two of them share."""
    count = len(mesh.faces)
    a, b = mesh.adjacency
    return connected_components(coo_array((np.ones(len(a)), (a, b)), shape=(count, count)), directed=False)[1].astype(
        np.int64
    )


def hull_planes(points: Array) -> Array:
    """Outward normal and offset of each facet of the convex hull, shape (k, 4); none if the points are flat."""
    try:
        return ConvexHull(points).equations
    except QhullError:
        return np.empty((0, 4))
