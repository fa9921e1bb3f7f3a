# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects to plans and arrays, and back. What leaves here is metres in the link frame.

The link frame is the place and turn of the object's parent, or the world where it has none: a link's mesh is placed
in its frame by the object's own location, rotation and scale. How the parent is posed does not alter a bit of it.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...common.arrays import Array, IntArray
from ...common.errors import CalibrationFormatError, InvalidMesh, InvalidPlan
from ...geometry.mesh.triangle_mesh import TriangleMesh
from ...geometry.mesh.units import UNITS
from ...pipeline import Calibrated
from ...plan import FORMAT, VERSION, Plan, check_plan, plan_from
from .decimals import exact, in_units, vector
from .facets import Facets
from .skins import set_skin, skin_document
from .warnings import write_warnings

# Blender's numbers are single; these are the largest it holds.
LARGEST_NUMBER, LARGEST_COUNT = 3e38, 2**31 - 1
# Columns of a parent's frame that differ in length, or lean, by more than this share are no rotation with a scale.
UNEVEN = 1e-4


def links(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Objects of the scene that have a link name, by name."""
    return sorted((o for o in context.scene.objects if o.type == "MESH" and o.skin_calib.link), key=lambda o: o.name)


def read_plan(link: bpy.types.Object, scene: bpy.types.Scene) -> Plan:
    """The plan in an object's properties.

    Raises
    ------
    CalibrationFormatError, InvalidPlan
        As for a plan file.
    """
    document = plan_document(link, scene)
    check_numbers(document)
    findings = check_plan(document)
    if findings:
        raise CalibrationFormatError(f"the plan of {link.name} is not valid: {findings[0]}", findings)
    return plan_from(document)


def plan_document(link: bpy.types.Object, scene: bpy.types.Scene) -> dict[str, Any]:
    """The plan in an object's properties as a document; its mesh is named, not written."""
    settings, metre = link.skin_calib, metres_per_unit(scene)
    document = {
        "format": FORMAT,
        "version": VERSION,
        "link": settings.link,
        "mesh": settings.mesh_file or f"{link.name}.ply",
        "unit": "m",
        "cover": {"shell": settings.cover.shell, "cuts": [_plane(cut, metre) for cut in settings.cover.cuts]},
        "grid": _grid(settings.grid, metre),
        "degree": [*settings.degree],
        "skins": [skin_document(skin, metre) for skin in settings.skins],
    }
    if settings.chords:
        document["chords"] = True
    if settings.response:
        document["response"] = {"kind": "polynomial", "coefficients": vector(c.value for c in settings.response)}
    return document | json.loads(settings.extra or "{}")


def _plane(plane: Any, metre: float) -> dict[str, Any]:
    return {"point": vector(plane.point, metre), "normal": vector(plane.normal)}


def _grid(grid: Any, metre: float) -> dict[str, Any]:
    if grid.kind == "planes":
        return {
            "kind": "planes",
            "u": [_plane(p, metre) for p in grid.u],
            "v": [_plane(p, metre) for p in grid.v],
            "closed": grid.closed,
        }
    axis = {"point": vector(grid.point, metre), "direction": vector(grid.direction)}
    document: dict[str, Any] = {"kind": "patch" if grid.kind in ("sector", "across") else grid.kind}
    document["axis"] = "auto" if grid.auto_axis else axis
    if not grid.auto_margin:
        document["margin"] = exact(grid.margin, metre)
    if grid.kind == "auto":
        document |= {"tolerance": exact(grid.tolerance, metre), "measure": grid.measure}
    else:
        document |= {"n": grid.n, "lines": grid.lines, "spacing": grid.spacing}
    region = grid.region if grid.kind == "auto" else grid.kind
    if region == "across":
        document["normal"] = vector(grid.normal)
    if region == "sector":
        document |= {"from": exact(grid.start), "to": exact(grid.stop)}
    return document


def write_plan(link: bpy.types.Object, scene: bpy.types.Scene, document: dict[str, Any]) -> None:
    """Set an object's properties from a plan document that :func:`check_numbers` lets pass; the mesh is not touched.

    Blender keeps seven digits; a number with more is rounded.
    """
    settings, metre = link.skin_calib, metres_per_unit(scene)
    settings.link, settings.mesh_file = document["link"], Path(document["mesh"]).name
    cover = document.get("cover", {})
    settings.cover.shell = cover.get("shell", "outer")
    _set_planes(settings.cover.cuts, cover.get("cuts", ()), metre)
    _set_grid(settings.grid, document["grid"], metre)
    settings.degree = document.get("degree", (3, 3))
    settings.chords = document.get("chords", False)
    settings.skins.clear()
    for skin in document["skins"]:
        set_skin(settings.skins.add(), skin, metre)
    settings.response.clear()
    response = document.get("response", {})
    is_plain = response.keys() <= {"kind", "coefficients"}
    for coefficient in response.get("coefficients", ()) if is_plain else ():
        settings.response.add().value = coefficient
    # A table or a range has no properties; it is kept as it came.
    extra = {k: v for k, v in document.items() if k.startswith("x_") or k == "response" and not is_plain}
    settings.extra = json.dumps(extra) if extra else ""


def check_numbers(part: Any, metre: float = 1.0) -> None:
    """Refuse a plan document with a number that is too large for Blender's properties, or not finite.

    Raises
    ------
    InvalidPlan
        Names the number.
    """
    if isinstance(part, dict):
        part = [value for name, value in part.items() if not name.startswith("x_")]
    largest = LARGEST_COUNT if isinstance(part, int) else LARGEST_NUMBER * min(metre, 1.0)
    if isinstance(part, list):
        for value in part:
            check_numbers(value, metre)
    elif isinstance(part, int | float) and not abs(part) <= largest:
        raise InvalidPlan(f"the plan holds {part}; Blender's properties keep numbers up to {largest:g}: change it")


def _set_planes(collection: Any, planes: Any, metre: float) -> None:
    collection.clear()
    for plane in planes:
        item = collection.add()
        item.point, item.normal = in_units(plane["point"], metre), plane["normal"]


def _set_grid(grid: Any, document: dict[str, Any], metre: float) -> None:
    kind = document["kind"]
    if kind == "planes":
        grid.kind, grid.closed = "planes", document["closed"]
        _set_planes(grid.u, document["u"], metre)
        _set_planes(grid.v, document["v"], metre)
        return
    grid.region = "across" if "normal" in document else "sector" if "from" in document else "tube"
    grid.kind = kind if kind != "patch" else grid.region
    axis = document.get("axis", "auto")
    grid.auto_axis = axis == "auto"
    if not grid.auto_axis:
        grid.point, grid.direction = in_units(axis["point"], metre), axis["direction"]
    grid.auto_margin = "margin" not in document
    if not grid.auto_margin:
        grid.margin = document["margin"] / metre
    if kind == "auto":
        grid.tolerance, grid.measure = document["tolerance"] / metre, document.get("measure", "mean")
    else:
        grid.n = document["n"]
        grid.lines = document.get("lines", document.get("m", 0) * (2 if kind == "tube" else 1))
        grid.spacing = document.get("spacing", "auto")
    if grid.region == "sector":
        grid.start, grid.stop = document["from"], document["to"]
    if grid.region == "across":
        grid.normal = document["normal"]


def read_mesh(link: bpy.types.Object, context: bpy.types.Context) -> TriangleMesh:
    """The object's mesh with its modifiers, in metres in the link frame.

    Raises
    ------
    InvalidMesh
        As :func:`read_facets` and :meth:`Facets.mesh` do.
    """
    return read_facets(link, context).mesh()


def read_facets(link: bpy.types.Object, context: bpy.types.Context) -> Facets:
    """The object's triangles with its modifiers, and where they lie.

    Raises
    ------
    InvalidMesh
        If the object is switched off so that its modifiers do not count, or its parent's scale leaves no frame to
        measure in.
    """
    evaluated = link.evaluated_get(context.evaluated_depsgraph_get())
    if not evaluated.is_evaluated and link.modifiers:
        raise InvalidMesh(f"{link.name} is switched off in the viewport, so its modifiers do not count; switch it on")
    unit = metres_per_unit(context.scene) * _scale(link)
    data = evaluated.to_mesh()
    try:
        data.calc_loop_triangles()
        vertices = np.empty(len(data.vertices) * 3, np.float32)
        data.vertices.foreach_get("co", vertices)
        faces = np.empty(len(data.loop_triangles) * 3, np.int32)
        data.loop_triangles.foreach_get("vertices", faces)
    finally:
        evaluated.to_mesh_clear()
    placed = np.array([vector(row, unit) for row in _local(link)[:3]])
    return Facets(link.name, vertices.reshape(-1, 3), faces.reshape(-1, 3), placed)


def read_edges(link: bpy.types.Object, context: bpy.types.Context) -> tuple[Array, IntArray]:
    """Vertices (v, 3) [m] in the link frame and edges (e, 2) of the object without its modifiers.

    A vertex that no modifier moves has the same bits as in :func:`read_facets`, which raises what this raises.
    """
    vertices = np.empty(len(link.data.vertices) * 3, np.float32)
    link.data.vertices.foreach_get("co", vertices)
    edges = np.empty(len(link.data.edges) * 2, np.int32)
    link.data.edges.foreach_get("vertices", edges)
    placed = replace(read_facets(link, context), vertices=vertices.reshape(-1, 3))
    return placed.triangles()[0], edges.reshape(-1, 2)


def _local(link: bpy.types.Object) -> Matrix:
    """From the object to its parent, in Blender units; no rounding of the parent's pose is in it."""
    if link.constraints or (link.parent and link.parent_type != "OBJECT"):
        return link.matrix_local
    return link.matrix_parent_inverse @ link.matrix_basis if link.parent else link.matrix_basis


def _scale(link: bpy.types.Object) -> float:
    """How many times the parent enlarges its children."""
    if link.parent is None:
        return 1.0
    axes = np.array(_parent(link).to_3x3())
    scale = np.cbrt(np.linalg.det(axes))
    if scale <= 0 or np.abs(axes.T @ axes - scale**2 * np.eye(3)).max() > UNEVEN * scale**2:
        raise InvalidMesh(
            f"{link.parent.name}, the parent of {link.name} and so its link frame, is mirrored or scaled unevenly; "
            "apply its scale"
        )
    return float(f"{scale:.6g}")  # single-precision noise of a turned frame ends here


def _parent(link: bpy.types.Object) -> Matrix:
    return link.matrix_world @ _local(link).inverted_safe()


def link_frame(link: bpy.types.Object) -> Matrix:
    """The link frame in the world, a rotation and a place in Blender units."""
    if link.parent is None:
        return Matrix.Identity(4)
    place, turn, _ = _parent(link).decompose()
    return Matrix.LocRotScale(place, turn, None)


def cursor_on(link: bpy.types.Object, scene: bpy.types.Scene) -> Vector:
    """The 3D cursor in the link frame, in Blender units."""
    return link_frame(link).inverted() @ scene.cursor.location


def check_seen(link: bpy.types.Object) -> None:
    """Refuse an object that rays do not meet.

    Raises
    ------
    InvalidMesh
        Says how to make it seen.
    """
    if link.mode == "EDIT":
        raise InvalidMesh(f"{link.name} is being edited; leave Edit Mode to click on it")
    if not link.visible_get():
        raise InvalidMesh(f"{link.name} is hidden; show it to click on it")


def point_on(link: bpy.types.Object, depsgraph: bpy.types.Depsgraph, start: Vector, way: Vector) -> Vector | None:
    """Where a ray in the world first meets the object, in the link frame in Blender units; None where it does not."""
    met = met_by(link, depsgraph, start, way)
    return met[0] if met else None


def met_by(
    link: bpy.types.Object, depsgraph: bpy.types.Depsgraph, start: Vector, way: Vector
) -> tuple[Vector, Vector] | None:
    """The same point, and the unit normal of the face there, on the side from which the ray comes."""
    to_world, to_frame = link.matrix_world, link_frame(link).inverted()
    local = to_world.inverted_safe()
    met, place, normal, _ = link.evaluated_get(depsgraph).ray_cast(local @ start, local.to_3x3() @ way)
    if not met:
        return None
    upright = to_frame.to_3x3() @ (local.to_3x3().transposed() @ normal)
    upright = upright.normalized() * (-1 if upright.dot(to_frame.to_3x3() @ way) > 0 else 1)
    return to_frame @ (to_world @ place), upright


def metres_per_unit(scene: bpy.types.Scene) -> float:
    """Length of one Blender unit [m]."""
    return exact(scene.unit_settings.scale_length)


def add_link(context: bpy.types.Context, mesh: TriangleMesh, unit: str, name: str) -> bpy.types.Object:
    """A new object in the scene for a mesh whose numbers are in ``unit``; they are kept, the object is scaled."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(mesh.vertices.tolist(), [], mesh.faces.tolist())
    data.update()
    link = bpy.data.objects.new(name, data)
    factor = UNITS[unit] / metres_per_unit(context.scene)
    link.scale = (factor, factor, factor)
    context.scene.collection.objects.link(link)
    return link


def activate(context: bpy.types.Context, link: bpy.types.Object) -> None:
    """Make an object the active one, in Object Mode, and the only one that is selected."""
    if context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    for other in context.selected_objects:
        other.select_set(False)
    link.select_set(True)
    context.view_layer.objects.active = link


def longest_side(link: bpy.types.Object, scene: bpy.types.Scene) -> float:
    """Longest side of the object's box as it stands in the scene [m]; Blender keeps it."""
    return max(link.dimensions) * metres_per_unit(scene)


def write_result(link: bpy.types.Object, scene: bpy.types.Scene, result: Calibrated, key: str) -> None:
    """Keep the figures of a fit on its object."""
    record, errors = link.skin_calib.result, result.fit.errors
    record.key, record.outdated = key, False
    metre = metres_per_unit(scene)
    record.mean, record.max = errors.surface_to_mesh.mean / metre, errors.surface_to_mesh.max / metre
    record.hausdorff = errors.hausdorff / metre
    record.control_points = int(np.prod(result.fit.lines.origins.shape[:2]))
    record.taxels = sum(len(p.taxels.ids) for p in result.calibration.patches)
    record.seconds = sum(result.seconds.values())
    write_warnings(record.warnings, result.warnings)


def why_no_link(context: bpy.types.Context, named: bool = True) -> str:
    """Why the active object is no link that one can work on, and what to do; empty if it is one."""
    return why_not(context.object, named)


def why_not(link: bpy.types.Object | None, named: bool = True) -> str:
    """Why an object is no link that one can work on, and what to do; empty if it is one."""
    if link is None or link.type != "MESH":
        return "Select the mesh object of a link"
    if link.library or link.override_library:
        return "This link belongs to another file; open that file, or make the object local"
    if named and not link.skin_calib.link:
        return "Give the object a link name first"
    return ""


def why_not_editable(link: bpy.types.Object) -> str:
    """Why the mesh of an object cannot be edited, and what to do; empty if it can."""
    return "The mesh of this link belongs to another file; make it local" if link.data.library else ""
