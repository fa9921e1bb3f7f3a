# SPDX-License-Identifier: GPL-3.0-or-later
"""All links of the scene, the state of each, and what is done for all of them."""

import json

import bpy

from ..skin_calib_addon.blender.scene import robots
from ..skin_calib_addon.blender.scene.preferences import preferences
from ..skin_calib_addon.blender.scene.skin_choice import SIZES, in_words
from ..skin_calib_addon.blender.session import session
from ..skin_calib_addon.common.errors import counted
from .base import Step, button, buttons, field, show_text
from .status import misplaced

MAX_ROWS = 8  # of the list. Larger: the panels below it move down.


def state_of(link):
    """Return the state of a link: in a few words, its icon, and the reason of a refusal."""
    settings, note = link.skin_calib, session.of(link).report
    result, warnings = settings.result, len(settings.result.warnings) + len(misplaced(link))
    if session.progress_of(link) is not None:
        return "in progress", "SORTTIME", ""
    if note and note.problem:
        return "refused", "CANCEL", note.problem
    if result.key and result.outdated:
        return "changed after its fit", "FILE_REFRESH", ""
    if result.key and warnings:
        return f"fitted, {counted(warnings, 'warning')}", "ERROR", ""
    if result.key:
        return "fitted", "CHECKMARK", ""
    if settings.skins:
        return "proposed" if settings.proposed else "has a plan", "OUTLINER_DATA_LATTICE", ""
    if settings.refusal:
        return "refused", "CANCEL", settings.refusal
    return "no plan", "REMOVE", ""


class SKIN_UL_links(bpy.types.UIList):
    """Links, one in a row: its name, the icon of its state, and the number of its warnings"""

    def draw_item(self, _context, layout, _data, link, _icon, _active, _property, _index):
        words, icon, _ = state_of(link)
        layout.label(text=link.skin_calib.link)
        state = layout.row()
        state.alignment = "RIGHT"
        state.label(text="".join(c for c in words if c.isdigit()), icon=icon)

    def filter_items(self, _context, data, name):
        objects = getattr(data, name)
        shown = [self.bitflag_filter_item * robots.is_listed(thing) for thing in objects]
        wanted = self.filter_name.lower()
        if wanted:
            shown = [flag * (wanted in o.skin_calib.link.lower()) for flag, o in zip(shown, objects)]
        return shown, []


class RobotStep(Step):
    label = "Robot"
    name = "robot"

    def states(self, _plan):
        return bpy.context.scene.skin_calib

    def draw(self, layout, plan):
        if len(listed()) > 1:
            super().draw(layout, plan)

    def fitted(self):
        """Return for each link whether it is fitted as it is."""
        return [super(RobotStep, self).is_done(link.skin_calib) for link in listed()]

    def is_done(self, _plan):
        return all(self.fitted())

    def figure(self, _plan):
        fitted = self.fitted()
        return f"{sum(fitted)} of {len(fitted)} fitted"

    def draw_plan(self, layout, plan):
        scene, link = bpy.context.scene, bpy.context.object
        rows = min(len(listed()), MAX_ROWS)
        names = "SKIN_UL_links", "", scene, "objects", scene.skin_calib, "row"
        layout.template_list(*names, rows=rows, maxrows=rows)
        if link is not None and robots.is_listed(link):
            words, icon, reason = state_of(link)
            reason = "" if link.type == "MESH" else reason  # that of a mesh is in the state above
            show_text(layout, f"{link.skin_calib.link}: {words}{'. ' * bool(reason)}{reason}", icon)
        draw_choice(layout)
        row = buttons(layout)
        button(row, "propose_all", icon="NONE")
        button(row, "fit_all", icon="NONE")
        button(layout, "copy_to_mirror")
        row = buttons(layout)
        button(row, "keep_free")
        button(row, "zones_save")
        button(layout, "export_robot")


class ReasonsStep(Step):
    label = "Proposal"
    name = "reasons"

    def draw(self, layout, plan):
        if plan.proposed:
            super().draw(layout, plan)

    def figure(self, plan):
        return plan.proposed_area

    def draw_plan(self, layout, plan):
        for reason in json.loads(plan.extra or "{}").get("x_proposal", ()):
            show_text(layout, str(reason), "DOT")


def draw_choice(layout):
    """Draw the skin that is proposed: its kind and its size, or that of the preferences."""
    choice, column = bpy.context.scene.skin_calib, layout.column(align=True)
    field(column, choice, "skin_kind")
    for name, label in SIZES[choice.skin_kind].items():
        field(column, choice, name, text=label)
    if choice.skin_kind == "usual":
        show_text(column, in_words(preferences().skin), "NONE")


def listed():
    """Return the links of the list."""
    return [thing for thing in bpy.context.scene.objects if robots.is_listed(thing)]
