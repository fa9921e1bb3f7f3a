# SPDX-License-Identifier: GPL-3.0-or-later
"""What planes placed by hand do to a mesh, drawn before any fit: what cuts remove, sections, planes that miss."""

from dataclasses import dataclass, field

import numpy as np
from trimesh.intersections import slice_faces_plane

from ..arrays import Array, unit
from ..errors import InvalidMesh
from ..geometry.cover import outer_shells
from ..geometry.mesh import TriangleMesh, weld
from ..geometry.planes import Planes, perpendicular
from ..geometry.sections import cut_sections
from .layers import Layer

REMOVED = (0.9, 0.1, 0.1, 0.35)
# Half a side of the square that stands for a plane without a section, as a share of the mesh's size.
SQUARE = 0.3

Named = tuple[str, int]  # a plane: "CUT", "U" or "V", and its place in that list


@dataclass(frozen=True, eq=False)
class HandPlanes:
    """The planes of a plan that its author placed one by one, by family; row i of each pair of arrays is one plane."""

    points: dict[str, Array]  # (k, 3) [m]
    normals: dict[str, Array]  # (k, 3), of any length
    shell: str  # which shells of the mesh are kept, as in a CoverSpec

    @property
    def are_there(self) -> bool:
        """Whether there is anything to sketch."""
        return any(len(points) for points in self.points.values())


@dataclass(eq=False)
class Sketch:
    """What is drawn of planes, what is wrong with them, and where their handles are."""

    layers: list[Layer] = field(default_factory=list)
    wrong: dict[Named, str] = field(default_factory=dict)
    arms: dict[Named, Array] = field(default_factory=dict)  # from a plane's point to its handle, in the plane [m]


def sketch_of(mesh: TriangleMesh, planes: HandPlanes) -> Sketch:
    """Cut the mesh and draw the section of each plane."""
    sketch = Sketch()
    for family in ("CUT", "U", "V"):
        for i in np.flatnonzero(~planes.normals[family].any(axis=1)):
            sketch.wrong[family, int(i)] = "its normal is zero"
    cover = _cut(sketch, mesh, planes)
    for family in ("U", "V"):
        _draw(sketch, family, cover, planes, "misses the mesh")
    return sketch


def _cut(sketch: Sketch, mesh: TriangleMesh, planes: HandPlanes) -> TriangleMesh:
    """What cuts and shells leave of the mesh; what they take away is drawn."""
    _draw(sketch, "CUT", mesh, planes, "cuts nothing off")
    gone = []
    for i, (point, normal) in enumerate(zip(planes.points["CUT"], unit(planes.normals["CUT"]))):
        if ("CUT", i) in sketch.wrong:
            continue
        try:
            kept = weld(*slice_faces_plane(mesh.vertices, mesh.faces, plane_normal=normal, plane_origin=point)[:2])
        except InvalidMesh:
            sketch.wrong["CUT", i] = "removes the whole mesh: turn it round"
            continue
        off = slice_faces_plane(mesh.vertices, mesh.faces, plane_normal=-normal, plane_origin=point)
        gone.append(off[0][off[1]])
        mesh = kept
    if planes.shell == "outer":
        outer = outer_shells(mesh)
        if len(outer.faces) < len(mesh.faces):
            known = {face.tobytes() for face in outer.triangles}
            gone.append(np.array([face for face in mesh.triangles if face.tobytes() not in known]))
        mesh = outer
    if sum(map(len, gone)):
        corners = np.concatenate(gone).reshape(-1, 3).astype(np.float32)
        sketch.layers.append(Layer("REMOVED", corners, np.tile(np.float32(REMOVED), (len(corners), 1))))
    return mesh


def _draw(sketch: Sketch, family: str, mesh: TriangleMesh, planes: HandPlanes, missing: str) -> None:
    """Sections of the planes of a family, and a square for each that has none."""
    points, normals = planes.points[family], unit(planes.normals[family])
    sound = [i for i in range(len(points)) if (family, i) not in sketch.wrong]
    if not sound:
        return
    sections = cut_sections(mesh, Planes(points[sound], normals[sound]))
    squares = []
    for k, i in enumerate(sound):
        ends = sections.ends[sections.plane == k].reshape(-1, 3)
        if len(ends):
            sketch.arms[family, i] = _arm(points[i], normals[i], ends)
        else:
            gap = np.abs((mesh.vertices - points[i]) @ normals[i]).min()
            sketch.wrong[family, i] = f"{missing}, by {gap * 1e3:.1f} mm"
            squares.append(_square(points[i], normals[i], SQUARE * mesh.size))
    sketch.layers.append(Layer(family, sections.ends.reshape(-1, 3).astype(np.float32)))
    if squares:
        sketch.layers.append(Layer("MISSED", np.concatenate(squares).astype(np.float32)))


def _arm(point: Array, normal: Array, ends: Array) -> Array:
    """From a plane's point to the end of its section that is furthest along a direction shared by parallel planes."""
    rim = ends[np.argmax(ends @ perpendicular(normal))]
    return rim - point - ((rim - point) @ normal) * normal


def _square(point: Array, normal: Array, half: float) -> Array:
    """Segments of a square in a plane, shape (8, 3)."""
    a = perpendicular(normal)
    b = np.cross(normal, a)
    corners = point + half * np.array((a + b, a - b, -a - b, b - a))
    return np.stack((corners, np.roll(corners, -1, axis=0)), axis=1).reshape(-1, 3)
