# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the planes are."""

import bpy

from .base import SkinPanel, lay_out_plane, what_is_wrong


class SKIN_UL_planes(bpy.types.UIList):
    """Planes one by one; those that are wrong are marked."""

    def draw_item(self, _context, layout, data, _item, _icon, _active, property_name, index):
        family = property_name.split("_")[0].upper()
        wrong = what_is_wrong(data, family, index)
        layout.alert = bool(wrong)
        layout.label(text=f"{family.lower()}-plane {index}", icon="ERROR" if wrong else "MESH_PLANE")


class SKIN_PT_grid(SkinPanel, bpy.types.Panel):
    bl_label = "Grid"

    def lay_out(self, layout, plan):
        grid = plan.grid
        layout.prop(grid, "kind")
        if grid.kind == "planes":
            layout.prop(grid, "closed")
            self.lay_out_planes(layout, grid, "u")
            self.lay_out_planes(layout, grid, "v")
        else:
            self.lay_out_size(layout, grid)
            self.lay_out_axis(layout, grid)
            layout.prop(grid, "auto_margin")
            if not grid.auto_margin:
                layout.prop(grid, "margin")
            layout.operator("skin_calib.planes_place", icon="MESH_PLANE")
        column = layout.column(align=True)
        column.prop(plan, "degree", index=0, text="Degree U")
        column.prop(plan, "degree", index=1, text="V")
        layout.prop(plan, "chords")

    def lay_out_axis(self, layout, grid):
        is_face = "across" in (grid.kind, grid.kind == "auto" and grid.region)
        row = layout.row()
        row.prop(grid, "auto_axis")
        if not is_face:
            row.operator("skin_calib.axis_from_sections", text="", icon="EYEDROPPER")
        if not grid.auto_axis:
            if not is_face:
                layout.prop(grid, "point")
            layout.prop(grid, "direction")

    def lay_out_size(self, layout, grid):
        column = layout.column(align=True)
        if grid.kind == "auto":
            column.prop(grid, "tolerance")
            column.prop(grid, "measure")
            column.prop(grid, "region")
        else:
            column.prop(grid, "n")
            column.prop(grid, "lines")
            layout.prop(grid, "spacing")
        region = grid.region if grid.kind == "auto" else grid.kind
        if region == "across":
            layout.prop(grid, "normal")
        if region == "sector":
            column = layout.column(align=True)
            column.prop(grid, "start")
            column.prop(grid, "stop")

    def lay_out_planes(self, layout, grid, family):
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
            lay_out_plane(layout, listed[index], what_is_wrong(grid, family.upper(), index))


CLASSES = (SKIN_UL_planes, SKIN_PT_grid)
