# SPDX-License-Identifier: GPL-3.0-or-later
"""Which part of the mesh is covered."""

import bpy

from ..skin_calib_addon.blender.scene import cut_away
from ..skin_calib_addon.blender.scene.plans import shown_index, surface_names
from ..skin_calib_addon.common.errors import counted
from .base import Step, button, draw_plane, is_narrow, surfaces_figure, symbol, what_is_wrong

MAX_ROWS = 5  # of the list
# A unit normal whose largest component is above this is along an axis.
AXIS_COMPONENT = 0.9999


class SKIN_UL_cuts(bpy.types.UIList):
    """Cuts, one in a row: which side it keeps, and its buttons"""

    def draw_item(self, _context, layout, cover, cut, _icon, _active, _property, index):
        row = layout.row(align=True)
        wrong = what_is_wrong(cover, "CUT", index)
        row.alert = bool(wrong)
        words = ("Cut", str(index), "keeps", kept_side(cut.normal))
        row.label(text=" ".join(words[1::2] if is_narrow() else words), icon="ERROR" if wrong else "NONE")
        symbol(row, "cut_flip", emboss=False, index=index)
        symbol(row, "cut_remove", emboss=False, index=index)


def kept_side(normal):
    """Return the axis that a normal points along, in words."""
    largest = max(range(3), key=lambda i: abs(normal[i]))
    if not normal[largest]:
        return "nothing: no normal"
    length = sum(x * x for x in normal) ** 0.5
    about = "" if abs(normal[largest]) > AXIS_COMPONENT * length else "about "
    return f"{about}{'-' if normal[largest] < 0 else '+'}{'XYZ'[largest]}"


class CutStep(Step):
    label = "Cut"
    name = "cut"

    def figure(self, plan):
        cuts = len(plan.cover.cuts)
        shell = plan.cover.bl_rna.properties["shell"].enum_items[plan.cover.shell].name
        return surfaces_figure(plan) or (f"{shell}, {counted(cuts, 'cut')}" if cuts else shell)

    def draw_plan(self, layout, plan):
        self.draw_surfaces(layout, plan)
        cover, cuts = plan.cover, plan.cover.cuts
        layout.row().prop(cover, "shell", expand=True)
        if cuts:
            rows = min(len(cuts), MAX_ROWS)
            layout.template_list("SKIN_UL_cuts", "", cover, "cuts", cover, "cut_index", rows=rows, sort_lock=True)
        if cover.cut_index < len(cuts):
            draw_plane(layout, cuts[cover.cut_index], what_is_wrong(cover, "CUT", cover.cut_index))
        row = layout.row(align=True)
        button(row, "cut_add")
        symbol(row, "cut_place")
        column = layout.column(align=True)
        button(column, "cut_away")
        if cut_away.modifier_of(plan.id_data):
            button(column, "bring_back")

    def draw_surfaces(self, layout, plan):
        """Draw the names of the surfaces, the one that the panels show pressed; of a single one only the button Add."""
        names, shown = surface_names(plan), shown_index(plan)
        if len(names) == 1:
            button(layout, "surface_add")
            return
        column = layout.column(align=True)
        for k, name in enumerate(names):
            button(column, "surface_show", text=name, icon="NONE", depress=k == shown, index=k)
        row = layout.row(align=True)
        row.prop(plan, "surface_name", **{"text": ""} if is_narrow() else {})
        symbol(row, "surface_add")
        symbol(row, "surface_remove")
