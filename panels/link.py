# SPDX-License-Identifier: GPL-3.0-or-later
"""Which object is which link."""

import bpy

from .base import SkinPanel


class SKIN_PT_link(SkinPanel, bpy.types.Panel):
    bl_label = "Link"

    @classmethod
    def poll(cls, context):
        return True

    def draw(self, context):
        if SkinPanel.poll(context):
            SkinPanel.draw(self, context)
            return
        self.layout.label(text="Select the mesh of a link,", icon="INFO")
        self.layout.label(text="or open a plan:")
        self.layout.operator("skin_calib.import_plan")

    def lay_out(self, layout, plan):
        layout.prop(plan, "link")
        if not plan.link:
            layout.label(text="Name the link to begin", icon="INFO")
        layout.prop(plan, "mesh_file")
        layout.operator("skin_calib.import_plan")


CLASSES = (SKIN_PT_link,)
