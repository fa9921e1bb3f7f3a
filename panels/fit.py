# SPDX-License-Identifier: GPL-3.0-or-later
"""The fit, and what it gave."""

import textwrap

import bpy

from ..skin_calib_addon.blender.live import live
from ..skin_calib_addon.blender.scene.scene import DOUBT_WIDTH
from .base import SkinPanel


class SKIN_PT_fit(SkinPanel, bpy.types.Panel):
    bl_label = "Fit"

    def lay_out(self, layout, plan):
        row = layout.row(align=True)
        row.operator("skin_calib.fit", icon="SURFACE_DATA")
        row.prop(plan, "live", toggle=True, icon="PLAY")
        result, told = plan.result, live.told.get(plan.id_data.name)
        for line in textwrap.wrap(told.problem, DOUBT_WIDTH) if told else ():
            layout.label(text=line, icon="ERROR")
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
        for doubt in result.doubts.split("\n\n") if result.doubts else ():
            column = layout.column(align=True)
            for k, line in enumerate(doubt.split("\n")):
                column.label(text=line, icon="BLANK1" if k else "ERROR")


CLASSES = (SKIN_PT_fit,)
