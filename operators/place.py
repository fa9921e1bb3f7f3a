# SPDX-License-Identifier: GPL-3.0-or-later
"""Put a point of a skin on the link: by a click, at the 3D cursor, or at a point that is given."""

import bpy

from ..skin_calib_addon.blender.scene import scene, skins
from .lists import INDEX, OnSkin
from .on_link import Edit
from .picking import POINT, Picking


class Place(OnSkin, Edit):
    """Sets the origin of a skin, or the point of one of its landmarks or zones."""

    what: bpy.props.EnumProperty(
        name="What",
        description="Which point of the skin",
        items=[
            ("origin", "Origin", "Where the centre of cell (0, 0) lies"),
            ("landmark", "Landmark", "Where a cell is pinned"),
            ("zone", "Excluded Zone", "Middle of a zone that boards keep clear of"),
        ],
        options={"HIDDEN"},
    )
    index: bpy.props.IntProperty(name="Index", description="Which landmark or zone, from 0", **INDEX)

    def put(self, plan, point):
        """Set the point, in the link frame in Blender units."""
        skins.put_point(plan, self.what, self.skin, self.index, point)


class SKIN_OT_place_at_cursor(Place, bpy.types.Operator):
    """Put this point where the 3D cursor is"""

    bl_idname = "skin_calib.place_at_cursor"
    bl_label = "Place at 3D Cursor"

    def edit(self, context, plan):
        self.put(plan, scene.cursor_on(context.object, context.scene))


class SKIN_OT_place(Picking, Place, bpy.types.Operator):
    """Click on the link where this point is to lie; Esc leaves it where it is"""

    bl_idname = "skin_calib.place"
    bl_label = "Place on Link"

    point: bpy.props.FloatVectorProperty(name="Point", description="Where the point lies, in the link frame", **POINT)

    def edit(self, context, plan):
        self.put(plan, self.point)

    prompts = ("Click on the link: the point goes there    Esc: leave it",)

    def check(self, context):
        skins.point_of(context.object.skin_calib, self.what, self.skin, self.index)

    def take(self, points):
        (self.point,) = points


CLASSES = (SKIN_OT_place_at_cursor, SKIN_OT_place)
