# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit the active link."""

import bpy

from ..skin_calib_addon.blender import overlay, results, scene
from ..skin_calib_addon.errors import SkinCalibError
from .on_link import OnLink


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
        mean = result.fit.errors.surface_to_mesh.mean
        self.report({"INFO"}, f"{link.skin_calib.link}: mean error {mean * 1e3:.4f} mm")
        for doubt in result.doubts:  # after the rest: the window shows what was reported last
            self.report({"WARNING"}, doubt)
        return {"FINISHED"}


CLASSES = (SKIN_OT_fit,)
