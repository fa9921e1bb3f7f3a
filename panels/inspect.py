# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parts of the fitted skin are drawn, and how."""

import bpy

from ..skin_calib_addon.blender.inspection import comparing, replay, taxel_mesh
from ..skin_calib_addon.blender.overlay import drawing
from ..skin_calib_addon.blender.properties.millimetres import shown
from ..skin_calib_addon.blender.scene import results
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from .base import ICON_WIDTH, SkinPanel, button, buttons, field, is_narrow, show_text, show_warning, symbol


class InspectPanel(SkinPanel):
    """In a tab of its own: the tab Skin has the work, this one its inspection."""

    bl_category = "Inspect"


class SKIN_PT_inspect(InspectPanel, bpy.types.Panel):
    bl_label = "Inspect"

    def draw_plan(self, layout, plan):
        if not plan.result.key:
            show_text(layout, "Fit the link to see its skin", "INFO")
        elif results.find(plan.result.key) is None:
            show_text(layout, "Fit again to see the skin", "INFO")  # a .blend has no surface
        elif drawing.is_of_last_fit(plan.id_data):
            show_text(layout, "Shown: the last fit, before the change", "INFO")
        field(layout, plan, "show_overlay")
        column = layout.column(align=True)
        column.active = plan.show_overlay
        flow = column.grid_flow(columns=1 if is_narrow() else 3, even_columns=True, align=True)
        flow.use_property_split = False
        for item in plan.bl_rna.properties["layers"].enum_items:
            flow.prop_enum(plan, "layers", item.identifier)
        field(column, plan.inspect, "heat")
        field(column, plan.inspect, "labels")
        column = layout.column(align=True)
        button(column, "save_picture")
        button(column, "taxel_mesh")
        if taxel_mesh.is_of_another_fit(plan.id_data):
            show_text(layout, "Of another fit: make it again", "INFO")
        if plan.inspect.heat == "FORCE" and not plan.inspect.replay.file:
            show_text(layout, "Open a recording below", "INFO")


class SKIN_PT_inspect_taxel(InspectPanel, bpy.types.Panel):
    bl_label = "Taxel"
    bl_parent_id = "SKIN_PT_inspect"

    def draw_plan(self, layout, plan):
        taxel = plan.inspect.taxel
        row = buttons(layout)
        button(row, "taxel")
        button(row, "taxel_toggle")
        field(layout, taxel, "wanted", icon="VIEWZOOM")
        show_text(layout, taxel.problem, "ERROR")
        if not taxel.id:
            return
        if taxel.key != plan.result.key:
            show_text(layout, "Of another fit: read it again", "INFO")
        if taxel.disabled:
            layout.label(text="Disabled", icon="HIDE_ON")
        row = buttons(layout)
        button(row, "taxel_toggle", text="Enable" if taxel.disabled else "Disable", icon="NONE", taxel=taxel.id)
        button(row, "taxel_channel", icon="NONE", taxel=taxel.id)
        column = layout.column(align=True)
        column.enabled = False
        for name in ("id", "channel", "index", "position", "normal"):
            field(column, taxel, shown(taxel, name))
        area = taxel.area * (1e3 * metres_per_unit(bpy.context.scene)) ** 2
        show_text(column, f"Area: {area:.1f} mm²", "NONE")
        if taxel.has_strain:
            for name in ("strain_along", "strain_across", "shear"):
                field(column, taxel, name)
        if taxel.has_tilt:
            field(column, taxel, "tilt")
        show_text(layout, f"Neighbours: {taxel.neighbours}" if taxel.neighbours else "No neighbours", "NONE")


class SKIN_PT_inspect_compare(InspectPanel, bpy.types.Panel):
    bl_label = "Compare"
    bl_parent_id = "SKIN_PT_inspect"

    def draw_plan(self, layout, plan):
        draw_comparison(layout, plan.inspect.comparison, plan, "compare")


class SKIN_UL_touches(bpy.types.UIList):
    """Touches, the one with the largest distance first; click one to see it"""

    def draw_item(self, _context, layout, _data, touch, _icon, _active, _property, _index):
        layout.label(text=touch.words, icon="ERROR" if touch.far else "NONE")


class SKIN_PT_inspect_touches(InspectPanel, bpy.types.Panel):
    bl_label = "Touches"
    bl_parent_id = "SKIN_PT_inspect"

    def draw_plan(self, layout, plan):
        found = plan.inspect.touches
        draw_comparison(layout, found, plan, "touches")
        if not found.file:
            return
        if found.key == plan.result.key:
            layout.template_list("SKIN_UL_touches", "", found, "places", found, "chosen", rows=4, sort_lock=True)
        button(layout, "touches_move")


def draw_comparison(layout, found, plan, operator):
    """Draw the buttons that compare with a file and end that, which file it was, and what was found."""
    row = layout.row(align=True)
    button(row, operator, space=ICON_WIDTH)
    if not found.file:
        return
    symbol(row, f"{operator}_end")
    if found.key != plan.result.key:
        show_text(layout, "Of another fit: compare again", "INFO")
    show_text(layout, comparing.name_of(found.file), "FILE")
    for warning in found.warnings:
        show_warning(layout, warning)
    for line in found.remarks.splitlines():
        show_text(layout, line, "DOT")


class SKIN_PT_inspect_replay(InspectPanel, bpy.types.Panel):
    bl_label = "Replay"
    bl_parent_id = "SKIN_PT_inspect"

    def draw_plan(self, layout, plan):
        record, link = plan.inspect.replay, plan.id_data
        row = layout.row(align=True)
        button(row, "replay_open", space=ICON_WIDTH)
        if not record.file:
            return
        symbol(row, "replay_close")
        show_text(layout, comparing.name_of(record.file), "FILE")
        if replay.find(link) is None:
            show_text(layout, "Of another fit: open it again", "INFO")
            return
        playing = replay.is_playing(link)
        row = layout.row(align=True)
        button(row, "replay_play", text="Pause" if playing else "Play", icon="PAUSE" if playing else "PLAY")
        row.prop(record, "loop", text="", icon="FILE_REFRESH", toggle=True)
        column = layout.column(align=True)
        field(column, record, "progress", slider=True)
        field(column, record, "frame")
        field(column, record, "speed")
        for line in replay.messages.get(record.token, ()):
            show_text(layout, line, "NONE")


class SKIN_PT_inspect_sizes(InspectPanel, bpy.types.Panel):
    bl_label = "Sizes"
    bl_parent_id = "SKIN_PT_inspect"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_plan(self, layout, plan):
        looks = plan.inspect
        field(layout, looks, "auto_length")
        if not looks.auto_length:
            field(layout, looks, shown(looks, "length"))
        field(layout, looks, "text_size")
        field(layout, looks, "line_width")
