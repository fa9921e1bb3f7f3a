# SPDX-License-Identifier: GPL-3.0-or-later
"""Put a point of a skin on the link: by a click, at the 3D cursor, or at a point that is given."""

import bpy
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d

from ..skin_calib_addon.blender import scene
from ..skin_calib_addon.blender.options import PLACE
from ..skin_calib_addon.errors import SkinCalibError
from .lists import INDEX, OnSkin
from .on_link import Edit, entry

# What moves the view, and no more.
NAVIGATION = {"MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "TRACKPADPAN", "TRACKPADZOOM", "MOUSEROTATE", "TIMER"}


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

    def target(self, plan):
        """The skin, landmark or zone whose point it is."""
        if self.what == "landmark":
            return entry(self.of_kind(plan, "sheet", "landmarks").landmarks, self.index, "landmark")
        if self.what == "zone":
            return entry(self.of_kind(plan, "hexagons", "excluded zones").excluded, self.index, "excluded zone")
        return entry(plan.skins, self.skin, "skin")

    def put(self, plan, point):
        """Set the point, in the link frame in Blender units."""
        target = self.target(plan)
        if self.what == "origin":
            target.origin, target.centred = point, False
        else:
            target.point = point


class SKIN_OT_place_at_cursor(Place, bpy.types.Operator):
    """Put this point where the 3D cursor is"""

    bl_idname = "skin_calib.place_at_cursor"
    bl_label = "Place at 3D Cursor"

    def edit(self, context, plan):
        self.put(plan, scene.cursor_on(context.object, context.scene))


class SKIN_OT_place(Place, bpy.types.Operator):
    """Click on the link where this point is to lie; Esc leaves it where it is"""

    bl_idname = "skin_calib.place"
    bl_label = "Place on Link"

    point: bpy.props.FloatVectorProperty(
        name="Point",
        description="Where the point lies, in the link frame",
        **{name: value for name, value in PLACE.items() if name not in ("update", "options")},
    )

    def edit(self, context, plan):
        self.put(plan, self.point)

    def invoke(self, context, event):
        try:
            self.target(context.object.skin_calib)
            scene.check_seen(context.object)
        except SkinCalibError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.link = context.object.name
        context.window.cursor_modal_set("EYEDROPPER")
        context.workspace.status_text_set("Click on the link: the point goes there    Esc: leave it")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type in NAVIGATION or event.type.startswith(("NUMPAD_", "NDOF_")):
            return {"PASS_THROUGH"}
        gone = context.object is None or context.object.name != self.link
        if gone or event.type in {"ESC", "RIGHTMOUSE"}:
            self.end(context)
            return {"CANCELLED"}
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"RUNNING_MODAL"}
        point = point_under(context, event.mouse_x, event.mouse_y)
        if point is None:
            self.report({"WARNING"}, f"{self.link} is not under the mouse: click on it, or press Esc")
            return {"RUNNING_MODAL"}
        self.end(context)
        self.point = point
        return self.execute(context)

    def cancel(self, context):
        """Blender opens a file, or quits."""
        self.end(context)

    def end(self, context):
        """Give the mouse and the status bar back."""
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)


def point_under(context, x, y):
    """Where the active link is under a pixel of the window, in its frame in Blender units; None where it is not."""
    region = view_at(context.window, x, y)
    if region is None:
        return None
    pixel = x - region.x, y - region.y
    start = region_2d_to_origin_3d(region, region.data, pixel)
    way = region_2d_to_vector_3d(region, region.data, pixel)
    return scene.point_on(context.object, context.evaluated_depsgraph_get(), start, way)


def view_at(window, x, y):
    """The region of a 3D view that a pixel of the window shows; None under a sidebar or a header, and outside."""
    for area in window.screen.areas:
        if area.type == "VIEW_3D":
            under = [r for r in area.regions if 0 <= x - r.x < r.width and 0 <= y - r.y < r.height]
            views = [r for r in under if r.type == "WINDOW"]
            if views and all(r.type in ("WINDOW", "TOOLS") for r in under):  # the tools' region is mostly empty
                return views[0]
    return None


CLASSES = (SKIN_OT_place_at_cursor, SKIN_OT_place)
