# SPDX-License-Identifier: GPL-3.0-or-later
"""Points picked for a link, in the link frame: the 3D cursor, and where a ray hits the object."""

from typing import Any

import bpy
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Vector

from ...common.errors import InvalidMesh
from .link_meshes import link_frame


def cursor_on(link: bpy.types.Object, scene: bpy.types.Scene) -> Vector:
    """Return the 3D cursor in the link frame."""
    return link_frame(link).inverted() @ scene.cursor.location


def check_seen(link: bpy.types.Object) -> None:
    """Refuse an object that rays do not hit."""
    if link.mode == "EDIT":
        raise InvalidMesh(f"{link.name} is in Edit Mode. Leave Edit Mode to click on it.")
    if not link.visible_get():
        raise InvalidMesh(f"{link.name} is hidden. Show it to click on it.")


def point_on(link: bpy.types.Object, depsgraph: bpy.types.Depsgraph, start: Vector, direction: Vector) -> Vector | None:
    """Return where a ray first hits the object."""
    met = met_by(link, depsgraph, start, direction)
    return met[0] if met else None


def met_by(
    link: bpy.types.Object, depsgraph: bpy.types.Depsgraph, start: Vector, direction: Vector
) -> tuple[Vector, Vector] | None:
    """Return where a ray first hits the object, and the unit normal of the face there."""
    to_world, to_frame = link.matrix_world, link_frame(link).inverted()
    local = to_world.inverted_safe()
    met, point, normal, _ = link.evaluated_get(depsgraph).ray_cast(local @ start, local.to_3x3() @ direction)
    if not met:
        return None
    upright = to_frame.to_3x3() @ (local.to_3x3().transposed() @ normal)
    upright = upright.normalized() * (-1 if upright.dot(to_frame.to_3x3() @ direction) > 0 else 1)
    return to_frame @ (to_world @ point), upright


def point_under(context: bpy.types.Context, x: int, y: int) -> Vector | None:
    """Return the point of the active link under a pixel of the window; None if it is not there."""
    met = point_and_normal_under(context, x, y)
    return met[0] if met else None


def point_and_normal_under(context: bpy.types.Context, x: int, y: int) -> tuple[Vector, Vector] | None:
    """Return the point under a pixel, and the unit normal of the face there, towards the eye."""
    ray = ray_under(context, x, y)
    return met_by(context.object, context.evaluated_depsgraph_get(), *ray) if ray else None


def ray_under(context: bpy.types.Context, x: int, y: int) -> tuple[Vector, Vector] | None:
    """Return start and direction, in the world, of the ray from the eye through a pixel; None outside of 3D views."""
    region = view_at(context.window, x, y)
    if region is None:
        return None
    pixel = x - region.x, y - region.y
    return region_2d_to_origin_3d(region, region.data, pixel), region_2d_to_vector_3d(region, region.data, pixel)


def view_at(window: bpy.types.Window, x: int, y: int) -> Any:
    """Return the region of a 3D view that contains a pixel of the window; None for all other regions."""
    for area in window.screen.areas:
        if area.type == "VIEW_3D":
            under = [r for r in area.regions if 0 <= x - r.x < r.width and 0 <= y - r.y < r.height]
            views = [r for r in under if r.type == "WINDOW"]
            if views and all(r.type in ("WINDOW", "TOOLS") for r in under):  # the region of the tools is mostly empty
                return views[0]
    return None
