"""Triangle meshes in metres in the link frame, in one canonical order."""

import hashlib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from ...common.arrays import Array, BoolArray, IntArray, cross, freeze, norms, row_order
from ...common.arrays import unit as to_unit
from ...common.atomic_file import write_bytes_safely
from ...common.errors import InvalidMesh
from ..components import components
from .dae import read_dae
from .gaps import closed
from .glb import read_glb
from .obj import read_obj
from .off import read_off
from .ply import read_ply
from .polygons import check_indices
from .stl import read_stl

READERS: dict[str, Callable[[Path], tuple[Array, IntArray]]] = {
    "stl": read_stl,
    "ply": read_ply,
    "obj": read_obj,
    "off": read_off,
    "dae": read_dae,
    "glb": read_glb,
}
FORMATS = tuple(READERS)
METRES_PER_UNIT = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254}
ROUND_SIDES = 64  # faces around a cylinder, sphere or capsule: it deviates by 0.1 % of its radius. Larger: slower
MIN_MESH_SIZE = 2e-3  # [m] least size of the mesh of a link; below, the unit is wrong. Smaller: wrong units pass
MAX_MESH_BYTES = 512 << 20  # [B] largest mesh file. Larger: files with holes fill the memory
MAX_MESH_SIZE = 5.0  # [m] largest size of the mesh of a link; above, the unit is wrong. Larger: wrong units pass


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Vertices [m] in the link frame and the triangles between them; :func:`weld` builds it."""

    vertices: Array  # (v, 3) [m], no two equal
    faces: IntArray  # (f, 3)

    def __post_init__(self):
        freeze(self, vertices=(None, 3), faces=(None, 3))

    @cached_property
    def size(self) -> float:
        """Return the diameter of the ball about the mean of the vertices that contains them [m].

        Tolerances are fractions of it. A box along the axes of the link frame would make fits depend on this frame.
        """
        return 2 * float(np.linalg.norm(self.vertices - self.vertices.mean(axis=0), axis=1).max())

    @cached_property
    def corners(self) -> tuple[IntArray, IntArray, IntArray]:
        """Return the first, second and third vertex of each face as separate arrays, shape (f,) each."""
        a, b, c = np.ascontiguousarray(self.faces.T)
        return a, b, c

    @cached_property
    def triangles(self) -> Array:
        """Return the corners of each face, shape (f, 3, 3) [m]."""
        return self.vertices[self.faces]

    @cached_property
    def face_normals(self) -> Array:
        """Return the unit normals by the winding of each face, shape (f, 3)."""
        return to_unit(self._cross)

    @cached_property
    def face_areas(self) -> Array:
        """Return the area of each face, shape (f,) [m^2]."""
        return norms(self._cross) / 2

    @cached_property
    def longest_sides(self) -> Array:
        """Return the length of the longest side of each face, shape (f,) [m]."""
        a, b, c = (self.vertices[corner] for corner in self.corners)
        squares = [np.einsum("fc,fc->f", side, side) for side in (b - a, c - b, a - c)]
        return np.sqrt(np.maximum(np.maximum(*squares[:2]), squares[2]))

    @cached_property
    def _cross(self) -> Array:
        corners = self.vertices[self.faces]  # ``triangles`` would be kept
        return cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])

    @property
    def adjacency(self) -> tuple[IntArray, IntArray]:
        """Return the pairs of faces with a common edge that belongs to no third face, shape (e,) each."""
        return self._shared[:2]

    @property
    def shared_edges(self) -> IntArray:
        """Return the vertices of the common edge of each pair of :attr:`adjacency`, shape (e, 2)."""
        return self._shared[2]

    @property
    def disagreeing(self) -> BoolArray:
        """Return which pairs of :attr:`adjacency` are wound against each other, shape (e,)."""
        return self._shared[3]

    def around(self, faces: IntArray) -> tuple[IntArray, IntArray]:
        """Return the pairs of given faces and those with a common vertex, a face itself included.

        Parameters
        ----------
        faces : array of int, shape (k,)
            Numbers of faces.

        Returns
        -------
        row, face : array of int, shape (p,)
            Position of the first of each pair in ``faces``, and number of the second.
        """
        row, face = (self._vertices_of_faces[faces] @ self._faces_of_vertices).nonzero()
        return row, face

    @cached_property
    def _vertices_of_faces(self) -> csr_array:
        """The three vertices of each face, as a sparse matrix (f, v)."""
        shape, ends = (len(self.faces), len(self.vertices)), np.arange(0, self.faces.size + 1, 3)
        return csr_array((np.ones(self.faces.size, bool), self.faces.ravel(), ends), shape)

    @cached_property
    def _faces_of_vertices(self) -> csr_array:
        """The faces around each vertex, as a sparse matrix (v, f)."""
        return self._vertices_of_faces.T.tocsr()

    @cached_property
    def pieces(self) -> IntArray:
        """Return the number of the piece of each face, shape (f,): pieces are connected by :attr:`adjacency`."""
        return components(len(self.faces), *self.adjacency)

    @cached_property
    def _shared(self) -> tuple[IntArray, IntArray, IntArray, BoolArray]:
        a, b, c = self.corners
        sides = [np.maximum(i, j) * len(self.vertices) + np.minimum(i, j) for i, j in ((a, b), (b, c), (c, a))]
        edges = np.concatenate(sides)  # one number for each edge: it sorts faster than two
        order = np.argsort(edges, kind="stable")
        edges, face = edges[order], order % len(self.faces)
        same = edges[1:] == edges[:-1]
        pair = same & ~np.append(False, same[:-1]) & ~np.append(same[1:], False)
        first, second = face[:-1][pair], face[1:][pair]
        ends = np.column_stack(np.divmod(edges[:-1][pair], len(self.vertices)))
        rises = np.concatenate((a < b, b < c, c < a))[order]
        against = (rises[:-1] == rises[1:])[pair]
        return np.minimum(first, second), np.maximum(first, second), ends, against

    @cached_property
    def sha256(self) -> str:
        """Return a hash of the geometry; it is independent of file format and of the order of vertices and faces."""
        digest = hashlib.sha256(np.ascontiguousarray(self.vertices, "<f8").tobytes())
        digest.update(np.ascontiguousarray(self.faces, "<i8").tobytes())
        return digest.hexdigest()


def weld(vertices: Any, faces: Any) -> TriangleMesh:
    """Merge equal vertices, remove degenerate and repeated faces, and sort both.

    The result depends on the set of triangles alone, not on the order in which a file or a scene lists them.

    Parameters
    ----------
    vertices : array, shape (v, 3)
        [m], link frame.
    faces : array of int, shape (f, 3)
        Indices of vertices.

    Returns
    -------
    TriangleMesh
        In metres in the link frame.

    Raises
    ------
    InvalidMesh
        If there is no face, an index is out of range, or a coordinate is not finite.
    """
    vertices = np.asarray(vertices, float).reshape(-1, 3) + 0.0  # -0.0 becomes 0.0: both are the same point
    faces = np.asarray(faces, np.int64).reshape(-1, 3)
    if len(faces) == 0:
        raise InvalidMesh("The mesh has no faces. It must be a surface of triangles.")
    check_indices(faces, len(vertices))
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        raise InvalidMesh(
            f"Vertex {bad[0]} of the mesh is not finite ({len(bad)} such). Remove it, or export the mesh again.",
            vertex=int(bad[0]),
        )
    order = row_order(vertices)
    ordered = vertices[order]
    new = np.r_[True, (ordered[1:] != ordered[:-1]).any(axis=1)]
    index = np.empty(len(vertices), np.int64)
    index[order] = np.cumsum(new) - 1
    faces = index[faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    if len(faces) == 0:
        raise InvalidMesh("Every face of the mesh is degenerate (two equal corners). Export it again.")
    lowest = np.argmin(faces, axis=1)[:, None]
    faces = np.take_along_axis(faces, (lowest + np.arange(3)) % 3, axis=1)
    edges = faces[:, 0] * len(vertices) + faces[:, 1]  # one number for the first two
    faces = faces[row_order(np.column_stack((edges, faces[:, 2])))]
    faces = faces[np.r_[True, (faces[1:] != faces[:-1]).any(axis=1)]]
    is_used = np.zeros(len(ordered), bool)
    is_used[faces] = True
    used = np.flatnonzero(is_used)
    renumber = np.empty(len(ordered), np.int64)
    renumber[used] = np.arange(len(used))
    return TriangleMesh(ordered[new][used], renumber[faces])


def at_rims(faces: IntArray, count: int) -> BoolArray:
    """Return which vertices (count,) have an edge of one face only, or edges of differently wound faces."""
    ends = np.zeros(count)
    for i in range(3):  # around an inner vertex each neighbour is once before and once after it
        ends += np.bincount(faces[:, i], faces[:, i - 2] - faces[:, i - 1].astype(float), count)
    found: BoolArray = ends != 0
    return found


def without_gaps(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh without gaps of rounding between adjacent faces; the same if it has none, or would lose faces."""
    vertices = closed(mesh.vertices, mesh.faces, at_rims(mesh.faces, len(mesh.vertices)))
    if vertices is mesh.vertices:
        return mesh
    result = weld(vertices, mesh.faces)
    return result if len(result.faces) == len(mesh.faces) else mesh


def joined(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Return several meshes as one."""
    return weld(*stacked([(mesh.vertices, mesh.faces) for mesh in meshes]))


def stacked(parts: Sequence[tuple[Array, IntArray]]) -> tuple[Array, IntArray]:
    """Return the vertices (v, 3) and faces (f, 3) of several parts as those of one mesh, which is not welded."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = [faces + start for (_, faces), start in zip(parts, starts)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces)


def load_mesh(path: str | Path, unit: str = "m") -> TriangleMesh:
    """Read a mesh file into metres.

    Parameters
    ----------
    path : path
        An STL, PLY, OBJ, OFF, DAE or GLB file.
    unit : "m", "cm", "mm" or "in"
        Unit of the numbers in the file.

    Returns
    -------
    TriangleMesh
        In metres in the link frame.

    Raises
    ------
    InvalidMesh
        If the file is missing, unreadable or without a surface, or if its size shows that the unit is wrong.
    """
    raw = read_mesh(path)
    mesh = TriangleMesh(raw.vertices * METRES_PER_UNIT[unit], raw.faces)
    check_size(mesh, unit, Path(path).name)
    return mesh


def simple_shape(kind: str, size: Sequence[float]) -> tuple[Array, IntArray]:
    """Return vertices [m] and faces of a box, cylinder, sphere or capsule about the origin; cylinders are along z."""
    import trimesh

    if kind == "box":
        mesh = trimesh.creation.box(size)
    elif kind == "cylinder":
        mesh = trimesh.creation.cylinder(size[0], size[1], ROUND_SIDES)
    elif kind == "capsule":
        mesh = trimesh.creation.capsule(size[1], size[0], (ROUND_SIDES, ROUND_SIDES // 2))
    else:
        mesh = trimesh.creation.uv_sphere(size[0], count=(ROUND_SIDES // 2, ROUND_SIDES))
    return np.asarray(mesh.vertices, float), np.asarray(mesh.faces)


def read_mesh(path: str | Path) -> TriangleMesh:
    """Read a mesh file without conversion of its numbers; those of a DAE file become metres by its unit."""
    path = Path(path)
    kind = path.suffix.lower().lstrip(".")
    if not os.path.isfile(path):  # Path.is_file raises where a name is too long
        raise InvalidMesh(f"There is no mesh file at {path}. Check its name and its folder.", path=str(path))
    if kind not in FORMATS:
        raise InvalidMesh(f"{path.name} has an unknown format. Use one of {', '.join(FORMATS)}.", path=str(path))
    if os.path.getsize(path) > MAX_MESH_BYTES:
        raise InvalidMesh(
            f"{path.name} has more than {MAX_MESH_BYTES >> 20} MiB. Export it as binary, or with fewer faces.",
            path=str(path),
        )
    if os.path.getsize(path) == 0:
        raise InvalidMesh(f"{path.name} is empty. Check that it was written completely.", path=str(path))
    try:
        vertices, faces = READERS[kind](path)
    except ModuleNotFoundError:  # the command line states what to install
        raise
    except ImportError as error:
        raise InvalidMesh(f"{path.name} cannot be read: {error}", path=str(path)) from error
    except Exception as error:  # libraries raise many types of exceptions for broken files
        raise InvalidMesh(f"{path.name} is not a valid {kind.upper()} file: {error}", path=str(path)) from error
    try:
        return without_gaps(weld(vertices, faces))
    except InvalidMesh as error:
        raise InvalidMesh(f"{path.name}: {error}", **error.numbers) from error


def save_mesh(mesh: TriangleMesh, path: str | Path) -> None:
    """Write a binary PLY file in double precision, so that reading it gives the same numbers, to the bit."""
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(mesh.faces), np.dtype([("count", "u1"), ("corner", "<i4", 3)]))
    faces["count"], faces["corner"] = 3, mesh.faces
    write_bytes_safely(path, header.encode() + mesh.vertices.astype("<f8").tobytes() + faces.tobytes())


def check_size(mesh: TriangleMesh, unit: str, name: str) -> None:
    """Check that the size of a mesh fits its unit."""
    if MIN_MESH_SIZE <= mesh.size <= MAX_MESH_SIZE:
        return
    others = {name: mesh.size / METRES_PER_UNIT[unit] * metre for name, metre in METRES_PER_UNIT.items()}
    possible = [f'"{n}" ({d * 1e3:.4g} mm)' for n, d in others.items() if MIN_MESH_SIZE <= d <= MAX_MESH_SIZE]
    advice = (
        f'Set "unit" to that of its numbers: {" or ".join(possible)}.' if possible else "Scale it to its real size."
    )
    raise InvalidMesh(f'{name} has a diameter of {mesh.size:.4g} m when read in "{unit}". {advice}', size=mesh.size)
