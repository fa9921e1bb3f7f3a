# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit the active link."""

import bpy

from ..skin_calib_addon.blender import overlay, results, scene
from ..skin_calib_addon.errors import SkinCalibError
from ..skin_calib_addon.pipeline import calibrate


def has_link(context):
    """Whether a mesh object is active that can carry a plan."""
    return context.object is not None and context.object.type == "MESH"


class SKIN_OT_fit(bpy.types.Operator):
    """Fit the surface and lay the skins of the active link"""

    bl_idname = "skin_calib.fit"
    bl_label = "Fit"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if not has_link(context):
            cls.poll_message_set("Select the mesh object of a link")
            return False
        if not context.object.skin_calib.link:
            cls.poll_message_set("Give the object a link name first")
            return False
        return True

    def execute(self, context):
        try:
            link = scene.active_link(context)
            result = calibrate(scene.read_plan(link, context.scene), scene.read_mesh(link, context))
        except SkinCalibError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        number = results.keep(result)
        overlay.prepare(number, result)
        scene.write_result(link, context.scene, result, number)
        overlay.redraw()
        mean = result.fit.errors.surface_to_mesh.mean
        self.report({"INFO"}, f"{link.skin_calib.link}: mean error {mean * 1e3:.4f} mm")
        return {"FINISHED"}


class SKIN_OT_skin_add(bpy.types.Operator):
    """Add a sheet of taxels to the active link"""

    bl_idname = "skin_calib.skin_add"
    bl_label = "Add Sheet"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return has_link(context)

    def execute(self, context):
        skins = context.object.skin_calib.skins
        names = {skin.name for skin in skins}
        channel = max((s.first_channel + s.rows * s.columns for s in skins), default=0)
        skin = skins.add()
        skin.name = next(n for n in ("skin", *(f"skin_{k}" for k in range(2, len(names) + 3))) if n not in names)
        skin.first_channel = channel
        return {"FINISHED"}


class SKIN_OT_skin_remove(bpy.types.Operator):
    """Remove this sheet from the active link"""

    bl_idname = "skin_calib.skin_remove"
    bl_label = "Remove Sheet"
    bl_options = {"REGISTER", "UNDO"}

    index: bpy.props.IntProperty(min=0, options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        return has_link(context) and len(context.object.skin_calib.skins) > 0

    def execute(self, context):
        context.object.skin_calib.skins.remove(self.index)
        return {"FINISHED"}


class SKIN_OT_cut_add(bpy.types.Operator):
    """Add a plane that cuts the cover; it starts at the 3D cursor and keeps what lies above"""

    bl_idname = "skin_calib.cut_add"
    bl_label = "Add Cut"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return has_link(context)

    def execute(self, context):
        link = context.object
        cut = link.skin_calib.cover.cuts.add()
        frame = link.parent.matrix_world @ link.matrix_parent_inverse if link.parent else None
        cursor = context.scene.cursor.location
        cut.point = frame.inverted() @ cursor if frame else cursor
        return {"FINISHED"}


class SKIN_OT_cut_remove(bpy.types.Operator):
    """Remove this cut"""

    bl_idname = "skin_calib.cut_remove"
    bl_label = "Remove Cut"
    bl_options = {"REGISTER", "UNDO"}

    index: bpy.props.IntProperty(min=0, options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        return has_link(context) and len(context.object.skin_calib.cover.cuts) > 0

    def execute(self, context):
        context.object.skin_calib.cover.cuts.remove(self.index)
        return {"FINISHED"}


CLASSES = (SKIN_OT_fit, SKIN_OT_skin_add, SKIN_OT_skin_remove, SKIN_OT_cut_add, SKIN_OT_cut_remove)
