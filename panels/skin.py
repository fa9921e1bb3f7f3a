# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of the tab Skin in the sidebar of the 3D view."""

import bpy


class SkinPanel:
    """Where the panels are, and when."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Skin"

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == "MESH"


class SKIN_PT_link(SkinPanel, bpy.types.Panel):
    bl_label = "Link"

    @classmethod
    def poll(cls, context):
        return True

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        link = context.object
        if link is None or link.type != "MESH":
            layout.label(text="Select the mesh of a link,", icon="INFO")
            layout.label(text="or open a plan:")
            layout.operator("skin_calib.import_plan")
            return
        layout.prop(link.skin_calib, "link")
        layout.prop(link.skin_calib, "mesh_file")
        if not link.skin_calib.link:
            layout.label(text="Name the link to begin", icon="INFO")
        layout.operator("skin_calib.import_plan")


class SKIN_PT_cut(SkinPanel, bpy.types.Panel):
    bl_label = "Cut"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        cover = context.object.skin_calib.cover
        layout.prop(cover, "shell", expand=True)
        for i, cut in enumerate(cover.cuts):
            box = layout.box()
            row = box.row()
            row.label(text=f"Cut {i}")
            row.operator("skin_calib.cut_remove", text="", icon="X").index = i
            box.prop(cut, "point")
            box.prop(cut, "normal")
        layout.operator("skin_calib.cut_add")


class SKIN_PT_grid(SkinPanel, bpy.types.Panel):
    bl_label = "Grid"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        settings = context.object.skin_calib
        grid = settings.grid
        layout.prop(grid, "kind")
        if grid.kind == "planes":
            layout.prop(grid, "closed")
            layout.label(text=f"{len(grid.u)} u-planes, {len(grid.v)} v-planes")
        else:
            column = layout.column(align=True)
            column.prop(grid, "n")
            column.prop(grid, "lines")
            if grid.kind == "across":
                layout.prop(grid, "normal")
            layout.prop(grid, "auto_axis")
            if not grid.auto_axis:
                if grid.kind != "across":
                    layout.prop(grid, "point")
                layout.prop(grid, "direction")
            layout.prop(grid, "auto_margin")
            if not grid.auto_margin:
                layout.prop(grid, "margin")
        if grid.kind == "sector":
            column = layout.column(align=True)
            column.prop(grid, "start")
            column.prop(grid, "stop")
        layout.prop(settings, "degree")


class SKIN_PT_fit(SkinPanel, bpy.types.Panel):
    bl_label = "Fit"

    def draw(self, context):
        layout = self.layout
        layout.operator("skin_calib.fit", icon="SURFACE_DATA")
        result = context.object.skin_calib.result
        if not result.number:
            return
        column = layout.column(align=True)
        column.use_property_split = True
        column.enabled = False
        for name in ("mean", "max", "hausdorff", "control_points", "taxels", "seconds"):
            column.prop(result, name)
        layout.prop(context.object.skin_calib, "show_overlay")


class SKIN_PT_skin(SkinPanel, bpy.types.Panel):
    bl_label = "Skin"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        for i, skin in enumerate(context.object.skin_calib.skins):
            box = layout.box()
            row = box.row()
            row.prop(skin, "name", text="")
            row.operator("skin_calib.skin_remove", text="", icon="X").index = i
            column = box.column(align=True)
            column.prop(skin, "rows")
            column.prop(skin, "columns")
            box.prop(skin, "pitch")
            box.prop(skin, "centred")
            if not skin.centred:
                box.prop(skin, "origin")
            box.prop(skin, "direction")
            box.prop(skin, "first_channel")
        layout.operator("skin_calib.skin_add")


class SKIN_PT_export(SkinPanel, bpy.types.Panel):
    bl_label = "Export"

    def draw(self, context):
        column = self.layout.column()
        column.operator("skin_calib.export_calibration")
        column.operator("skin_calib.export_plan")


CLASSES = (SKIN_PT_link, SKIN_PT_cut, SKIN_PT_grid, SKIN_PT_fit, SKIN_PT_skin, SKIN_PT_export)
