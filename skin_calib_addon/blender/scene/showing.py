# SPDX-License-Identifier: GPL-3.0-or-later
"""Show new links in the 3D views: all of them next to the sidebar, and alone where other objects overlap them."""

from collections.abc import Iterator, Sequence

import bpy
import numpy as np
from mathutils import Vector

from .link_objects import activate

SOLID = ("MESH", "CURVE", "SURFACE", "META", "FONT")  # types of objects that can hide a link


def present(context: bpy.types.Context, things: Sequence[bpy.types.Object]) -> str:
    """Select new objects and show them; in local view if others overlap them.

    Parameters
    ----------
    context : Context
        Has scene and window.
    things : sequence of Object
        The objects; the first mesh becomes the active one. The views are moved to the meshes.

    Returns
    -------
    str
        What local view hides, for a report; empty if it is not needed.
    """
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
    """Return the names of visible objects whose boxes in the world overlap those of some meshes.

    Parameters
    ----------
    context : Context
        Has the scene.
    things : sequence of Object
        The meshes are among them.
    """
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
    before = view.view_distance
    bpy.ops.view3d.view_selected()
    side = next(part.width for part in area.regions if part.type == "UI")
    if not is_overlapped or not 1 < side < region.width:  # a closed sidebar is one pixel wide
        return
    scale = view.window_matrix[0][0]  # half the width of the region, divided by the distance in perspective
    if not view.is_perspective:
        scale *= before
    view.view_distance *= min(region.width, region.height) / min(region.width - side, region.height)
    right = view.view_rotation @ Vector((1, 0, 0))
    view.view_location += right * (side / region.width * view.view_distance / scale)
