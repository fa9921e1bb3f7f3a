# SPDX-License-Identifier: GPL-3.0-or-later
"""Points picked for a link, in the link frame: the 3D cursor, and where a ray hits the object."""

import bpy
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
