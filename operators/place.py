# SPDX-License-Identifier: GPL-3.0-or-later
"""Move a point of a skin: to a click on the link, to the 3D cursor, or to a given point."""

import bpy

from ..skin_calib_addon.blender.scene import points_on_link, skins
from .base import INDEX, Edit, OnSkin, Operator
from .picking import POINT, Picking


class Place(OnSkin, Edit):
    """Sets the origin of a skin, or the point of one of its landmarks or zones."""

    what: bpy.props.EnumProperty(
        name="What",
        description="Which point of the skin",
        items=[
            ("origin", "Origin", "Where the centre of cell (0, 0) lies"),
            ("landmark", "Landmark", "Where a cell is pinned"),
            ("zone", "Excluded Zone", "Centre of a zone that boards must not cover"),
        ],
        options={"HIDDEN"},
    )
    index: bpy.props.IntProperty(name="Index", description="Which landmark or zone, from 0", **INDEX)

    def put(self, plan, point):
        """Set the point, in the link frame in scene units."""
        skins.put_point(plan, self.what, self.skin, self.index, point)


class SKIN_OT_place_at_cursor(Place, Operator):
    """Move this point to the 3D cursor"""

    bl_label = "Place at 3D Cursor"

    def edit(self, context, plan):
        self.put(plan, points_on_link.cursor_on(context.object, context.scene))


class SKIN_OT_place(Picking, Place, Operator):
    """Click on the link to move this point there; Esc leaves it where it is"""

    bl_label = "Place on Link"

    point: bpy.props.FloatVectorProperty(name="Point", description="Where the point lies, in the link frame", **POINT)

    def edit(self, context, plan):
        self.put(plan, self.point)

    prompts = ("Click on the link to move the point there    Esc: leave it",)

    def check(self, context):
        super().check(context)
        skins.point_of(context.object.skin_calib, self.what, self.skin, self.index)
