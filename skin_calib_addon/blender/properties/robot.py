# SPDX-License-Identifier: GPL-3.0-or-later
"""What all links of a scene have in common, as properties."""

from typing import Any

import bpy
from bpy.props import PointerProperty

from ...proposal.skins import FORMS
from ..scene import robots
from ..scene.link_objects import why_not
from .of_keys import tooltip
from .options import flag, text, whole

# Skins of the field, with a hint: those that laboratories have.
PRESETS = (
    ("hexagons", "boards of TUM, sides of 16.3 mm"),
    ("hexagons:8mm", "small boards"),
    ("sheet:6x22x10mm", "sheet of AIST, 6 rows of 22 taxels"),
)


def _presets(_robot: Any, _context: Any, text: str) -> list[tuple[str, str]]:
    """Return the presets that contain what was typed; all of them for a complete preset."""
    names = [name for name, _ in PRESETS]
    return [(name, hint) for name, hint in PRESETS if text in names or text.lower() in name]


def _skin_changed(robot: Any, _context: Any) -> None:
    """Remove the refusals of proposals: they are about another skin."""
    for link in robot.id_data.objects:
        if not why_not(link):
            link.skin_calib.refusal = ""


class SKIN_PG_robot(bpy.types.PropertyGroup):
    """Settings of the scene."""

    skin: text(
        name="Skin",
        description=f"Skin that is proposed for links; empty: that of the preferences. {tooltip(FORMS)}",
        update=_skin_changed,
        search=_presets,
        search_options={"SUGGESTION"},
    )
    robot: flag(name="Robot", description="Whether Robot is open", default=True)
    row: whole(
        name="Link",
        description="The link of the selected row; it becomes active, and the view shows it",
        get=lambda robot: robots.active_row(robot.id_data),
        set=lambda robot, index: robots.select_row(robot.id_data, index),
    )


def register():
    """Give every scene what its links have in common."""
    bpy.types.Scene.skin_calib = PointerProperty(
        type=SKIN_PG_robot, name="Skin", description="What all links have in common"
    )


def unregister():
    """Remove it from scenes; files keep it."""
    del bpy.types.Scene.skin_calib
