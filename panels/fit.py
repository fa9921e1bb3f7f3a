# SPDX-License-Identifier: GPL-3.0-or-later
"""The fit and its result."""

import bpy

from ..skin_calib_addon.blender.live import updates
from .base import SkinPanel, show_text, show_warning


class SKIN_PT_fit(SkinPanel, bpy.types.Panel):
    bl_label = "Fit"

    def draw_plan(self, layout, plan):
        row = layout.row(align=True)
        row.operator("skin_calib.fit", icon="SURFACE_DATA")
        row.prop(plan, "live", toggle=True, icon="PLAY")
        result, note = plan.result, updates.reports.get(plan.id_data.name)
        if note and note.problem:
            show_text(layout, note.problem, "ERROR")
        if not result.key:
            return
        if note and not note.problem:
            layout.label(text=f"Mean {note.mean * 1e3:.4f} mm on the rays, {note.seconds * 1e3:.0f} ms", icon="PLAY")
        elif result.outdated:
            layout.label(text="The plan has changed: fit again", icon="INFO")
        column = layout.column(align=True)
        column.enabled = False
        for name in ("mean", "max", "hausdorff", "control_points", "taxels", "seconds"):
            column.prop(result, name)
        is_marked = plan.inspect.marked == result.key
        layout.operator("skin_calib.show_worst", icon="ZOOM_SELECTED", depress=is_marked)
        for warning in result.warnings:
            show_warning(layout, warning)


CLASSES = (SKIN_PT_fit,)
