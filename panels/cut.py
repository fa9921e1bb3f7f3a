# SPDX-License-Identifier: GPL-3.0-or-later
"""What of the mesh is covered."""

import bpy

from .base import SkinPanel


class SKIN_PT_cut(SkinPanel, bpy.types.Panel):
    bl_label = "Cut"

    def lay_out(self, layout, plan):
        layout.row().prop(plan.cover, "shell", expand=True)
        for i, cut in enumerate(plan.cover.cuts):
            box = layout.box()
            row = box.row()
            row.label(text=f"Cut {i}")
            row.operator("skin_calib.cut_remove", text="", icon="X").index = i
            box.prop(cut, "point")
            box.prop(cut, "normal")
        layout.operator("skin_calib.cut_add", icon="ADD")


CLASSES = (SKIN_PT_cut,)
