# SPDX-License-Identifier: GPL-3.0-or-later
"""Which object is which link, and the state of its mesh."""

import bpy

from ..skin_calib_addon.blender.live import diagnoses
from ..skin_calib_addon.blender.scene.scene import longest_side, namesakes
from ..skin_calib_addon.geometry.mesh.units import UNIT_NAMES, likely_mistake
from .base import SkinPanel, show_text, show_warning
from .rows import draw_keys, keys_in


class SKIN_PT_link(SkinPanel, bpy.types.Panel):
    bl_label = "Link"

    @classmethod
    def poll(cls, context):
        return True

    def draw(self, context):
        if SkinPanel.poll(context):
            SkinPanel.draw(self, context)
            self.draw_namesakes(context)
            self.draw_unit(context)
        else:
            self.layout.label(text="Select the mesh of a link,", icon="INFO")
            self.layout.label(text="or open one:")
        row = self.layout.row(align=True)
        row.operator("skin_calib.import_mesh", text="Mesh", icon="IMPORT")
        row.operator("skin_calib.import_urdf", text="URDF", icon="IMPORT")
        row.operator("skin_calib.import_plan", text="Plan", icon="IMPORT")

    def draw_plan(self, layout, plan):
        draw_keys(layout, plan, keys_in("Link"))
        if not plan.link:
            layout.label(text="Enter the name of the link", icon="INFO")
        layout.prop(plan, "mesh_file")

    def draw_namesakes(self, context):
        """Draw a warning about another object with the same link name, as a copy has."""
        others = namesakes(context.object, context.scene)
        if others:
            text = f"{others[0]} has the same link name, so their files have the same names. Rename one."
            show_text(self.layout.box(), text, "ERROR")

    def draw_unit(self, context):
        """Draw a warning about a size that links do not have, and the button that corrects it."""
        side = longest_side(context.object, context.scene)
        wrong = likely_mistake(side) if context.object.skin_calib.link and side else None
        if wrong is None:
            return
        unit, _ = wrong
        box = self.layout.box()
        question = f"{UNIT_NAMES[unit]}?" if unit else "check its scale"
        column = box.column(align=True)
        column.label(text=f"This mesh is {side:.3g} m long:", icon="ERROR")
        column.label(text=question, icon="BLANK1")
        if unit:
            box.operator("skin_calib.scale_to_unit", text=f"Scale to {UNIT_NAMES[unit].capitalize()}").unit = unit


class SKIN_PT_mesh(SkinPanel, bpy.types.Panel):
    bl_label = "Mesh"
    bl_parent_id = "SKIN_PT_link"

    def draw_plan(self, layout, plan):
        found = plan.diagnosis
        layout.operator("skin_calib.diagnose", icon="VIEWZOOM")
        if not found.key:
            return
        if plan.id_data.name in diagnoses.unverified:
            layout.label(text="The mesh has changed: check again", icon="INFO")
        for finding in found.findings:
            show_warning(layout, finding)
        if found.inner:
            row = layout.row(align=True)
            row.use_property_split = False
            row.prop_enum(plan.cover, "shell", "outer", text="Keep Outer Shell")
            row.prop_enum(plan.cover, "shell", "all", text="Keep All")
        if found.edges:
            layout.operator("skin_calib.show_defects", text="Show Holes and Bad Edges", icon="RESTRICT_SELECT_OFF")


CLASSES = (SKIN_PT_link, SKIN_PT_mesh)
