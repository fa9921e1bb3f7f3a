# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the planes are."""

import bpy

from ..skin_calib_addon.blender.scene.plans import record_of
from .base import Step, button, buttons, draw_plane, field, more, show_text, surfaces_figure, what_is_wrong
from .rows import draw_keys, draw_value, keys_in


class SKIN_UL_planes(bpy.types.UIList):
    """Planes one by one; a mark is at those that are wrong."""

    def draw_item(self, _context, layout, data, _item, _icon, _active, property_name, index):
        family = property_name.split("_")[0].upper()
        wrong = what_is_wrong(data, family, index)
        layout.alert = bool(wrong)
        layout.label(text=f"{family.lower()}-plane {index}", icon="ERROR" if wrong else "MESH_PLANE")


class GridStep(Step):
    label = "Grid"
    name = "grid"

    def figure(self, plan):
        return surfaces_figure(plan) or plan.grid.bl_rna.properties["kind"].enum_items[plan.grid.kind].name

    def draw_plan(self, layout, plan):
        grid = plan.grid
        field(layout, grid, "kind")
        if grid.kind == "auto":
            field(layout, grid, "region")
        own = {"axis": self.draw_axis, "boundary": self.draw_boundary, "u": self.draw_planes, "v": self.draw_planes}
        draw_keys(layout, grid, record_of(grid).keys, own)
        if grid.kind != "planes":
            button(layout, "planes_place", icon="MESH_PLANE")
        body = more(layout, plan, "more_grid")
        if body:
            draw_keys(body, plan, keys_in("Grid"))

    def draw_axis(self, layout, grid, key):
        is_face = "across" in (grid.kind, grid.kind == "auto" and grid.region)
        row = buttons(layout)
        field(row, grid, key.switch.name)
        if not is_face:
            row.operator("skin_calib.axis_from_sections", text="", icon="EYEDROPPER")
            draw_value(layout, grid, key)
        elif not grid.auto_axis:
            field(layout, grid, "direction")

    def draw_boundary(self, layout, grid, key):
        if grid.boundary:
            row = buttons(layout)
            show_text(row, "Inside its boundary", "MOD_OUTLINE")
            row.operator("skin_calib.boundary_remove", text="", icon="X")

    def draw_planes(self, layout, grid, key):
        family = key.property_name
        listed, index = getattr(grid, family), getattr(grid, f"{family}_index")
        row = layout.row()
        row.template_list("SKIN_UL_planes", family, grid, family, grid, f"{family}_index", rows=4)
        column = row.column(align=True)
        column.operator("skin_calib.plane_add", text="", icon="ADD").family = family
        remove = column.operator("skin_calib.plane_remove", text="", icon="REMOVE")
        remove.family, remove.index = family, index
        column.separator()
        column.operator("skin_calib.planes_spread", text="", icon="ALIGN_JUSTIFY").family = family
        column.operator("skin_calib.planes_mirror", text="", icon="MOD_MIRROR").family = family
        if index < len(listed):
            draw_plane(layout, listed[index], what_is_wrong(grid, family.upper(), index))


CLASSES = (SKIN_UL_planes,)
