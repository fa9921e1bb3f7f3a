# SPDX-License-Identifier: GPL-3.0-or-later
"""Sheets, boards, and taxels of files."""

from functools import partial

import bpy

from ..skin_calib_addon.blender.overlay import drawing
from ..skin_calib_addon.blender.properties.millimetres import shown
from ..skin_calib_addon.blender.scene.fields import read_key
from ..skin_calib_addon.blender.scene.plans import surface_names
from ..skin_calib_addon.common.errors import counted
from ..skin_calib_addon.pipeline.report import registered
from ..skin_calib_addon.plan.keys import SKINS_OF
from .base import (
    BUTTON_WIDTH,
    ICON_WIDTH,
    Step,
    button,
    buttons,
    field,
    fits,
    more,
    search,
    serious_of,
    show_text,
    symbol,
)
from .rows import draw_keys, draw_value, has_switch

# Keys of a skin that most skins leave as they are.
RARE = (
    "landmarks",
    "hand",
    "trim",
    "overlap",
    "max_overhang",
    "max_load",
    "offset",
    "registration",
    "first_channel",
    "anchor",
    "taxels",
)


# [1] skins up to which each one has a box, and rows of the list of more of them. Larger: Export moves down.
MAX_BOXES, MAX_ROWS = 3, 3


class SKIN_UL_skins(bpy.types.UIList):
    """Skins, one in a row; the selected one is shown below the list"""

    def draw_item(self, _context, layout, _data, skin, _icon, _active, _property, _index):
        layout.label(text=skin.name)


class SkinStep(Step):
    label = "Skin"
    name = "skin"

    def figure(self, plan):
        result = plan.result
        return f"{counted(result.taxels, 'taxel')}, {result.cells * 1e4:.0f} cm²" if result.taxels else ""

    def has_warnings(self, plan):
        return serious_of(warning for warning in plan.result.warnings if warning.skin) > 0

    def draw_plan(self, layout, plan):
        if not plan.skins:
            show_text(layout, "Add a sheet, boards, or taxels of a file", "INFO")
        shown = list(enumerate(plan.skins))
        if len(shown) > MAX_BOXES:
            names = "SKIN_UL_skins", "", plan, "skins", plan, "skin_index"
            layout.template_list(*names, rows=MAX_ROWS, maxrows=MAX_ROWS, sort_lock=True)
            shown = [shown[min(plan.skin_index, len(shown) - 1)]]
        for i, skin in shown:
            box = layout.box()
            in_row = 3 if len(plan.skins) > 1 else 2
            if not fits(skin.name, in_row * BUTTON_WIDTH):  # the field shows its start only
                show_text(box, skin.name, "NONE")
            row = box.row(align=True)
            if len(plan.skins) > 1:
                row.prop(skin, "opened", text="", icon="DOWNARROW_HLT" if skin.opened else "RIGHTARROW", emboss=False)
            row.prop(skin, "name", text="")
            if skin.kind != "imported":
                symbol(row, "preset_save", skin=i)
            symbol(row, "skin_remove", index=i)
            if len(plan.skins) > 1 and not skin.opened:
                continue
            field(box, skin, "kind")
            keys = [key for key in SKINS_OF[skin.kind].keys if key.name != "name"]
            draw_keys(box, skin, [key for key in keys if key.name not in RARE], self.own(i))
            body = more(box, plan, "more_skin")
            if body:
                draw_keys(body, skin, [key for key in keys if key.name in RARE], self.own(i))
        row = buttons(layout)
        button(row, "skin_add", text="Sheet", kind="sheet")
        button(row, "skin_add", text="Boards", kind="hexagons")
        button(row, "skin_import", text="Taxels")
        row.menu("SKIN_MT_presets", text="", icon="PRESET")

    def own(self, i):
        """Return what draws the rows of skin ``i`` that have more than a property."""
        return {
            "landmarks": partial(self.draw_list, what="landmark", i=i),
            "excluded": partial(self.draw_list, what="zone", i=i),
            "origin": partial(self.draw_origin, i=i),
            "direction": self.draw_direction,
            "cells": partial(self.draw_cells, i=i),
            "taxels": partial(self.draw_single_taxels, i=i),
            "surface": partial(self.draw_surface, i=i),
            "file": self.draw_file,
            "touches": partial(self.draw_touches, i=i),
            "frame": partial(self.draw_frame, i=i),
        }

    def draw_list(self, layout, skin, key, what, i):
        for k, item in enumerate(getattr(skin, key.property_name)):
            self.draw_entry(layout, f"{key.labels[0]} {k}", what, i, k)
            draw_keys(layout, item, key.type.record.keys)
        row = layout.row(align=True)
        button(row, f"{what}_add", space=ICON_WIDTH if what == "zone" else 0, skin=i)
        if what == "zone":
            symbol(row, "zones_from_faces", skin=i)
            search(layout, skin, "zone_group", skin.id_data, "vertex_groups")

    def draw_single_taxels(self, layout, skin, key, i):
        if skin.kind != "hexagons":
            button(layout, "zones_from_faces", skin=i)
        if not skin.taxels:
            return
        layout.label(text=key.label)
        for k, single in enumerate(skin.taxels):
            row = layout.row(align=True)
            row.use_property_split = False
            row.prop(single, "enabled", text=single.taxel)
            symbol(row, "single_taxel_remove", skin=i, index=k)
            row = layout.row(align=True)
            row.use_property_split = False
            row.prop(single, "auto_channel", text="", icon="LINENUMBERS_OFF", invert_checkbox=True)
            channel = row.row(align=True)
            channel.enabled = not single.auto_channel
            channel.prop(single, "channel")

    def draw_origin(self, layout, skin, key, i):
        if skin.kind == "sheet" and skin.landmarks:
            show_text(layout, "Landmarks replace the origin", "PINNED")
            return
        row = buttons(layout)
        field(row, skin, key.switch.name)
        self.draw_places(row, "origin", i, 0)
        draw_value(layout, skin, key)

    def draw_direction(self, layout, skin, key):
        if has_switch(key):
            field(layout, skin, key.switch.name)
        if not has_switch(key) or not skin.auto_direction:
            field(layout, skin, "turn" if drawing.frame_of(skin) else key.property_name)

    def draw_cells(self, layout, skin, key, i):
        field(layout, skin, key.property_name)
        button(layout, "boards_paint", skin=i)
        if skin.choice == "listed":
            column = layout.column()
            column.alert = skin.cells_wrong
            field(column, skin, "cells")
            if skin.cells_wrong:
                show_text(column, "List them as 0,0 1,0 0,1", "INFO")

    def draw_surface(self, layout, skin, key, i):
        names = surface_names(skin.id_data.skin_calib)
        if len(names) == 1:
            return
        column = layout.column(align=True)
        column.label(text=key.label)
        column = column.grid_flow(row_major=True, even_columns=True, align=True)
        for k, name in enumerate(names):
            is_on = name == skin.surface or not skin.surface and k == 0
            button(column, "skin_surface", text=name, icon="NONE", depress=is_on, skin=i, name=name)

    def draw_file(self, layout, skin, key):
        column = layout.column()
        column.alert = not skin.file
        field(column, skin, key.property_name)
        if not skin.file:
            show_text(column, "Choose the file that has the taxels", "ERROR")

    def draw_frame(self, layout, skin, key, i):
        field(layout, skin, key.switch.name)
        if skin.framed:
            column = layout.column(align=True)
            column.use_property_split = False
            column.label(text="Rotation")
            for k in range(0, 9, 3):
                row = column.row(align=True)
                for j in range(k, k + 3):
                    row.prop(skin, "rotation", index=j, text="")
            field(layout, skin, shown(skin, "translation"))
        button(layout, "frame_find", skin=i)

    def draw_touches(self, layout, skin, key, i):
        if skin.touches:
            first, second = (f"{line[0].upper()}{line[1:]}" for line in registered(read_key(key, skin, 1.0).touched))
            row = layout.row(align=True)
            show_text(row, first, "SNAP_ON")
            symbol(row, "registration_remove", skin=i)
            show_text(layout, second, "NONE")

    def draw_entry(self, box, title, what, i, k):
        """Draw the head of a landmark or zone."""
        row = box.row()
        row.label(text=title)
        self.draw_places(row, what, i, k)
        symbol(row, f"{what}_remove", skin=i, index=k)

    def draw_places(self, row, what, i, k):
        """Draw the buttons that move a point."""
        row = row.row(align=True)
        for name in ("place", "place_at_cursor"):
            symbol(row, name, what=what, skin=i, index=k)
