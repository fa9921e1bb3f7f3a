# SPDX-License-Identifier: GPL-3.0-or-later
"""Inspect the fitted skin of the active link: read taxels, compare them with a file, replay recordings."""

import bpy

from ..skin_calib_addon.blender.handles.view import ray_under
from ..skin_calib_addon.blender.inspection import comparing, replay, taxel_mesh, taxels
from .files import LooksAtFile
from .on_link import KeepsLink, OnLink, OnResult, Refusing
from .picking import Clicks, is_navigation


class SKIN_OT_taxel(Clicks, Refusing, OnResult, bpy.types.Operator):
    """Click on taxels to read their values; Esc or Return ends"""

    bl_idname = "skin_calib.taxel"
    bl_label = "Read Taxels"
    bl_options = {"REGISTER", "UNDO"}

    taxel: bpy.props.StringProperty(name="Taxel", description="Id or channel of the taxel")

    def act(self, context):
        self.taxel = taxels.read_taxel(context.object, self.taxel, context.scene)

    def invoke(self, context, event):
        self.uid, self.taxel = context.object.session_uid, ""
        return self.wait(context, "Click on taxels to read them    Esc, Return: end")

    def modal(self, context, event):
        if is_navigation(event):
            return {"PASS_THROUGH"}
        is_over = context.object is None or context.object.session_uid != self.uid or not self.poll(context)
        if is_over or event.type in {"ESC", "RIGHTMOUSE", "RET", "NUMPAD_ENTER"}:
            self.end(context)
            return {"FINISHED"} if self.taxel else {"CANCELLED"}
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            found = taxel_under(context, event.mouse_x, event.mouse_y)
            if found is None:
                self.report({"WARNING"}, "No taxel is under the mouse: click on one, or press Esc")
            else:
                self.taxel = found
                self.execute(context)
        return {"RUNNING_MODAL"}


def taxel_under(context, x, y):
    """Return the id of the active link's taxel under a pixel of the window; None where there is none."""
    ray = ray_under(context, x, y)
    return taxels.taxel_on_ray(context.object, context, *ray) if ray else None


class SKIN_OT_taxel_mesh(OnResult, bpy.types.Operator):
    """Make an object with a face for each taxel, with attributes for Geometry Nodes, materials and the spreadsheet"""

    bl_idname = "skin_calib.taxel_mesh"
    bl_label = "Taxels as Mesh"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        made = taxel_mesh.add_taxel_mesh(context.object, context)
        names = ", ".join(a.name for a in made.data.attributes if a.domain == "FACE" and not a.is_internal)
        self.report({"INFO"}, f"{made.name}: {len(made.data.polygons)} faces with {names}")
        return {"FINISHED"}


class SKIN_OT_compare(KeepsLink, OnResult, LooksAtFile, bpy.types.Operator):
    """Compare the taxels of the active link with those of a calibration or of another program's file"""

    bl_idname = "skin_calib.compare"
    bl_label = "Compare with File"

    filter_glob: bpy.props.StringProperty(default=";".join(f"*{e}" for e in comparing.ENDINGS), options={"HIDDEN"})

    def look(self, context, path):
        found = comparing.compare_with(context.object, path, context.scene)
        return f"{len(found.ours)} taxels paired, {1e3 * found.distances.mean():.4f} mm apart on average"


class SKIN_OT_compare_end(OnLink, bpy.types.Operator):
    """Remove the comparison"""

    bl_idname = "skin_calib.compare_end"
    bl_label = "End Comparison"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def why_not(cls, context):
        reason = super().why_not(context)
        return reason or ("" if context.object.skin_calib.inspect.comparison.file else "Compare with a file first")

    def execute(self, context):
        context.object.skin_calib.inspect.property_unset("comparison")
        return {"FINISHED"}


class SKIN_OT_replay_open(KeepsLink, OnResult, LooksAtFile, bpy.types.Operator):
    """Show a recording over the skin of the active link: a table or an NPZ file of times and readings"""

    bl_idname = "skin_calib.replay_open"
    bl_label = "Open Recording"

    filter_glob: bpy.props.StringProperty(default="*.csv;*.npz", options={"HIDDEN"})

    def look(self, context, path):
        shown = replay.open_recording(context.object, path)
        taxel_mesh.follow_timeline(context.scene)
        return f"{len(shown)} frames, {shown.duration:.2f} s, at most {shown.strongest:.2f} N on a taxel"


class OnRecording(OnLink):
    """Works on the active link while it shows a recording."""

    @classmethod
    def why_not(cls, context):
        reason = super().why_not(context)
        return reason or ("" if context.object.skin_calib.inspect.replay.file else "Open a recording first")


class SKIN_OT_replay_close(OnRecording, bpy.types.Operator):
    """Remove this recording"""

    bl_idname = "skin_calib.replay_close"
    bl_label = "Close Recording"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        replay.close(context.object)
        taxel_mesh.follow_timeline(context.scene)
        return {"FINISHED"}


class SKIN_OT_replay_play(OnRecording, bpy.types.Operator):
    """Play the recording over the skin, or pause it"""

    bl_idname = "skin_calib.replay_play"
    bl_label = "Play"
    bl_options = {"REGISTER"}

    @classmethod
    def why_not(cls, context):
        if reason := super().why_not(context):
            return reason
        return "" if replay.find(context.object) else "Open the recording again: the fit or the file has changed"

    def execute(self, context):
        if replay.is_playing(context.object):
            replay.stop(context.object)
        else:
            replay.play(context.object)
        return {"FINISHED"}


CLASSES = (
    SKIN_OT_taxel,
    SKIN_OT_taxel_mesh,
    SKIN_OT_compare,
    SKIN_OT_compare_end,
    SKIN_OT_replay_open,
    SKIN_OT_replay_close,
    SKIN_OT_replay_play,
)
