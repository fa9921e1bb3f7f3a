# SPDX-License-Identifier: GPL-3.0-or-later
"""Sketch hand-placed planes before any fit: removed parts, sections, planes that do not intersect the mesh."""

from dataclasses import dataclass, field

import numpy as np

from ...common.arrays import Array, BoolArray, unit
from ...common.errors import InvalidMesh, InvalidPlan
from ...geometry.grid.grids import check_order
from ...geometry.mesh.cover import is_outer, one_side
from ...geometry.mesh.triangle_mesh import TriangleMesh, weld
from ...geometry.mesh.visibility import visibility
from ...geometry.sampling.planes import Planes, perpendicular
from ...geometry.sampling.sections import cut_sections
from ..overlay.layers import Layer
from ..scene.plane_lists import FAMILIES, HandPlanes

COLOURS = {"CUT": (1.0, 0.3, 0.9, 1.0), "U": (1.0, 0.65, 0.1, 1.0), "V": (0.3, 0.9, 0.4, 1.0)}
REMOVED = (0.9, 0.1, 0.1, 0.35)
MISSED = (1.0, 0.0, 0.0, 1.0)
# Half side of the square that shows a plane without a section, relative to the size of the mesh.
SQUARE = 0.3

Named = tuple[str, int]  # a plane: "CUT", "U" or "V", and its index in that list


@dataclass(eq=False)
class Sketch:
    """Layers of the planes, what is wrong with them, and the positions of their handles."""

    layers: list[Layer] = field(default_factory=list)
    wrong: dict[Named, str] = field(default_factory=dict)  # message, which follows the name of the plane
    centres: dict[Named, Array] = field(default_factory=dict)  # of the sections [m]
    arms: dict[Named, Array] = field(default_factory=dict)  # from the point of a plane to its handle, in the plane [m]


def sketch_of(mesh: TriangleMesh, planes: HandPlanes) -> Sketch:
    """Cut the mesh and draw the section of each plane; the sketch is empty without planes.

    Parameters
    ----------
    mesh : TriangleMesh
        Of the link.
    planes : HandPlanes
        Cuts, u-planes and v-planes.
    """
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
    """Find the first plane whose section is not beyond that of the plane before it."""
    cut = [i for i in range(len(planes.points[family])) if (family, i) in sketch.arms]
    try:
        check_order(np.array([sketch.centres[family, i] for i in cut]).reshape(-1, 3), family.lower(), mesh.size)
    except InvalidPlan as error:
        k = error.numbers["plane"]
        sketch.wrong[family, cut[k]] = f"is not beyond {family.lower()}-plane {cut[k - 1]}"


def _cut(sketch: Sketch, mesh: TriangleMesh, planes: HandPlanes) -> TriangleMesh:
    """Return the mesh without the cut parts and those that are not outside; draw the removed parts."""
    removed, valid = [], [i for i in range(len(planes.points["CUT"])) if ("CUT", i) not in sketch.wrong]

    def only(kept: BoolArray) -> TriangleMesh:
        removed.append(mesh.triangles[~kept])
        return mesh if kept.all() else weld(mesh.vertices, mesh.faces[kept])

    if planes.shell == "seen" and visibility(mesh).seen.any():
        mesh = only(visibility(mesh).seen)
    _draw(sketch, "CUT", mesh, planes, "removes nothing")
    for i in valid:
        point, normal = planes.points["CUT"][i], unit(planes.normals["CUT"][i])
        try:
            kept = weld(*one_side(mesh, point, normal))
        except InvalidMesh:
            sketch.wrong["CUT", i] = "removes the complete mesh. Flip its normal"
            continue
        vertices, faces = one_side(mesh, point, -normal)
        removed.append(vertices[faces])
        mesh = kept
    if planes.shell == "outer":
        mesh = only(is_outer(mesh))
    if sum(map(len, removed)):
        corners = np.concatenate(removed).reshape(-1, 3).astype(np.float32)
        sketch.layers.append(Layer("PLANES", corners, np.tile(np.float32(REMOVED), (len(corners), 1))))
    return mesh


def _draw(sketch: Sketch, family: str, mesh: TriangleMesh, planes: HandPlanes, missing: str) -> None:
    """Draw the sections of a family of planes, and a square for each plane without a section."""
    points, normals = planes.points[family], unit(planes.normals[family])
    valid = [i for i in range(len(points)) if (family, i) not in sketch.wrong]
    if not valid:
        return
    sections = cut_sections(mesh, Planes(points[valid], normals[valid]))
    squares = []
    for k, i in enumerate(valid):
        ends = sections.ends[sections.plane == k].reshape(-1, 3)
        if len(ends):
            sketch.arms[family, i], sketch.centres[family, i] = _arm(points[i], normals[i], ends), ends.mean(axis=0)
        else:
            gap = np.abs((mesh.vertices - points[i]) @ normals[i]).min()
            sketch.wrong[family, i] = f"{missing}; distance {gap * 1e3:.1f} mm"
            squares.append(_square(points[i], normals[i], SQUARE * mesh.size))
    sketch.layers.append(Layer("PLANES", sections.ends.reshape(-1, 3).astype(np.float32), colour=COLOURS[family]))
    if squares:
        sketch.layers.append(Layer("PLANES", np.concatenate(squares).astype(np.float32), colour=MISSED, width=2.0))


def _arm(point: Array, normal: Array, ends: Array) -> Array:
    """Return the vector from a plane's point to the outermost point of its section, equal in parallel planes."""
    rim = ends[np.argmax(ends @ perpendicular(normal))]
    return rim - point - ((rim - point) @ normal) * normal


def _square(point: Array, normal: Array, half: float) -> Array:
    """Return the segments of a square in a plane, shape (8, 3)."""
    a = perpendicular(normal)
    b = np.cross(normal, a)
    corners = point + half * np.array((a + b, a - b, -a - b, b - a))
    return np.stack((corners, np.roll(corners, -1, axis=0)), axis=1).reshape(-1, 3)
