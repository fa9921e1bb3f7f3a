# SPDX-License-Identifier: GPL-3.0-or-later
"""Preferences of the extension: colours and sizes of what is drawn, and the skin that is proposed."""

from typing import Any

import bpy
from bpy.props import FloatProperty, FloatVectorProperty, StringProperty

from ...common.colours import GREEN, SKY, VERMILLION, VIOLET, WHITE, YELLOW
from ...common.errors import InvalidPlan
from ...plan.skins import BoardSkin
from ...proposal.skins import DEFAULT_SKIN, FORMS, SkinChoice, parse_skin
from .skin_choice import SIZES, fields_of

PACKAGE = __package__.partition(".skin_calib_addon")[0]
# Lines that have a colour, and their first colour.
COLOURS = {
    "sections": ("Sections", (*YELLOW[:3], 0.9)),
    "lines": ("V-Lines", (*GREEN[:3], 0.9)),
    "net": ("Net", (*VIOLET[:3], 0.9)),
    "surface": ("Surface", (*SKY[:3], 0.6)),
    "cells": ("Cells", (*WHITE[:3], 0.9)),
    "normals": ("Normals", VERMILLION),
}


def redraw(_preferences: Any, context: bpy.types.Context) -> None:
    """Draw the views again."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            area.tag_redraw()


def _colour(label: str, first: tuple[float, ...]) -> Any:
    words = {"name": label, "description": f"Colour of {label}", "subtype": "COLOR_GAMMA"}  # as it is drawn
    return FloatVectorProperty(size=4, default=first, min=0, max=1, update=redraw, **words)


class SKIN_AP_preferences(bpy.types.AddonPreferences):
    """Shown below the extension in Edit > Preferences > Add-ons."""

    bl_idname = PACKAGE

    def draw(self, _context):
        """Draw colours, sizes and the skin."""
        layout = self.layout
        layout.use_property_split = True
        column = layout.column(align=True)
        column.prop(self, "skin_kind")
        for name, label in SIZES[self.skin_kind].items():
            column.prop(self, name, text=label)
        layout.prop(self, "line_width")
        layout.prop(self, "text_size")
        column = layout.column(heading="Colours")
        for name in COLOURS:
            column.prop(self, name)


SKIN_AP_preferences.__annotations__ = {
    **{name: _colour(label, first) for name, (label, first) in COLOURS.items()},
    "skin": StringProperty(
        name="Skin",
        description=f"Skin that is proposed in scenes that state none. {FORMS.removesuffix('.')}",
        default=DEFAULT_SKIN,
    ),
    **fields_of(is_scene=False),
    "line_width": FloatProperty(
        name="Line Width",
        description="Width of all lines, as a factor",
        default=1.0,
        min=0.25,
        max=10,
        update=redraw,
    ),
    "text_size": FloatProperty(
        name="Text Size", description="Size of all labels, as a factor", default=1.0, min=0.5, max=5, update=redraw
    ),
}


def preferences() -> SKIN_AP_preferences:
    """Return the preferences of the extension."""
    found: SKIN_AP_preferences = bpy.context.preferences.addons[PACKAGE].preferences
    return found


def chosen_skin(scene: bpy.types.Scene) -> SkinChoice:
    """Return the skin that is proposed in a scene; raise InvalidPlan, in words of the window, if it cannot be read."""
    try:
        return parse_skin(bpy.path.abspath(scene.skin_calib.skin or preferences().skin))
    except InvalidPlan as error:
        raise InvalidPlan(str(error).replace(FORMS, "Choose kind and size of the Proposed Skin.")) from error


def chosen_boards(scene: bpy.types.Scene) -> BoardSkin:
    """Return the boards that are proposed in a scene; the usual ones where other skins are."""
    for choice in (chosen_skin(scene), parse_skin(DEFAULT_SKIN)):
        if isinstance(choice.template, BoardSkin):
            return choice.template
    raise AssertionError(DEFAULT_SKIN)
