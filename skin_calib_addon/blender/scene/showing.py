# SPDX-License-Identifier: GPL-3.0-or-later
"""Show links, and places on them, in the 3D views next to the sidebar; new links alone where other objects overlap."""

from collections.abc import Iterator, Sequence

import bpy
import numpy as np
from mathutils import Vector

from . import link_meshes
from .link_objects import activate
from .units import metres_per_unit

SOLID = ("MESH", "CURVE", "SURFACE", "META", "FONT")  # types of objects that can hide a link
# [fraction of the longest side] Distance from a link at which a ray to the eye starts. Larger: thin parts over a place
# do not hide it; smaller: rounding lets the face of a place hide it.
START_OF_RAY = 1e-3


def present(context: bpy.types.Context, things: Sequence[bpy.types.Object]) -> str:
    """Select new objects and show them; in local view if others overlap them."""
    meshes = [thing for thing in things if thing.type == "MESH"]
    activate(context, meshes[0])
    context.view_layer.update()  # places new objects
    hidden = overlapping(context, things)
    for thing in things:
        thing.select_set(True)
    for area, region in views(context):
        with context.temp_override(area=area, region=region):
            if area.spaces.active.local_view is not None:
                bpy.ops.view3d.localview(frame_selected=False)
            if hidden:
                bpy.ops.view3d.localview(frame_selected=False)
    for thing in things:
        thing.select_set(thing in meshes)
    frame(context)
    activate(context, meshes[0])
    if not hidden:
        return ""
    others = f" and {len(hidden) - 1} more" if len(hidden) > 1 else ""
    return f"Local view hides {hidden[0]}{others}: View > Local View shows all"


def overlapping(context: bpy.types.Context, things: Sequence[bpy.types.Object]) -> list[str]:
    """Return the names of visible objects whose boxes in the world overlap those of some meshes."""
    boxes = [_box(thing) for thing in things if thing.type == "MESH"]
    others = [o for o in context.view_layer.objects if o not in things and o.type in SOLID and o.visible_get()]
    return [o.name for o in others if any(_overlap(_box(o), box) for box in boxes)]


def _box(thing: bpy.types.Object) -> np.ndarray:
    """Return the least and the largest coordinates of an object in the world, shape (2, 3)."""
    corners = np.array([thing.matrix_world @ Vector(corner) for corner in thing.bound_box])
    return np.stack((corners.min(axis=0), corners.max(axis=0)))


def _overlap(a: np.ndarray, b: np.ndarray) -> bool:
    return bool((np.maximum(a[0], b[0]) <= np.minimum(a[1], b[1])).all())


def views(context: bpy.types.Context) -> Iterator[tuple[bpy.types.Area, bpy.types.Region]]:
    """Yield the 3D views of the window, each with its main region."""
    for area in context.window.screen.areas if context.window else ():
        if area.type == "VIEW_3D":
            yield area, next(region for region in area.regions if region.type == "WINDOW")


def frame(context: bpy.types.Context) -> None:
    """Move the 3D views of the window so that they show what is selected, next to the sidebar."""
    for area, region in views(context):
        with context.temp_override(area=area, region=region):
            _frame(area, region, context.preferences.system.use_region_overlap)


def _frame(area: bpy.types.Area, region: bpy.types.Region, is_overlapped: bool) -> None:
    view = area.spaces.active.region_3d
    scale = _scale(view)
    bpy.ops.view3d.view_selected()
    side = _sidebar(area, region, is_overlapped)
    view.view_distance *= min(region.width, region.height) / min(region.width - side, region.height)
    _center(view, view.view_location.copy(), side / region.width / scale)


def _sidebar(area: bpy.types.Area, region: bpy.types.Region, is_overlapped: bool) -> int:
    """Return the width of the sidebar where it covers a part of the view [pixel]; 0 if it does not."""
    side = next(part.width for part in area.regions if part.type == "UI")
    return side if is_overlapped and 1 < side < region.width else 0  # a closed sidebar is one pixel wide


def _scale(view: bpy.types.RegionView3D) -> float:
    """Return half the width of a view divided into its distance; Blender has it since the view was drawn."""
    return view.window_matrix[0][0] * (1.0 if view.is_perspective else view.view_distance)


def _center(view: bpy.types.RegionView3D, place: Vector, shift: float) -> None:
    """Move a view so that it shows a place to the left of its middle, by a fraction of its distance."""
    view.view_location = place + view.view_rotation @ Vector((shift * view.view_distance, 0, 0))


def show_place(context: bpy.types.Context, link: bpy.types.Object, point: Sequence[float]) -> None:
    """Move the 3D cursor to a place of a link, and the view so that the place is in its middle, next to the sidebar.

    If a mesh hides the place, the view turns to the outward normal of the nearest face. Its distance stays.
    """
    place = link_meshes.link_frame(link) @ (Vector(point) / metres_per_unit(context.scene))
    context.scene.cursor.location = place
    view = context.region_data or getattr(context.space_data, "region_3d", None)  # a sidebar has no region data
    if view is None:
        return
    region = next(part for part in context.area.regions if part.type == "WINDOW")
    side = _sidebar(context.area, region, context.preferences.system.use_region_overlap)
    shift = side / region.width / _scale(view)
    _center(view, place, shift)
    if not link.visible_get(viewport=context.space_data):
        return
    found, outward = _over_face(context, link, place)
    if _is_hidden(context, found, _to_eye(view, found)):
        view.is_orthographic_side_view = False
        view.view_rotation = outward.to_track_quat("Z", "Y")  # the z-axis of the world stays upright
        _center(view, place, shift)


def _over_face(context: bpy.types.Context, link: bpy.types.Object, place: Vector) -> tuple[Vector, Vector]:
    """Return the point just over the face that is nearest to a place, and the normal of the face; in the world."""
    to_world = link.matrix_world
    _, nearest, normal, _ = link.closest_point_on_mesh(
        to_world.inverted_safe() @ place, depsgraph=context.evaluated_depsgraph_get()
    )
    outward = (to_world.to_3x3().inverted_safe().transposed() @ normal).normalized()
    return to_world @ nearest + START_OF_RAY * max(link.dimensions) * outward, outward


def _to_eye(view: bpy.types.RegionView3D, place: Vector) -> Vector:
    """Return the direction from a place to the eye of a view, in the world."""
    axis = view.view_rotation @ Vector((0, 0, 1))
    return (view.view_location + view.view_distance * axis - place).normalized() if view.is_perspective else axis


def _is_hidden(context: bpy.types.Context, place: Vector, to_eye: Vector) -> bool:
    """Return whether a mesh that the view shows is between a place and the eye."""
    depsgraph = context.evaluated_depsgraph_get()
    for thing in context.view_layer.objects:
        if thing.type != "MESH" or not thing.visible_get(viewport=context.space_data):
            continue
        from_world = thing.matrix_world.inverted_safe()
        if thing.ray_cast(from_world @ place, from_world.to_3x3() @ to_eye, depsgraph=depsgraph)[0]:
            return True
    return False
