# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the skin of the active link with touches at known points, and move it there."""

import bpy

from ..skin_calib_addon.blender.inspection import touching
from .files import LooksAtFile
from .on_link import Edit, KeepsLink, OnLink, OnResult


class SKIN_OT_touches(KeepsLink, OnResult, LooksAtFile, bpy.types.Operator):
    """Compare the taxels of the active link with a table of touches: the strongest taxel, and the probe position"""

    bl_idname = "skin_calib.touches"
    bl_label = "Compare with Touches"

    filter_glob: bpy.props.StringProperty(default="*.csv", options={"HIDDEN"})

    def look(self, context, path):
        found = touching.compare_touches(context.object, path)
        return f"{sum(len(placement.rows) for placement in found)} touches compared"


def why_no_touches(link):
    """Return that a link has no touches, and what to do; empty if it has."""
    return "" if link.skin_calib.inspect.touches.file else "Compare with touches first"


class SKIN_OT_touches_move(OnResult, Edit, bpy.types.Operator):
    """Move the skins of the active link to fit the touches: origins and directions, or landmarks"""

    bl_idname = "skin_calib.touches_move"
    bl_label = "Move Skins There"

    @classmethod
    def why_not(cls, context):
        if reason := super().why_not(context) or why_no_touches(context.object):
            return reason
        return "Fit the link again first" if context.object.skin_calib.result.outdated else ""

    def edit(self, context, plan):
        touching.move_to_touches(context.object, context.scene)


class SKIN_OT_touches_end(OnLink, bpy.types.Operator):
    """Remove these touches"""

    bl_idname = "skin_calib.touches_end"
    bl_label = "Forget Touches"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def why_not(cls, context):
        return super().why_not(context) or why_no_touches(context.object)

    def execute(self, context):
        touching.forget(context.object)
        return {"FINISHED"}


CLASSES = (SKIN_OT_touches, SKIN_OT_touches_move, SKIN_OT_touches_end)
