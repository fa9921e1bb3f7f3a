# SPDX-License-Identifier: GPL-3.0-or-later
"""From objects to plans and arrays, and back; plans and arrays are in metres in the link frame.

The link frame is the pose of the object's parent, or the world where it has none. The object's own location, rotation
and scale place the mesh in that frame; they are independent of the pose of the parent. A link of a URDF is different:
the URDF places its mesh in the link frame, so that the object is the frame and can be moved.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...calibration.modality import modality_document, modality_from
from ...calibration.response import AnyResponse, Response, response_document, response_from
from ...common.arrays import Array, IntArray
from ...common.errors import InvalidMesh, InvalidPlan
from ...geometry import Grid, PlanesGrid
from ...geometry.mesh.triangle_mesh import TriangleMesh
from ...geometry.mesh.units import UNITS
from ...pipeline import Calibrated
from ...plan import Plan
from ...plan.checks import check_together
from ...plan.document import grid_kind, without_axis_point
from ...plan.document import read as read_document
from ...plan.document import write as write_document
from ...plan.key import Key, Record
from ...plan.keys import COVER, GRIDS, LINK, SURFACE
from ...plan.plan import Surface
from .decimals import exact, vector
from .facets import Facets
from .fields import OWN, read, read_key, write, write_key
from .skins import read_skin, seen_from, write_skin
from .warnings import write_warnings

# Largest numbers of Blender's properties, which have single precision and 32 bits.
LARGEST_NUMBER, LARGEST_COUNT = 3e38, 2**31 - 1
# Deviation of a parent's matrix from a rotation with one scale, relative to the scale, above which it is refused.
MAX_FRAME_DEVIATION = 1e-4


def links(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return the objects of the scene that have a link name, sorted by name."""
    return sorted((o for o in context.scene.objects if o.type == "MESH" and o.skin_calib.link), key=lambda o: o.name)


def namesakes(link: bpy.types.Object, scene: bpy.types.Scene) -> list[str]:
    """Return the names of the other objects with the same link name, such as copies.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    scene : Scene
        Has the other objects.
    """
    name = link.skin_calib.link
    return [o.name for o in scene.objects if name and o != link and o.type == "MESH" and o.skin_calib.link == name]


def read_plan(link: bpy.types.Object, scene: bpy.types.Scene) -> Plan:
    """Return the plan in an object's properties; its mesh has a name there, and is not read.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    scene : Scene
        Its unit settings give the length of a scene unit.

    Returns
    -------
    Plan
        In metres in the link frame.

    Raises
    ------
    InvalidPlan
        If a value is beyond its limits, or members contradict each other; names them as the window does.
    """
    settings, metre = link.skin_calib, metres_per_unit(scene)
    extra = json.loads(settings.extra or "{}")
    try:
        plan = Plan(
            link=read_key(LINK, settings, metre),
            mesh=Path(settings.mesh_file or f"{link.name}.ply"),
            unit="m",
            surfaces=read_surfaces(settings, metre),
            skins=tuple(read_skin(skin, metre) for skin in settings.skins),
            response=_read_response(settings, extra.pop("response", None)),
            modalities=tuple(modality_from(modality) for modality in extra.pop("modalities", ())),
            extra=extra,
        )
        check_together(plan)
    except InvalidPlan as error:
        raise InvalidPlan(f"{link.name}: {error}", **error.numbers) from error
    return plan


def write_plan(link: bpy.types.Object, scene: bpy.types.Scene, plan: Plan) -> None:
    """Set an object's properties from a plan that :func:`check_numbers` accepts; the mesh stays as it is.

    Blender keeps seven digits; a number with more is rounded.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    scene : Scene
        Its unit settings give the length of a scene unit.
    plan : Plan
        In metres in the link frame. Files of skins have absolute paths, or paths from the current folder.
    """
    settings, metre = link.skin_calib, metres_per_unit(scene)
    write_key(LINK, settings, plan.link, metre)
    settings.mesh_file = plan.mesh.name
    write_surfaces(settings, plan.surfaces, 0, metre)
    settings.skins.clear()
    for skin in plan.skins:
        write_skin(skin, settings.skins.add(), metre)
    extra = dict(plan.extra)
    settings.response.clear()
    if isinstance(plan.response, Response) and plan.response.range is None:
        for coefficient in plan.response.coefficients if plan.response != Response() else ():
            settings.response.add().value = coefficient
    else:  # no property has a table or a range
        extra["response"] = response_document(plan.response)
    if plan.modalities:  # no property has them
        extra["modalities"] = [modality_document(modality) for modality in plan.modalities]
    settings.extra = json.dumps(extra) if extra else ""


def is_kept(plan: Plan, kept: Plan) -> bool:
    """Return whether properties have all numbers of a plan whose digits they can round.

    Parameters
    ----------
    plan : Plan
        That was written to the properties.
    kept : Plan
        That was read from them.

    Returns
    -------
    bool
        Whether cover, grid, skins and response are equal.
    """
    skins = seen_from(Path(), plan.skins), seen_from(Path(), kept.skins)
    surfaces = ([(s.cover, s.grid) for s in each.surfaces] for each in (plan, kept))
    return skins[0] == skins[1] and plan.response == kept.response and next(surfaces) == next(surfaces)


def is_simple(key: Key) -> bool:
    """Return whether a key of the plan is one property of the link."""
    return bool(key.path and key.label) and key.type.kind not in OWN


def read_surfaces(settings: Any, metre: float) -> tuple[Surface, ...]:
    """Return the surfaces of a link: the one in its properties, and the others, which are kept as JSON.

    Parameters
    ----------
    settings : SKIN_PG_link
        In scene units in the link frame.
    metre : float
        Length of a scene unit [m].

    Returns
    -------
    tuple of Surface
        In metres in the link frame, in the order of the plan.

    Raises
    ------
    InvalidPlan
        If a value is beyond its limits; the message names it as the window does.
    """
    kept = json.loads(settings.other_surfaces or "[null]")
    return tuple(_shown(settings, metre) if other is None else read_document(SURFACE, other) for other in kept)


def shown_surface(link: bpy.types.Object, scene: bpy.types.Scene) -> Surface:
    """Return the surface that the properties of an object have.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    scene : Scene
        Its unit settings give the length of a scene unit.

    Returns
    -------
    Surface
        In metres in the link frame.

    Raises
    ------
    InvalidPlan
        As :func:`read_plan`.
    """
    return read_plan(link, scene).surfaces[shown_index(link.skin_calib)]


def shown_index(settings: Any) -> int:
    """Return which of the surfaces of a link its properties have, from 0."""
    return json.loads(settings.other_surfaces or "[null]").index(None)


def surface_names(settings: Any) -> list[str]:
    """Return the names of the surfaces of a link, in the order of the plan."""
    kept = json.loads(settings.other_surfaces or "[null]")
    return [settings.surface_name if other is None else other["name"] for other in kept]


def _shown(settings: Any, metre: float) -> Surface:
    simple = {key.path: read_key(key, settings, metre) for key in SURFACE.keys if is_simple(key)}
    return Surface(cover=read(COVER, settings.cover, metre), grid=read_grid(settings.grid, metre), **simple)


def write_surfaces(settings: Any, surfaces: Sequence[Surface], shown: int, metre: float) -> None:
    """Set the properties of a link to one surface, and keep the others as JSON.

    Parameters
    ----------
    settings : SKIN_PG_link
        Set in scene units.
    surfaces : sequence of Surface
        In metres in the link frame, in the order of the plan.
    shown : int
        Which of them the properties have.
    metre : float
        Length of a scene unit [m].
    """
    surface = surfaces[shown]
    for key in SURFACE.keys:
        if is_simple(key):
            write_key(key, settings, getattr(surface, key.path), metre)
    write(COVER, surface.cover, settings.cover, metre)
    write_grid(settings.grid, surface.grid, metre)
    kept = [None if k == shown else write_document(SURFACE, other) for k, other in enumerate(surfaces)]
    settings.other_surfaces = json.dumps(kept) if len(kept) > 1 else ""


def read_grid(group: Any, metre: float) -> Grid | PlanesGrid:
    """Return the grid in a group of properties.

    Parameters
    ----------
    group : SKIN_PG_grid
        In scene units in the link frame.
    metre : float
        Length of a scene unit [m].

    Returns
    -------
    Grid or PlanesGrid
        In metres in the link frame.

    Raises
    ------
    InvalidPlan
        If a value is beyond its limits; the message names it as the window does.
    """
    grid: Grid | PlanesGrid = read(record_of(group), group, metre)
    return without_axis_point(grid) if group.kind == "across" else grid


def record_of(group: Any) -> Record:
    """Return the record of the kind and the region that the properties of a grid name."""
    return GRIDS[group.kind, {"auto": group.region, "planes": ""}.get(group.kind, group.kind)]


def write_grid(group: Any, grid: Grid | PlanesGrid, metre: float) -> None:
    """Set a group of properties from a grid.

    Parameters
    ----------
    group : SKIN_PG_grid
        Set in scene units.
    grid : Grid or PlanesGrid
        In metres in the link frame.
    metre : float
        Length of a scene unit [m].
    """
    group.kind, region = grid_kind(grid)
    if region:
        group.region = region
    write(GRIDS[group.kind, region], grid, group, metre)


def _read_response(settings: Any, kept: Any) -> AnyResponse:
    """Return the response: kept as JSON, as a polynomial in the properties, or readings in newtons."""
    if kept is not None:
        return response_from(kept)
    coefficients = tuple(vector(c.value for c in settings.response))
    if not all(map(np.isfinite, coefficients)):
        raise InvalidPlan("Response: must have finite numbers.")
    return Response(coefficients) if coefficients else Response()


def check_numbers(plan: Plan, metre: float = 1.0) -> None:
    """Refuse a plan with a number that is too large for Blender's properties, or not finite.

    Parameters
    ----------
    plan : Plan
        In metres in the link frame.
    metre : float, optional
        Length of a scene unit [m].

    Raises
    ------
    InvalidPlan
        Names the number.
    """
    for number in numbers_of(plan):
        largest = LARGEST_COUNT if isinstance(number, int) else LARGEST_NUMBER * min(metre, 1.0)
        if not abs(number) <= largest:
            raise InvalidPlan(f"The plan has the number {number}. Blender keeps numbers up to {largest:g}; change it.")


def numbers_of(part: Any) -> Iterator[float]:
    """Return all numbers in a frozen record and the records in it."""
    if is_dataclass(part):
        part = tuple(getattr(part, f.name) for f in fields(part))
    if isinstance(part, np.ndarray):
        part = tuple(part.ravel().tolist())
    if isinstance(part, tuple):
        for item in part:
            yield from numbers_of(item)
    elif isinstance(part, int | float):
        yield part


def read_mesh(link: bpy.types.Object, context: bpy.types.Context) -> TriangleMesh:
    """Return the object's mesh with its modifiers, in metres in the link frame.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    context : Context
        Has the evaluated scene.

    Returns
    -------
    TriangleMesh
        In metres in the link frame.

    Raises
    ------
    InvalidMesh
        As :func:`read_facets` and :meth:`Facets.mesh`.
    """
    return read_facets(link, context).mesh()


def read_facets(link: bpy.types.Object, context: bpy.types.Context, before: Facets | None = None) -> Facets:
    """Return the object's triangles with its modifiers, and their transformation into the link frame.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    context : Context
        Has the evaluated scene.
    before : Facets, optional
        Of the same object. They are returned if nothing has changed: triangles take most of the time.

    Returns
    -------
    Facets
        Vertices in the axes and units of the object.

    Raises
    ------
    InvalidMesh
        If the object is disabled, so that its modifiers are not evaluated, or its parent's scale is not uniform.
    """
    evaluated = link.evaluated_get(context.evaluated_depsgraph_get())
    if not evaluated.is_evaluated and link.modifiers:
        raise InvalidMesh(f"{link.name} is disabled in the viewport, so its modifiers are not evaluated. Enable it.")
    unit = metres_per_unit(context.scene) * _scale(link)
    placed = np.array([vector(row, unit) for row in _local(link)[:3]])
    data = evaluated.to_mesh()
    try:
        vertices = np.empty((len(data.vertices), 3), np.float32)
        corners = np.empty(len(data.loops), np.int32)
        if len(corners):  # attributes are read thirty times faster than vertices and loops
            data.attributes["position"].data.foreach_get("vector", vertices.ravel())
            data.attributes[".corner_vert"].data.foreach_get("value", corners)
        data.calc_loop_triangles()
        polygons = np.empty(len(data.loop_triangles), np.int32)  # read thirty times faster than where polygons start
        data.loop_triangle_polygons.foreach_get("value", polygons)
        found = Facets(link.name, vertices, np.empty((0, 3), np.int32), placed, corners, polygons)
        if before is not None and before.name == link.name and found.is_same(before):
            return before
        faces = np.empty((len(data.loop_triangles), 3), np.int32)
        data.loop_triangles.foreach_get("vertices", faces.ravel())
    finally:
        evaluated.to_mesh_clear()
    return replace(found, faces=faces)


def read_edges(link: bpy.types.Object, context: bpy.types.Context) -> tuple[Array, IntArray]:
    """Return vertices and edges of the object without its modifiers.

    A vertex that no modifier moves has exactly the coordinates of :func:`read_facets`.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    context : Context
        Has the evaluated scene.

    Returns
    -------
    vertices : array, shape (v, 3)
        [m], link frame.
    edges : array of int, shape (e, 2)
        Indices of vertices.

    Raises
    ------
    InvalidMesh
        As :func:`read_facets`.
    """
    vertices = np.empty(len(link.data.vertices) * 3, np.float32)
    link.data.vertices.foreach_get("co", vertices)
    edges = np.empty(len(link.data.edges) * 2, np.int32)
    link.data.edges.foreach_get("vertices", edges)
    placed = replace(read_facets(link, context), vertices=vertices.reshape(-1, 3))
    return placed.triangles()[0], edges.reshape(-1, 2)


def _local(link: bpy.types.Object) -> Matrix:
    """Return the matrix from the object to its parent, in scene units, without rounding by the parent's pose."""
    if link.skin_calib.urdf:
        return Matrix.Diagonal((*link.scale, 1))
    if link.constraints or (link.parent and link.parent_type != "OBJECT"):
        return link.matrix_local
    return link.matrix_parent_inverse @ link.matrix_basis if link.parent else link.matrix_basis


def _scale(link: bpy.types.Object) -> float:
    """Return the scale of the parent."""
    if link.parent is None:
        return 1.0
    axes = np.array(_parent(link).to_3x3())
    scale = np.cbrt(np.linalg.det(axes))
    if scale <= 0 or np.abs(axes.T @ axes - scale**2 * np.eye(3)).max() > MAX_FRAME_DEVIATION * scale**2:
        raise InvalidMesh(
            f"{link.parent.name}, the parent of {link.name} and so its link frame, is mirrored or has a scale that is "
            "not uniform. Apply its scale."
        )
    return float(f"{scale:.6g}")  # without the single-precision noise of a rotated frame


def _parent(link: bpy.types.Object) -> Matrix:
    return link.matrix_world @ _local(link).inverted_safe()


def link_frame(link: bpy.types.Object) -> Matrix:
    """Return the link frame in the world: a rotation, and a translation in scene units."""
    if link.parent is None and not link.skin_calib.urdf:
        return Matrix.Identity(4)
    location, rotation, _ = _parent(link).decompose()
    return Matrix.LocRotScale(location, rotation, None)


def cursor_on(link: bpy.types.Object, scene: bpy.types.Scene) -> Vector:
    """Return the 3D cursor in the link frame.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    scene : Scene
        Has the cursor.

    Returns
    -------
    Vector, length 3
        Link frame, in scene units.
    """
    return link_frame(link).inverted() @ scene.cursor.location


def check_seen(link: bpy.types.Object) -> None:
    """Refuse an object that rays do not hit.

    Raises
    ------
    InvalidMesh
        Says how to make it visible.
    """
    if link.mode == "EDIT":
        raise InvalidMesh(f"{link.name} is in Edit Mode. Leave Edit Mode to click on it.")
    if not link.visible_get():
        raise InvalidMesh(f"{link.name} is hidden. Show it to click on it.")


def point_on(link: bpy.types.Object, depsgraph: bpy.types.Depsgraph, start: Vector, direction: Vector) -> Vector | None:
    """Return where a ray first hits the object.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    depsgraph : Depsgraph
        Evaluates the modifiers of the object.
    start : Vector, length 3
        Of the ray, in the world, in scene units.
    direction : Vector, length 3
        Of the ray, in the world, of any length.

    Returns
    -------
    Vector of length 3, or None
        Link frame, in scene units; None if the ray misses.
    """
    met = met_by(link, depsgraph, start, direction)
    return met[0] if met else None


def met_by(
    link: bpy.types.Object, depsgraph: bpy.types.Depsgraph, start: Vector, direction: Vector
) -> tuple[Vector, Vector] | None:
    """Return where a ray first hits the object, and the unit normal of the face there.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    depsgraph : Depsgraph
        Evaluates the modifiers of the object.
    start : Vector, length 3
        Of the ray, in the world, in scene units.
    direction : Vector, length 3
        Of the ray, in the world, of any length.

    Returns
    -------
    point : Vector, length 3
        Link frame, in scene units.
    normal : Vector, length 3
        Link frame, unit length, on the side of the start of the ray. None instead of the pair if the ray misses.
    """
    to_world, to_frame = link.matrix_world, link_frame(link).inverted()
    local = to_world.inverted_safe()
    met, point, normal, _ = link.evaluated_get(depsgraph).ray_cast(local @ start, local.to_3x3() @ direction)
    if not met:
        return None
    upright = to_frame.to_3x3() @ (local.to_3x3().transposed() @ normal)
    upright = upright.normalized() * (-1 if upright.dot(to_frame.to_3x3() @ direction) > 0 else 1)
    return to_frame @ (to_world @ point), upright


def metres_per_unit(scene: bpy.types.Scene) -> float:
    """Return the length of one scene unit [m]."""
    return exact(scene.unit_settings.scale_length)


def add_link(context: bpy.types.Context, mesh: TriangleMesh, unit: str, name: str) -> bpy.types.Object:
    """Return a new object for a mesh; its data keeps the numbers, and its scale converts their unit.

    Parameters
    ----------
    context : Context
        Has the scene.
    mesh : TriangleMesh
        In ``unit``.
    unit : "m", "cm", "mm" or "in"
        Of the numbers in the mesh.
    name : str
        Of the object and its data.

    Returns
    -------
    Object
        Linked to the collection of the scene.
    """
    data = bpy.data.meshes.new(name)
    data.vertices.add(len(mesh.vertices))  # as from_pydata, which is slow for a million faces
    data.vertices.foreach_set("co", mesh.vertices.astype(np.float32).ravel())
    data.loops.add(3 * len(mesh.faces))
    data.loops.foreach_set("vertex_index", mesh.faces.astype(np.int32).ravel())
    data.polygons.add(len(mesh.faces))
    data.polygons.foreach_set("loop_start", np.arange(0, 3 * len(mesh.faces), 3, dtype=np.int32))
    data.shade_flat()
    data.update(calc_edges=True)
    link = bpy.data.objects.new(name, data)
    factor = UNITS[unit] / metres_per_unit(context.scene)
    link.scale = (factor, factor, factor)
    context.scene.collection.objects.link(link)
    return link


def activate(context: bpy.types.Context, link: bpy.types.Object) -> None:
    """Make an object the active and only selected one, in Object Mode.

    Parameters
    ----------
    context : Context
        Has the view layer.
    link : Object
        The object to activate.
    """
    if context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    for other in context.selected_objects:
        other.select_set(False)
    link.select_set(True)
    context.view_layer.objects.active = link


def longest_side(link: bpy.types.Object, scene: bpy.types.Scene) -> float:
    """Return the longest side of the object's box in the scene, from Blender's cache.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    scene : Scene
        Its unit settings give the length of a scene unit.

    Returns
    -------
    float
        [m]
    """
    return max(link.dimensions) * metres_per_unit(scene)


def write_result(link: bpy.types.Object, scene: bpy.types.Scene, result: Calibrated, key: str) -> None:
    """Store the figures of a fit on its object.

    Parameters
    ----------
    link : Object
        Mesh object of the link.
    scene : Scene
        Its unit settings give the length of a scene unit.
    result : Calibrated
        In metres in the link frame.
    key : str
        Of the result in the cache.
    """
    record, fits = link.skin_calib.result, tuple(result.fits.values())
    to_mesh = [fit.errors.surface_to_mesh for fit in fits]
    record.key, record.outdated = key, False
    metre = metres_per_unit(scene)
    record.mean, record.max = max(d.mean for d in to_mesh) / metre, max(d.max for d in to_mesh) / metre
    record.hausdorff = max(fit.errors.hausdorff for fit in fits) / metre
    record.control_points = sum(fit.offsets.size for fit in fits)
    record.taxels = sum(len(p.taxels.ids) for p in result.calibration.patches)
    record.seconds = sum(result.seconds.values())
    write_warnings(record.warnings, result.warnings)
    link.skin_calib.steps.advance()
    record.warning_index, link.skin_calib.inspect.marked_place = 0, ""


def why_no_link(context: bpy.types.Context, named: bool = True) -> str:
    """Return why the active object is not an editable link, and what to do; empty if it is one.

    Parameters
    ----------
    context : Context
        Has the active object.
    named : bool, optional
        Whether the link must have a name.

    Returns
    -------
    str
    """
    return why_not(context.object, named)


def why_not(link: bpy.types.Object | None, named: bool = True) -> str:
    """Return why an object is not an editable link, and what to do; empty if it is one.

    Parameters
    ----------
    link : Object or None
        The object; None if no object is active.
    named : bool, optional
        Whether the link must have a name.

    Returns
    -------
    str
    """
    if link is None or link.type != "MESH":
        return "Select the mesh object of a link"
    if link.library or link.override_library:
        return "This link belongs to another file; open that file, or make the object local"
    if named and not link.skin_calib.link:
        return "Give the object a link name first"
    return ""


def why_not_editable(link: bpy.types.Object) -> str:
    """Return why the mesh of an object cannot be edited, and what to do; empty if it can."""
    return "The mesh of this link belongs to another file; make it local" if link.data.library else ""
