# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh objects of links: find, add, activate and measure them, and say why one cannot be edited."""

from contextlib import AbstractContextManager, nullcontext
from typing import Any

import bpy
import numpy as np

from ...geometry.mesh.triangle_mesh import METRES_PER_UNIT, TriangleMesh
from .units import metres_per_unit

FRAME_SIZE = 0.03  # [m] length of the drawn axes of a link frame. Larger: they hide more of small links.


def links(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return the objects of the scene that have a link name, sorted by name."""
    return sorted((o for o in context.scene.objects if o.type == "MESH" and o.skin_calib.link), key=lambda o: o.name)


def namesakes(link: bpy.types.Object, scene: bpy.types.Scene) -> list[str]:
    """Return the names of the other objects with the same link name, such as copies."""
    name = link.skin_calib.link
    return [o.name for o in scene.objects if name and o != link and o.type == "MESH" and o.skin_calib.link == name]


def of_uid(uid: int) -> bpy.types.Object | None:
    """Return the object with a `session_uid`, which a new name does not change; None once it is removed."""
    return next((thing for thing in bpy.data.objects if thing.session_uid == uid), None)


def in_scene(link: bpy.types.Object) -> AbstractContextManager[Any]:
    """Make the scene of an object the one of the context, with the view layer of a window that shows it.

    A timer has the scene of any window. In another one, the object has no modifiers and can have another unit.
    """
    context, scenes = bpy.context, link.users_scene
    if not scenes or context.scene in scenes:
        return nullcontext()
    views = {window.scene: window.view_layer for window in context.window_manager.windows}
    scene = next((scene for scene in scenes if scene in views), scenes[0])
    return context.temp_override(scene=scene, view_layer=views.get(scene, scene.view_layers[0]))


def new_frame(link: str, metre: float) -> bpy.types.Object:
    """Return a new empty, which is the frame of a link."""
    frame = bpy.data.objects.new(f"{link}_frame", None)
    frame.empty_display_type, frame.empty_display_size = "ARROWS", FRAME_SIZE / metre
    return frame


def add_link(
    context: bpy.types.Context, mesh: TriangleMesh, unit: str, name: str, frame: bpy.types.Object | None = None
) -> bpy.types.Object:
    """Return a new object for a mesh, below its frame; its data keeps the numbers, and its scale converts their unit.

    Without a frame it gets one at the origin of the world.
    """
    metre = metres_per_unit(context.scene)
    if frame is None:
        frame = new_frame(name, metre)
        context.scene.collection.objects.link(frame)
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
    factor = METRES_PER_UNIT[unit] / metre
    link.parent, link.scale = frame, (factor, factor, factor)
    box = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    link.skin_calib.imported_box = np.ravel(box) * METRES_PER_UNIT[unit]
    frame.users_collection[0].objects.link(link)
    return link


def activate(context: bpy.types.Context, link: bpy.types.Object) -> None:
    """Make an object the active and only selected one, in Object Mode."""
    if context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    for other in context.selected_objects:
        other.select_set(False)
    link.select_set(True)
    context.view_layer.objects.active = link


def longest_side(link: bpy.types.Object, scene: bpy.types.Scene) -> float:
    """Return the longest side of the object's box in the scene, from Blender's cache."""
    return max(link.dimensions) * metres_per_unit(scene)


def why_not(link: bpy.types.Object | None, named: bool = True) -> str:
    """Return why an object is not an editable link, and what to do; empty if it is one."""
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
