# SPDX-License-Identifier: GPL-3.0-or-later
"""What is under the mouse in a 3D view."""

from typing import Any

import bpy
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Vector

from ..scene.scene import met_by


def point_under(context: bpy.types.Context, x: int, y: int) -> Vector | None:
    """Where the active link is under a pixel of the window, in its frame in Blender units; None where it is not."""
    place = place_under(context, x, y)
    return place[0] if place else None


def place_under(context: bpy.types.Context, x: int, y: int) -> tuple[Vector, Vector] | None:
    """The same point, and the unit normal of the face there, towards the eye."""
    ray = ray_under(context, x, y)
    return met_by(context.object, context.evaluated_depsgraph_get(), *ray) if ray else None


def ray_under(context: bpy.types.Context, x: int, y: int) -> tuple[Vector, Vector] | None:
    """Start and way, in the world, of the ray from the eye through a pixel of the window; None outside of 3D views."""
    region = view_at(context.window, x, y)
    if region is None:
        return None
    pixel = x - region.x, y - region.y
    return region_2d_to_origin_3d(region, region.data, pixel), region_2d_to_vector_3d(region, region.data, pixel)


def view_at(window: bpy.types.Window, x: int, y: int) -> Any:
    """The region of a 3D view that a pixel of the window shows; None under a sidebar or a header, and outside."""
    for area in window.screen.areas:
        if area.type == "VIEW_3D":
            under = [r for r in area.regions if 0 <= x - r.x < r.width and 0 <= y - r.y < r.height]
            views = [r for r in under if r.type == "WINDOW"]
            if views and all(r.type in ("WINDOW", "TOOLS") for r in under):  # the tools' region is mostly empty
                return views[0]
    return None
