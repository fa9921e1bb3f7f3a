# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of the tab Skin in the sidebar of the 3D view."""

import textwrap

import bpy

from ..skin_calib_addon.blender import live
from ..skin_calib_addon.blender.scene import DOUBT_WIDTH


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


class SKIN_PT_fit(SkinPanel, bpy.types.Panel):
    bl_label = "Fit"

    def lay_out(self, layout, plan):
        row = layout.row(align=True)
        row.operator("skin_calib.fit", icon="SURFACE_DATA")
        row.prop(plan, "live", toggle=True, icon="PLAY")
        result, told = plan.result, live.told.get(plan.id_data.name)
        for line in textwrap.wrap(told.problem, DOUBT_WIDTH) if told else ():
            layout.label(text=line, icon="ERROR")
        if not result.key:
            return
        if told and not told.problem:
            layout.label(text=f"Mean {told.mean * 1e3:.4f} mm on the rays, {told.seconds * 1e3:.0f} ms", icon="PLAY")
        elif result.outdated:
            layout.label(text="The plan has changed: fit again", icon="INFO")
        column = layout.column(align=True)
        column.enabled = False
        for name in ("mean", "max", "hausdorff", "control_points", "taxels", "seconds"):
            column.prop(result, name)
        for doubt in result.doubts.split("\n\n") if result.doubts else ():
            column = layout.column(align=True)
            for k, line in enumerate(doubt.split("\n")):
                column.label(text=line, icon="BLANK1" if k else "ERROR")


class SKIN_PT_skin(SkinPanel, bpy.types.Panel):
    bl_label = "Skin"

    def lay_out(self, layout, plan):
        if not plan.skins:
            layout.label(text="Add a sheet, or boards", icon="INFO")
        for i, skin in enumerate(plan.skins):
            box = layout.box()
            row = box.row()
            row.prop(skin, "name", text="")
            row.operator("skin_calib.skin_remove", text="", icon="X").index = i
            box.prop(skin, "kind")
            if skin.kind == "sheet":
                self.lay_out_sheet(box, skin, i)
            else:
                self.lay_out_boards(box, skin, i)
            box.prop(skin, "auto_channel")
            if not skin.auto_channel:
                box.prop(skin, "first_channel")
        row = layout.row(align=True)
        row.operator("skin_calib.skin_add", text="Sheet", icon="ADD").kind = "sheet"
        row.operator("skin_calib.skin_add", text="Hexagons", icon="ADD").kind = "hexagons"

    def lay_out_sheet(self, box, skin, i):
        column = box.column(align=True)
        column.prop(skin, "rows")
        column.prop(skin, "columns")
        column = box.column(align=True)
        column.prop(skin, "pitch", index=0, text="Row Pitch")
        column.prop(skin, "pitch", index=1, text="Column Pitch")
        if skin.landmarks:
            box.label(text="Landmarks hold it, no origin", icon="PINNED")
        else:
            self.lay_out_origin(box, skin, i)
        box.prop(skin, "direction")
        box.prop(skin, "hand")
        box.prop(skin, "offset")
        box.prop(skin, "trim")
        for k, landmark in enumerate(skin.landmarks):
            self.lay_out_entry(box, f"Landmark {k}", "landmark", i, k)
            box.prop(landmark, "cell")
            box.prop(landmark, "point")
        box.operator("skin_calib.landmark_add", icon="ADD").skin = i

    def lay_out_boards(self, box, skin, i):
        box.prop(skin, "side")
        box.prop(skin, "auto_gap")
        if not skin.auto_gap:
            box.prop(skin, "gap")
        box.prop(skin, "choice")
        if skin.choice == "listed":
            column = box.column()
            column.alert = skin.cells_wrong
            column.prop(skin, "cells")
            if skin.cells_wrong:
                column.label(text="List them as 0,0 1,0 0,1", icon="INFO")
        self.lay_out_origin(box, skin, i)
        box.prop(skin, "auto_direction")
        if not skin.auto_direction:
            box.prop(skin, "direction")
        box.prop(skin, "offset")
        for k, zone in enumerate(skin.excluded):
            self.lay_out_entry(box, f"Excluded Zone {k}", "zone", i, k)
            box.prop(zone, "point")
            box.prop(zone, "radius")
        box.operator("skin_calib.zone_add", icon="ADD").skin = i

    def lay_out_origin(self, box, skin, i):
        row = box.row()
        row.prop(skin, "centred")
        self.lay_out_places(row, "origin", i, 0)
        if not skin.centred:
            box.prop(skin, "origin")

    def lay_out_entry(self, box, title, what, i, k):
        """The head of a landmark or zone."""
        row = box.row()
        row.label(text=title)
        self.lay_out_places(row, what, i, k)
        remove = row.operator(f"skin_calib.{what}_remove", text="", icon="X")
        remove.skin, remove.index = i, k

    def lay_out_places(self, row, what, i, k):
        """Buttons that put a point somewhere."""
        row = row.row(align=True)
        for name, icon in (("place", "EYEDROPPER"), ("place_at_cursor", "PIVOT_CURSOR")):
            place = row.operator(f"skin_calib.{name}", text="", icon=icon)
            place.what, place.skin, place.index = what, i, k


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


class SKIN_PT_export(SkinPanel, bpy.types.Panel):
    bl_label = "Export"

    def lay_out(self, layout, plan):
        column = layout.column()
        column.operator("skin_calib.export_calibration", text="Calibration", icon="EXPORT")
        column.operator("skin_calib.export_plan", text="Plan", icon="EXPORT")
        column.operator("skin_calib.export_taxels", text="Taxels for...", icon="EXPORT")


CLASSES = (SKIN_PT_link, SKIN_PT_cut, SKIN_PT_grid, SKIN_PT_fit, SKIN_PT_skin, SKIN_PT_inspect, SKIN_PT_export)
