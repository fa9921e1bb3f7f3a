# SPDX-License-Identifier: GPL-3.0-or-later
"""Points that the author picks on the link with the mouse."""

from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d

from ..skin_calib_addon.blender import scene
from ..skin_calib_addon.blender.options import PLACE
from ..skin_calib_addon.errors import SkinCalibError

# What moves the view, and no more.
NAVIGATION = {"MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "TRACKPADPAN", "TRACKPADZOOM", "MOUSEROTATE", "TIMER"}
# Of a property that holds a picked point; it is no part of the plan.
POINT = {name: value for name, value in PLACE.items() if name not in ("update", "options")}


class Picking:
    """An operator that is invoked to click on the active link, once for each prompt, and then executes."""

    prompts = ()  # what the status bar says before each click

    def check(self, context):
        """Raise a SkinCalibError where clicks would come to nothing."""

    def take(self, points):
        """Set the operator's properties from the points, in the link frame in Blender units."""
        raise NotImplementedError

    def invoke(self, context, event):
        try:
            self.check(context)
            scene.check_seen(context.object)
        except SkinCalibError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.link, self.picked = context.object.name, []
        context.window.cursor_modal_set("EYEDROPPER")
        context.workspace.status_text_set(self.prompts[0])
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type in NAVIGATION or event.type.startswith(("NUMPAD_", "NDOF_")):
            return {"PASS_THROUGH"}
        gone = context.object is None or context.object.name != self.link
        if gone or event.type in {"ESC", "RIGHTMOUSE"}:
            self.end(context)
            return {"CANCELLED"}
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            return self.click(context, event)
        return {"RUNNING_MODAL"}

    def click(self, context, event):
        """Take the point under the mouse; with the last one, execute."""
        point = point_under(context, event.mouse_x, event.mouse_y)
        if point is None:
            self.report({"WARNING"}, f"{self.link} is not under the mouse: click on it, or press Esc")
            return {"RUNNING_MODAL"}
        self.picked.append(point)
        if len(self.picked) < len(self.prompts):
            context.workspace.status_text_set(self.prompts[len(self.picked)])
            return {"RUNNING_MODAL"}
        self.end(context)
        self.take(self.picked)
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
    ray = ray_under(context, x, y)
    return scene.point_on(context.object, context.evaluated_depsgraph_get(), *ray) if ray else None


def ray_under(context, x, y):
    """Start and way, in the world, of the ray from the eye through a pixel of the window; None outside of 3D views."""
    region = view_at(context.window, x, y)
    if region is None:
        return None
    pixel = x - region.x, y - region.y
    return region_2d_to_origin_3d(region, region.data, pixel), region_2d_to_vector_3d(region, region.data, pixel)


def view_at(window, x, y):
    """The region of a 3D view that a pixel of the window shows; None under a sidebar or a header, and outside."""
    for area in window.screen.areas:
        if area.type == "VIEW_3D":
            under = [r for r in area.regions if 0 <= x - r.x < r.width and 0 <= y - r.y < r.height]
            views = [r for r in under if r.type == "WINDOW"]
            if views and all(r.type in ("WINDOW", "TOOLS") for r in under):  # the tools' region is mostly empty
                return views[0]
    return None
