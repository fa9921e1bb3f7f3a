# SPDX-License-Identifier: GPL-3.0-or-later
"""What all links of a scene have in common, as properties."""

from typing import Any

import bpy
from bpy.props import PointerProperty

from ...proposal.skins import FORMS
from ..scene import robots, skin_choice
from ..scene.link_objects import why_not
from .of_keys import tooltip
from .options import flag, text, whole


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
    )
    robot: flag(name="Robot", description="Whether Robot is open", default=True)
    row: whole(
        name="Link",
        description="The link of the selected row; it becomes active, and the view shows it",
        get=lambda robot: robots.active_row(robot.id_data),
        set=lambda robot, index: robots.select_row(robot.id_data, index),
    )


SKIN_PG_robot.__annotations__ |= skin_choice.fields_of(is_scene=True)


def register():
    """Give every scene what its links have in common."""
    bpy.types.Scene.skin_calib = PointerProperty(
        type=SKIN_PG_robot, name="Skin", description="What all links have in common"
    )


def unregister():
    """Remove it from scenes; files keep it."""
    del bpy.types.Scene.skin_calib
