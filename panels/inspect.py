# SPDX-License-Identifier: GPL-3.0-or-later
"""What of the fitted skin is drawn, and how."""

import bpy

from ..skin_calib_addon.blender import results
from .base import SkinPanel


class SKIN_PT_inspect(SkinPanel, bpy.types.Panel):
    bl_label = "Inspect"

    def lay_out(self, layout, plan):
        if not plan.result.key:
            layout.label(text="Fit the link to see its skin", icon="INFO")
        elif results.find(plan.result.key) is None:
            layout.label(text="Fit again to see the skin", icon="INFO")  # a file keeps no surface
        layout.prop(plan, "show_overlay")
        column = layout.column(align=True)
        column.active = plan.show_overlay
        column.prop(plan, "layers")
        column.prop(plan.inspect, "heat")
        column.prop(plan.inspect, "labels")


class SKIN_PT_inspect_sizes(SkinPanel, bpy.types.Panel):
    bl_label = "Sizes"
    bl_parent_id = "SKIN_PT_inspect"
    bl_options = {"DEFAULT_CLOSED"}

    def lay_out(self, layout, plan):
        looks = plan.inspect
        layout.prop(looks, "auto_length")
        if not looks.auto_length:
            layout.prop(looks, "length")
        layout.prop(looks, "text_size")
        layout.prop(looks, "line_width")


CLASSES = (SKIN_PT_inspect, SKIN_PT_inspect_sizes)
