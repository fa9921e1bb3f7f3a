# SPDX-License-Identifier: GPL-3.0-or-later
"""Sheets, boards, and taxels of files."""

import bpy

from .base import SkinPanel


class SKIN_PT_skin(SkinPanel, bpy.types.Panel):
    bl_label = "Skin"

    def lay_out(self, layout, plan):
        if not plan.skins:
            layout.label(text="Add a sheet, boards, or taxels of a file", icon="INFO")
        for i, skin in enumerate(plan.skins):
            box = layout.box()
            row = box.row()
            row.prop(skin, "name", text="")
            row.operator("skin_calib.skin_remove", text="", icon="X").index = i
            box.prop(skin, "kind")
            if skin.kind == "sheet":
                self.lay_out_sheet(box, skin, i)
            elif skin.kind == "hexagons":
                self.lay_out_boards(box, skin, i)
            else:
                self.lay_out_imported(box, skin, i)
            box.prop(skin, "auto_channel")
            if not skin.auto_channel:
                box.prop(skin, "first_channel")
        row = layout.row(align=True)
        row.operator("skin_calib.skin_add", text="Sheet", icon="ADD").kind = "sheet"
        row.operator("skin_calib.skin_add", text="Hexagons", icon="ADD").kind = "hexagons"
        row.operator("skin_calib.skin_import", text="Taxels", icon="FILEBROWSER")

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
        box.operator("skin_calib.boards_paint", icon="BRUSH_DATA").skin = i
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

    def lay_out_imported(self, box, skin, i):
        column = box.column()
        column.alert = not skin.file
        column.prop(skin, "file")
        box.prop(skin, "format")
        box.prop(skin, "only")
        box.prop(skin, "framed")
        if skin.framed:
            column = box.column(align=True)
            column.use_property_split = False
            column.label(text="Rotation")
            for k in range(0, 9, 3):
                row = column.row(align=True)
                for j in range(k, k + 3):
                    row.prop(skin, "rotation", index=j, text="")
            box.prop(skin, "translation")
        box.operator("skin_calib.frame_find", icon="VIEWZOOM").skin = i
        box.prop(skin, "snap")

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


CLASSES = (SKIN_PT_skin,)
