# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators have in common: when they are available, how they refuse, and how an edit of a plan ends."""

import bpy

from ..skin_calib_addon.blender.live import updates
from ..skin_calib_addon.blender.scene import link_objects, results
from ..skin_calib_addon.blender.session import session
from ..skin_calib_addon.common.errors import SkinCalibError

INDEX = {"min": 0, "options": {"HIDDEN"}}  # options of a property that says which entry of a list


def no_mesh(context):
    """Return why the active object is not a mesh of this file."""
    return link_objects.why_not(context.object, named=False)


def no_link(context):
    """Return why the active object is not such a mesh with a link name."""
    return link_objects.why_not(context.object)


def no_fit(context):
    """Return why the active link has no fit."""
    return "" if results.find(context.object.skin_calib.result.key) else "Fit the link first"


def not_editable(context):
    """Return why the mesh of the active object cannot be edited."""
    return link_objects.why_not_editable(context.object)


def busy(_context):
    """Return that another computation runs."""
    return f"Wait for the work on {session.busy.name}, or press Esc to stop it" if session.busy else ""


class Operator(bpy.types.Operator):
    """Acts, or reports why it refuses and leaves the scene as it was. The name of its class gives its id."""

    bl_options = {"REGISTER", "UNDO"}
    # Functions of the context that return why the operator is not available; Blender shows the first reason.
    blocked_by = ()

    def __init_subclass__(cls):
        super().__init_subclass__()
        cls.bl_idname = cls.__name__.replace("SKIN_OT_", "skin_calib.")

    @classmethod
    def poll(cls, context):
        reason = next(filter(None, (why(context) for why in cls.blocked_by)), "")
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def act(self, context):
        """Do it; return the result for Blender where that is not {"FINISHED"}."""
        raise NotImplementedError

    def execute(self, context):
        try:
            return self.act(context) or {"FINISHED"}
        except SkinCalibError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}


class Edit:
    """Changes the plan of the active object in one step of undo."""

    blocked_by = (no_mesh,)

    def act(self, context):
        plan = context.object.skin_calib
        self.edit(context, plan)
        plan.result.outdated = True


class Followed(Edit):
    """Changes a plan so that the skin follows, although Live is off."""

    is_waiting = False  # for clicks: the skin follows also Ctrl-Z between them

    def execute(self, context):
        done = super().execute(context)
        if not self.is_waiting:
            updates.leave(context.object.session_uid)
        return done

    def begin(self, context):
        self.is_waiting = True
        updates.accompany(context.object)

    def end(self, context):
        super().end(context)
        updates.leave(self.uid)


class OnSkin:
    """Works on one skin of the plan."""

    skin: bpy.props.IntProperty(name="Skin", description="Which skin, from 0", **INDEX)


class KeepsLink:
    """Works on the link for which its file browser was opened, whatever is active once the file is chosen."""

    subject: bpy.props.StringProperty(
        name="Object", description="The link; empty: the active one", options={"HIDDEN", "SKIP_SAVE"}
    )

    def invoke(self, context, event):
        self.subject = context.object.name
        return super().invoke(context, event)

    def execute(self, context):
        link = bpy.data.objects.get(self.subject) if self.subject else context.object
        if link is None:
            self.report({"ERROR"}, f"{self.subject} was removed or renamed in the meantime. Start again.")
            return {"CANCELLED"}
        with context.temp_override(object=link, active_object=link):
            return super().execute(context)
