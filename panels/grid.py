# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the planes are."""

import bpy

from ..skin_calib_addon.blender.scene.plans import record_of
from .base import Step, button, buttons, draw_plane, field, more, show_text, surfaces_figure, symbol, what_is_wrong
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
            button(layout, "planes_place")
        body = more(layout, plan, "more_grid")
        if body:
            draw_keys(body, plan, keys_in("Grid"))

    def draw_axis(self, layout, grid, key):
        is_face = "across" in (grid.kind, grid.kind == "auto" and grid.region)
        row = buttons(layout)
        field(row, grid, key.switch.name)
        if not is_face:
            symbol(row, "axis_from_sections")
            draw_value(layout, grid, key)
        elif not grid.auto_axis:
            field(layout, grid, "direction")

    def draw_boundary(self, layout, grid, key):
        if grid.boundary:
            row = buttons(layout)
            show_text(row, "Inside its boundary", "MOD_OUTLINE")
            symbol(row, "boundary_remove")

    def draw_planes(self, layout, grid, key):
        family = key.property_name
        listed, index = getattr(grid, family), getattr(grid, f"{family}_index")
        row = layout.row()
        row.template_list("SKIN_UL_planes", family, grid, family, grid, f"{family}_index", rows=4)
        column = row.column(align=True)
        symbol(column, "plane_add", family=family)
        symbol(column, "plane_remove", family=family, index=index)
        column.separator()
        symbol(column, "planes_spread", family=family)
        symbol(column, "planes_mirror", family=family)
        if index < len(listed):
            draw_plane(layout, listed[index], what_is_wrong(grid, family.upper(), index))
