# SPDX-License-Identifier: GPL-3.0-or-later
"""Sheets, boards, and taxels of files."""

from functools import partial

import bpy

from ..skin_calib_addon.plan.keys import SKINS_OF
from .base import SkinPanel
from .rows import draw_keys, draw_value


class SKIN_PT_skin(SkinPanel, bpy.types.Panel):
    bl_label = "Skin"

    def draw_plan(self, layout, plan):
        if not plan.skins:
            layout.label(text="Add a sheet, boards, or taxels of a file", icon="INFO")
        for i, skin in enumerate(plan.skins):
            box = layout.box()
            row = box.row()
            row.prop(skin, "name", text="")
            row.operator("skin_calib.skin_remove", text="", icon="X").index = i
            box.prop(skin, "kind")
            keys = [key for key in SKINS_OF[skin.kind].keys if key.name != "name"]
            draw_keys(box, skin, keys, self.own(i))
        row = layout.row(align=True)
        row.operator("skin_calib.skin_add", text="Sheet", icon="ADD").kind = "sheet"
        row.operator("skin_calib.skin_add", text="Hexagons", icon="ADD").kind = "hexagons"
        row.operator("skin_calib.skin_import", text="Taxels", icon="FILEBROWSER")

    def own(self, i):
        """Return what draws the rows of skin ``i`` that have more than a property."""
        return {
            "landmarks": partial(self.draw_list, what="landmark", i=i),
            "excluded": partial(self.draw_list, what="zone", i=i),
            "origin": partial(self.draw_origin, i=i),
            "cells": partial(self.draw_cells, i=i),
            "file": self.draw_file,
            "frame": partial(self.draw_frame, i=i),
        }

    def draw_list(self, layout, skin, key, what, i):
        for k, item in enumerate(getattr(skin, key.property_name)):
            self.draw_entry(layout, f"{key.labels[0]} {k}", what, i, k)
            draw_keys(layout, item, key.type.record.keys)
        layout.operator(f"skin_calib.{what}_add", icon="ADD").skin = i

    def draw_origin(self, layout, skin, key, i):
        if skin.kind == "sheet" and skin.landmarks:
            layout.label(text="Landmarks replace the origin", icon="PINNED")
            return
        row = layout.row()
        row.prop(skin, key.switch.name)
        self.draw_places(row, "origin", i, 0)
        draw_value(layout, skin, key)

    def draw_cells(self, layout, skin, key, i):
        layout.prop(skin, key.property_name)
        layout.operator("skin_calib.boards_paint", icon="BRUSH_DATA").skin = i
        if skin.choice == "listed":
            column = layout.column()
            column.alert = skin.cells_wrong
            column.prop(skin, "cells")
            if skin.cells_wrong:
                column.label(text="List them as 0,0 1,0 0,1", icon="INFO")

    def draw_file(self, layout, skin, key):
        column = layout.column()
        column.alert = not skin.file
        column.prop(skin, key.property_name)

    def draw_frame(self, layout, skin, key, i):
        layout.prop(skin, key.switch.name)
        if skin.framed:
            column = layout.column(align=True)
            column.use_property_split = False
            column.label(text="Rotation")
            for k in range(0, 9, 3):
                row = column.row(align=True)
                for j in range(k, k + 3):
                    row.prop(skin, "rotation", index=j, text="")
            layout.prop(skin, "translation")
        layout.operator("skin_calib.frame_find", icon="VIEWZOOM").skin = i

    def draw_entry(self, box, title, what, i, k):
        """Draw the head of a landmark or zone."""
        row = box.row()
        row.label(text=title)
        self.draw_places(row, what, i, k)
        remove = row.operator(f"skin_calib.{what}_remove", text="", icon="X")
        remove.skin, remove.index = i, k

    def draw_places(self, row, what, i, k):
        """Draw the buttons that move a point."""
        row = row.row(align=True)
        for name, icon in (("place", "EYEDROPPER"), ("place_at_cursor", "PIVOT_CURSOR")):
            place = row.operator(f"skin_calib.{name}", text="", icon=icon)
            place.what, place.skin, place.index = what, i, k


CLASSES = (SKIN_PT_skin,)
