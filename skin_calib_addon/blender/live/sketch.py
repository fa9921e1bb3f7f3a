# SPDX-License-Identifier: GPL-3.0-or-later
"""Sketch hand-placed planes before any fit: removed parts, sections, planes that do not intersect the mesh."""

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from ...common.arrays import Array, unit
from ...common.colours import GREEN, PINK, VERMILLION, YELLOW
from ...common.errors import InvalidPlan
from ...common.warnings import point_of
from ...geometry.grid.grids import PlanesGrid
from ...geometry.mesh.clustering import coarse_mesh
from ...geometry.mesh.cover import CoverSpec, Cut, cut_cover, one_side, seen_faces, shells_after
from ...geometry.mesh.shells import are_outer
from ...geometry.mesh.triangle_mesh import TriangleMesh
from ...geometry.mesh.visibility import visibility
from ...geometry.sampling.planes import Planes, perpendicular
from ...geometry.sampling.sections import cut_sections
from ..overlay.layers import Layer
from ..scene.plane_lists import FAMILIES, HandPlanes

COLOURS = {"CUT": PINK, "U": YELLOW, "V": GREEN}
REMOVED = (*VERMILLION[:3], 0.4)
# Half side of the square that shows a plane without a section, relative to the size of the mesh.
SQUARE = 0.3
MAX_SECTIONS = 300  # kept of one mesh. Larger: more memory; smaller: sections of planes that did not move are cut again

Named = tuple[str, int]  # a plane: "CUT", "U" or "V", and its index in that list


@dataclass(eq=False)
class Sketch:
    """Layers of the planes, what is wrong with them, and the positions of their handles."""

    layers: list[Layer] = field(default_factory=list)
    wrong: dict[Named, str] = field(default_factory=dict)  # message, which follows the name of the plane
    centres: dict[Named, Array] = field(default_factory=dict)  # of the sections [m]
    arms: dict[Named, Array] = field(default_factory=dict)  # from the point of a plane to its handle, in the plane [m]


def sketch_of(mesh: TriangleMesh, planes: HandPlanes, coarse: bool = False) -> Sketch:
    """Cut the mesh and draw the section of each plane; the sketch is empty without planes."""
    sketch = Sketch()
    if not planes.are_there:
        return sketch
    for family in FAMILIES:
        for i in np.flatnonzero(~planes.normals(family).any(axis=1)):
            sketch.wrong[family, int(i)] = "has a normal of length zero"
    cover = _cut(sketch, mesh, planes, coarse)
    for family in ("U", "V"):
        _draw(sketch, family, cover, planes, "misses the mesh")
    _check_order(sketch, cover, planes)
    return sketch


def _check_order(sketch: Sketch, mesh: TriangleMesh, planes: HandPlanes) -> None:
    """Find the first plane that is the same as another one, as a fit with the planes that cut the mesh does."""
    rows = {family: [i for i in range(len(planes.points(family))) if (family, i) in sketch.arms] for family in "UV"}
    if not all(rows.values()):
        return
    u, v = (Planes(planes.points(family)[rows[family]], planes.normals(family)[rows[family]]) for family in "UV")
    try:
        PlanesGrid(u, v, planes.closed).line_grid(mesh)
    except InvalidPlan as error:
        if "plane" in error.numbers:  # others are of the planes together
            name, k, before = (error.numbers[key] for key in ("family", "plane", "before"))
            of = rows[name.upper()]
            sketch.wrong[name.upper(), of[k]] = f"does not follow {name}-plane {of[before]}, or is the same"


def _cut(sketch: Sketch, mesh: TriangleMesh, planes: HandPlanes, coarse: bool) -> TriangleMesh:
    """Draw the removed parts; return the mesh without them, or the mesh itself if no other planes need it."""
    valid = [i for i in range(len(planes.points("CUT"))) if ("CUT", i) not in sketch.wrong]
    cuts = [Cut(point_of(planes.points("CUT")[i]), point_of(unit(planes.normals("CUT")[i]))) for i in valid]
    removed, complete = _removed(mesh, CoverSpec(planes.shell, tuple(cuts)), coarse)
    _draw(sketch, "CUT", _seen(mesh, planes.shell), planes, "removes nothing")
    for k in complete:
        sketch.wrong["CUT", valid[k]] = "removes the complete mesh. Flip its normal"
    if len(removed):
        sketch.layers.append(Layer("PLANES", removed, np.tile(np.float32(REMOVED), (len(removed), 1))))
    if not len(planes.points("U")) and not len(planes.points("V")):
        return mesh
    left = tuple(cut for k, cut in enumerate(cuts) if k not in complete)
    return cut_cover(_seen(mesh, planes.shell), CoverSpec("outer" if planes.shell == "outer" else "all", left))


def _seen(mesh: TriangleMesh, shell: str) -> TriangleMesh:
    """Return what cuts are applied to."""
    return seen_faces(mesh) if shell == "seen" and visibility(mesh).seen.any() else mesh


@lru_cache(maxsize=4)  # while other planes move, the removed parts are the same
def _removed(mesh: TriangleMesh, spec: CoverSpec, coarse: bool = False) -> tuple[Array, tuple[int, ...]]:
    """Return the corners of the removed triangles (3 t, 3), float32 [m], and the cuts that would remove everything.

    Parts of faces are not welded: it would take longer than all else.
    """
    if coarse:  # as coarse_cover
        whole = replace(spec, cuts=())
        few = coarse_mesh(cut_cover(mesh, whole))
        by_cuts, complete = _removed(few, CoverSpec("all", spec.cuts))
        return np.concatenate((_removed(mesh, whole)[0], by_cuts)), complete
    removed, complete, planes = [np.empty((0, 3, 3))], [], []
    seen = _seen(mesh, spec.shell)
    if seen is not mesh:
        removed.append(mesh.triangles[~visibility(mesh).seen])
    kept, of = seen, np.arange(len(seen.faces))
    for k, cut in enumerate(spec.cuts):
        point, normal = np.array(cut.point), np.array(cut.normal)
        vertices, faces, parts = one_side(kept, point, normal)
        if not len(faces):
            complete.append(k)
            continue
        corners, others, _ = one_side(kept, point, -normal)
        removed.append(corners[others])
        planes.append((point, normal))
        kept, of = TriangleMesh(vertices, faces), of[parts]
    if spec.shell == "outer":
        shell = np.unique(shells_after(mesh, planes)[of], return_inverse=True)[1]
        removed.append(kept.triangles[~are_outer(kept, shell)])
    return np.concatenate(removed).reshape(-1, 3).astype(np.float32), tuple(complete)


def _sections(mesh: TriangleMesh, points: Array, normals: Array) -> list[Array]:
    """Return the ends of the section of each plane, shape (2 s, 3) [m]; only planes that have moved are cut."""
    known = _known_sections(mesh)
    keys = [(*point, *normal) for point, normal in zip(points.tolist(), normals.tolist())]
    moved = [i for i, key in enumerate(keys) if key not in known]
    if len(known) + len(moved) > MAX_SECTIONS:
        known.clear()
        moved = list(range(len(keys)))
    if moved:
        sections = cut_sections(mesh, Planes(points[moved], normals[moved]))
        known.update({keys[i]: sections.ends[sections.plane == k].reshape(-1, 3) for k, i in enumerate(moved)})
    return [known[key] for key in keys]


@lru_cache(maxsize=4)
def _known_sections(mesh: TriangleMesh) -> dict[tuple[float, ...], Array]:
    """Return the sections of planes through a mesh that are known, by point and normal."""
    return {}


def _draw(sketch: Sketch, family: str, mesh: TriangleMesh, planes: HandPlanes, missing: str) -> None:
    """Draw the sections of a family of planes, and a square for each plane without a section."""
    points, normals = planes.points(family), unit(planes.normals(family))
    valid = [i for i in range(len(points)) if (family, i) not in sketch.wrong]
    if not valid:
        return
    sections, squares = _sections(mesh, points[valid], normals[valid]), []
    for ends, i in zip(sections, valid):
        if len(ends):
            sketch.arms[family, i], sketch.centres[family, i] = _arm(points[i], normals[i], ends), ends.mean(axis=0)
        else:
            gap = np.abs((mesh.vertices - points[i]) @ normals[i]).min()
            sketch.wrong[family, i] = f"{missing}; distance {gap * 1e3:.1f} mm"
            squares.append(_square(points[i], normals[i], SQUARE * mesh.size))
    sketch.layers.append(Layer("PLANES", np.concatenate(sections).astype(np.float32), colour=COLOURS[family]))
    if squares:
        sketch.layers.append(Layer("PLANES", np.concatenate(squares).astype(np.float32), colour=VERMILLION, width=2.0))


def _arm(point: Array, normal: Array, ends: Array) -> Array:
    """Return the vector (3,) from a plane's point to the outermost of ``ends`` (k, 3), equal in parallel planes [m]."""
    rim = ends[np.argmax(ends @ perpendicular(normal))]
    return rim - point - ((rim - point) @ normal) * normal


def _square(point: Array, normal: Array, half: float) -> Array:
    """Return the segments of a square in a plane, shape (8, 3)."""
    a = perpendicular(normal)
    b = np.cross(normal, a)
    corners = point + half * np.array((a + b, a - b, -a - b, b - a))
    return np.stack((corners, np.roll(corners, -1, axis=0)), axis=1).reshape(-1, 3)
