# SPDX-License-Identifier: GPL-3.0-or-later
"""The fit, and what it gave."""

import bpy

from ..skin_calib_addon.blender.live import live
from .base import SkinPanel, show_text, show_warning


class SKIN_PT_fit(SkinPanel, bpy.types.Panel):
    bl_label = "Fit"

    def lay_out(self, layout, plan):
        row = layout.row(align=True)
        row.operator("skin_calib.fit", icon="SURFACE_DATA")
        row.prop(plan, "live", toggle=True, icon="PLAY")
        result, told = plan.result, live.told.get(plan.id_data.name)
        if told and told.problem:
            show_text(layout, told.problem, "ERROR")
        if not result.key:
            return
        if told and not told.problem:
            layout.label(text=f"Mean {told.mean * 1e3:.4f} mm on the rays, {told.seconds * 1e3:.0f} ms", icon="PLAY")
        elif result.outdated:
            layout.label(text="The plan has changed: fit again", icon="INFO")
        column = layout.column(align=True)
        column.enabled = False
        for name in ("mean", "max", "hausdorff", "control_points", "taxels", "seconds"):
            column.prop(result, name)
        layout.operator("skin_calib.show_worst", icon="ZOOM_SELECTED")
        for warning in result.warnings:
            show_warning(layout, warning)


CLASSES = (SKIN_PT_fit,)
