# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the skin of the active link with touches at known points, and move it there."""

import bpy

from ..skin_calib_addon.blender.inspection import touching
from .base import Edit, Operator, no_fit, no_link
from .files import LooksAtFile


class SKIN_OT_touches(LooksAtFile, Operator):
    """Compare the taxels of the active link with a table of touches: the strongest taxel, and the probe position"""

    bl_label = "Compare with Touches"

    filter_glob: bpy.props.StringProperty(default="*.csv", options={"HIDDEN"})

    def look(self, context, path):
        found = touching.compare_touches(context.object, path)
        return f"{sum(len(placement.rows) for placement in found)} touches compared"


def no_touches(context):
    """Return that the link has no touches, and what to do."""
    return "" if context.object.skin_calib.inspect.touches.file else "Compare with touches first"


def is_changed(context):
    """Return that the link has changed since its fit."""
    return "Fit the link again first" if context.object.skin_calib.result.outdated else ""


class SKIN_OT_touches_move(Edit, Operator):
    """Move the skins of the active link to fit the touches: origins and directions, or landmarks"""

    bl_label = "Move Skins There"
    blocked_by = (no_link, no_fit, no_touches, is_changed)

    def edit(self, context, plan):
        touching.move_to_touches(context.object, context.scene)


class SKIN_OT_touches_end(Operator):
    """Remove these touches"""

    bl_label = "Forget Touches"
    blocked_by = (no_link, no_touches)

    def act(self, context):
        context.object.skin_calib.inspect.property_unset("touches")
