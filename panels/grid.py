# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the planes are."""

import bpy

from .base import SkinPanel


class SKIN_PT_grid(SkinPanel, bpy.types.Panel):
    bl_label = "Grid"

    def lay_out(self, layout, plan):
        grid = plan.grid
        layout.prop(grid, "kind")
        if grid.kind == "planes":
            layout.prop(grid, "closed")
            layout.label(text=f"{len(grid.u)} u-planes, {len(grid.v)} v-planes")
        else:
            self.lay_out_size(layout, grid)
            layout.prop(grid, "auto_axis")
            if not grid.auto_axis:
                if "across" not in (grid.kind, grid.kind == "auto" and grid.region):
                    layout.prop(grid, "point")
                layout.prop(grid, "direction")
            layout.prop(grid, "auto_margin")
            if not grid.auto_margin:
                layout.prop(grid, "margin")
        column = layout.column(align=True)
        column.prop(plan, "degree", index=0, text="Degree U")
        column.prop(plan, "degree", index=1, text="V")
        layout.prop(plan, "chords")

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


CLASSES = (SKIN_PT_grid,)
