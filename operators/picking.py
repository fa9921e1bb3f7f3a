# SPDX-License-Identifier: GPL-3.0-or-later
"""Points that the author picks on the link with the mouse."""

import bpy

from ..skin_calib_addon.blender.scene import points_on_link
from ..skin_calib_addon.blender.scene.points_on_link import point_under
from ..skin_calib_addon.common.errors import SkinCalibError

# Events that only move the view.
NAVIGATION = {"MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "TRACKPADPAN", "TRACKPADZOOM", "MOUSEROTATE", "TIMER"}
# Options of a property for a point and a direction in the link frame; the next call does not start with them.
POINT = {"subtype": "TRANSLATION", "unit": "LENGTH", "precision": 5, "options": {"SKIP_SAVE"}}
NORMAL = {"subtype": "XYZ", "precision": 5, "options": {"SKIP_SAVE"}}


class AtCursor:
    """Uses a point that is at the 3D cursor first; the panel of the last operation changes it."""

    point: bpy.props.FloatVectorProperty(name="Point", description="Where it is, in the link frame", **POINT)

    def start(self, context):
        """Set the point to the 3D cursor, unless it is given."""
        if not self.properties.is_property_set("point"):
            self.point = points_on_link.cursor_on(context.object, context.scene)
        return self.point


def is_navigation(event):
    """Return whether an event only moves the view."""
    is_number = event.type.startswith(("NUMPAD_", "NDOF_")) and event.type != "NUMPAD_ENTER"
    return event.type in NAVIGATION or is_number


class Picking:
    """An operator that asks for a click on the active link for each prompt, with an eyedropper, and then executes."""

    prompts = ()  # text of the status bar before each click
    at_mouse: bpy.props.BoolProperty(
        name="At Mouse",
        description="Use the point under the mouse, as a tool does, instead of asking for a click",
        options={"HIDDEN", "SKIP_SAVE"},
    )
    what = ""  # is picked; empty: a point of the link
    repeats = False  # whether it executes after each click, in an undo step each, until Esc or Return

    def check(self, context):
        """Raise a SkinCalibError where clicks would have no effect."""
        points_on_link.check_seen(context.object)

    def begin(self, context):
        """Prepare for clicks, which are possible now."""

    def end(self, context):
        """Restore the cursor and the status bar."""
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)

    def cancel(self, context):
        """End because Blender opens a file, or quits."""
        self.end(context)

    def take(self, points):
        """Set the operator's properties from what was picked: one point, unless an operator has more."""
        (self.point,) = points

    def under_mouse(self, context, event):
        """Return what is picked under the mouse: a point in the link frame in scene units; None without one."""
        return point_under(context, event.mouse_x, event.mouse_y)

    def invoke(self, context, event):
        try:
            self.check(context)
        except SkinCalibError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.uid, self.picked = context.object.session_uid, []
        if self.at_mouse:
            return self.click(context, event)
        self.begin(context)
        context.window.cursor_modal_set("EYEDROPPER")
        context.workspace.status_text_set(self.prompts[0])
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if is_navigation(event):
            return {"PASS_THROUGH"}
        if self.repeats and event.type == "Z" and (event.ctrl or event.oskey):
            return {"PASS_THROUGH"}  # Blender undoes or redoes the last click
        is_over = not self.poll(context) or context.object.session_uid != self.uid
        if is_over or event.type in {"ESC", "RIGHTMOUSE"} or self.repeats and event.type in {"RET", "NUMPAD_ENTER"}:
            self.end(context)
            return {"CANCELLED"}  # each click has its own undo step
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            return self.click(context, event)
        return {"RUNNING_MODAL"}

    def click(self, context, event):
        """Use the point under the mouse; after the last one, execute."""
        point = self.under_mouse(context, event)
        if point is None:
            ending = "" if self.at_mouse else ", or press Esc"
            self.report({"WARNING"}, f"{self.what or context.object.name} is not under the mouse: click on it{ending}")
            return {"CANCELLED"} if self.at_mouse else {"RUNNING_MODAL"}
        self.picked.append(point)
        if self.at_mouse:
            self.take(self.picked)
            return self.execute(context)
        if len(self.picked) < len(self.prompts):
            context.workspace.status_text_set(self.prompts[len(self.picked)])
            return {"RUNNING_MODAL"}
        self.take(self.picked)
        if not self.repeats:
            self.end(context)
            return self.execute(context)
        self.picked = []
        if self.execute(context) == {"FINISHED"}:
            bpy.ops.ed.undo_push(message=self.bl_label)
        return {"RUNNING_MODAL"}
