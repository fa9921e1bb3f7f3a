# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit the active link, and change what its plan lists."""

import bpy

from ..skin_calib_addon.blender import overlay, results, scene
from ..skin_calib_addon.errors import SkinCalibError


class OnMesh:
    """Works on the active object if it is a mesh of this file."""

    @classmethod
    def poll(cls, context):
        return cls.says(scene.why_no_link(context, named=False))

    @classmethod
    def says(cls, reason):
        """Whether there is no reason to refuse; Blender shows the reason at the button."""
        if reason:
            cls.poll_message_set(reason)
        return not reason


class OnLink(OnMesh):
    """Works on the active object if it also has a link name."""

    @classmethod
    def poll(cls, context):
        return cls.says(scene.why_no_link(context))


class SKIN_OT_fit(OnLink, bpy.types.Operator):
    """Fit the surface and lay the skins of the active link"""

    bl_idname = "skin_calib.fit"
    bl_label = "Fit"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        link = context.object
        try:
            key, result = results.fit(scene.read_plan(link, context.scene), scene.read_mesh(link, context))
        except SkinCalibError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        overlay.prepare(key, result)
        scene.write_result(link, context.scene, result, key)
        overlay.redraw()
        for doubt in result.doubts:
            self.report({"WARNING"}, doubt)
        mean = result.fit.errors.surface_to_mesh.mean
        self.report({"INFO"}, f"{link.skin_calib.link}: mean error {mean * 1e3:.4f} mm")
        return {"FINISHED"}


class SKIN_OT_skin_add(OnMesh, bpy.types.Operator):
    """Add a sheet of taxels to the active link"""

    bl_idname = "skin_calib.skin_add"
    bl_label = "Add Sheet"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        settings = context.object.skin_calib
        names = {skin.name for skin in settings.skins}
        channel = max((s.first_channel + s.rows * s.columns for s in settings.skins), default=0)
        skin = settings.skins.add()
        skin.name = next(n for n in ("skin", *(f"skin_{k}" for k in range(2, len(names) + 3))) if n not in names)
        skin.first_channel = channel
        skin.pitch = [0.01 / scene.metres_per_unit(context.scene)] * 2
        return {"FINISHED"}


class SKIN_OT_cut_add(OnMesh, bpy.types.Operator):
    """Add a plane that cuts the cover; it starts at the 3D cursor and keeps what lies above"""

    bl_idname = "skin_calib.cut_add"
    bl_label = "Add Cut"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        link = context.object
        cut = link.skin_calib.cover.cuts.add()
        cut.point = scene.link_frame(link).inverted() @ context.scene.cursor.location
        return {"FINISHED"}


class Remove(OnMesh):
    """Takes one entry out of a list of the plan."""

    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        entries = self.entries(context.object.skin_calib)
        if self.index >= len(entries):
            self.report({"ERROR"}, f"no entry {self.index} here; there are {len(entries)}")
            return {"CANCELLED"}
        entries.remove(self.index)
        context.object.skin_calib.result.outdated = True
        return {"FINISHED"}


class SKIN_OT_skin_remove(Remove, bpy.types.Operator):
    """Remove this sheet from the active link"""

    bl_idname = "skin_calib.skin_remove"
    bl_label = "Remove Sheet"

    index: bpy.props.IntProperty(name="Index", description="Which sheet, from 0", min=0, options={"HIDDEN"})

    @staticmethod
    def entries(settings):
        return settings.skins


class SKIN_OT_cut_remove(Remove, bpy.types.Operator):
    """Remove this cut from the active link"""

    bl_idname = "skin_calib.cut_remove"
    bl_label = "Remove Cut"

    index: bpy.props.IntProperty(name="Index", description="Which cut, from 0", min=0, options={"HIDDEN"})

    @staticmethod
    def entries(settings):
        return settings.cover.cuts


CLASSES = (SKIN_OT_fit, SKIN_OT_skin_add, SKIN_OT_skin_remove, SKIN_OT_cut_add, SKIN_OT_cut_remove)
