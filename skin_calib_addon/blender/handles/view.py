# SPDX-License-Identifier: GPL-3.0-or-later
"""Find what is under the mouse in a 3D view."""

from typing import Any

import bpy
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Vector

from ..scene.points_on_link import met_by


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
