# SPDX-License-Identifier: GPL-3.0-or-later
"""What planes placed by hand do to a mesh, drawn before any fit: what cuts remove, sections, planes that miss."""

from dataclasses import dataclass, field

import numpy as np

from ...common.arrays import Array, unit
from ...common.errors import InvalidMesh, InvalidPlan
from ...geometry.grid.grids import check_order
from ...geometry.mesh.cover import is_seen, one_side
from ...geometry.mesh.triangle_mesh import TriangleMesh, weld
from ...geometry.sampling.planes import Planes, perpendicular
from ...geometry.sampling.sections import cut_sections
from ..overlay.layers import Layer
from ..scene.plane_lists import FAMILIES, HandPlanes

COLOURS = {"CUT": (1.0, 0.3, 0.9, 1.0), "U": (1.0, 0.65, 0.1, 1.0), "V": (0.3, 0.9, 0.4, 1.0)}
REMOVED, MISSED = (0.9, 0.1, 0.1, 0.35), (1.0, 0.0, 0.0, 1.0)
# Half a side of the square that stands for a plane without a section, as a share of the mesh's size.
SQUARE = 0.3

Named = tuple[str, int]  # a plane: "CUT", "U" or "V", and its place in that list


@dataclass(eq=False)
class Sketch:
    """What is drawn of planes, what is wrong with them, and where their handles are."""

    layers: list[Layer] = field(default_factory=list)
    wrong: dict[Named, str] = field(default_factory=dict)  # what is said of it, after its name
    centres: dict[Named, Array] = field(default_factory=dict)  # of the sections [m]
    arms: dict[Named, Array] = field(default_factory=dict)  # from a plane's point to its handle, in the plane [m]


def sketch_of(mesh: TriangleMesh, planes: HandPlanes) -> Sketch:
    """Cut the mesh and draw the section of each plane; nothing where there are no planes."""
    sketch = Sketch()
    if not planes.are_there:
        return sketch
    for family in FAMILIES:
        for i in np.flatnonzero(~planes.normals[family].any(axis=1)):
            sketch.wrong[family, int(i)] = "has a normal of length zero"
    cover = _cut(sketch, mesh, planes)
    for family in ("U", "V"):
        _draw(sketch, family, cover, planes, "misses the mesh")
    _check_order(sketch, "U", cover, planes)
    if not planes.closed:
        _check_order(sketch, "V", cover, planes)
    return sketch


def _check_order(sketch: Sketch, family: str, mesh: TriangleMesh, planes: HandPlanes) -> None:
    """Find the first plane whose section does not lie beyond that of the one before it."""
    cut = [i for i in range(len(planes.points[family])) if (family, i) in sketch.arms]
    try:
        check_order(np.array([sketch.centres[family, i] for i in cut]).reshape(-1, 3), family.lower(), mesh.size)
    except InvalidPlan as error:
        k = error.numbers["plane"]
        sketch.wrong[family, cut[k]] = f"does not lie beyond {family.lower()}-plane {cut[k - 1]}"


def _cut(sketch: Sketch, mesh: TriangleMesh, planes: HandPlanes) -> TriangleMesh:
    """What cuts and shells leave of the mesh; what they take away is drawn."""
    gone, sound = [], [i for i in range(len(planes.points["CUT"])) if ("CUT", i) not in sketch.wrong]
    _draw(sketch, "CUT", mesh, planes, "cuts nothing off")
    for i in sound:
        point, normal = planes.points["CUT"][i], unit(planes.normals["CUT"][i])
        try:
            kept = weld(*one_side(mesh, point, normal))
        except InvalidMesh:
            sketch.wrong["CUT", i] = "removes the whole mesh: turn it round"
            continue
        vertices, faces = one_side(mesh, point, -normal)
        gone.append(vertices[faces])
        mesh = kept
    if planes.shell == "outer":
        seen = is_seen(mesh)
        if not seen.all():
            gone.append(mesh.triangles[~seen])
            mesh = weld(mesh.vertices, mesh.faces[seen])
    if sum(map(len, gone)):
        corners = np.concatenate(gone).reshape(-1, 3).astype(np.float32)
        sketch.layers.append(Layer("PLANES", corners, np.tile(np.float32(REMOVED), (len(corners), 1))))
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
            sketch.arms[family, i], sketch.centres[family, i] = _arm(points[i], normals[i], ends), ends.mean(axis=0)
        else:
            gap = np.abs((mesh.vertices - points[i]) @ normals[i]).min()
            sketch.wrong[family, i] = f"{missing}, by {gap * 1e3:.1f} mm"
            squares.append(_square(points[i], normals[i], SQUARE * mesh.size))
    sketch.layers.append(Layer("PLANES", sections.ends.reshape(-1, 3).astype(np.float32), colour=COLOURS[family]))
    if squares:
        sketch.layers.append(Layer("PLANES", np.concatenate(squares).astype(np.float32), colour=MISSED, width=2.0))


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
