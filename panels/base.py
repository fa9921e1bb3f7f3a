# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels have in common: where they are, and when."""


class SkinPanel:
    """Where the panels are, and when."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Skin"

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == "MESH"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False  # nothing here is animatable
        self.lay_out(layout, context.object and context.object.skin_calib)
