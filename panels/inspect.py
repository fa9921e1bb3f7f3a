# SPDX-License-Identifier: GPL-3.0-or-later
"""What of the fitted skin is drawn."""

import bpy

from .base import SkinPanel


class SKIN_PT_inspect(SkinPanel, bpy.types.Panel):
    bl_label = "Inspect"

    def lay_out(self, layout, plan):
        if not plan.result.key:
            layout.label(text="Fit the link to see its skin", icon="INFO")
        layout.prop(plan, "show_overlay")
        column = layout.column(align=True)
        column.active = plan.show_overlay
        column.prop(plan, "layers")
        if "ERROR" in plan.layers:
            layout.label(text="Violet: on the mesh. Yellow: Max off", icon="COLOR")


CLASSES = (SKIN_PT_inspect,)
