# SPDX-License-Identifier: GPL-3.0-or-later
"""Base classes of operators on a link: when they are available, and how an edit of its plan ends."""

import bpy

from ..skin_calib_addon.blender.scene import link_objects, results
from ..skin_calib_addon.common.errors import SkinCalibError


class Available:
    """Available unless there is a reason why not, which Blender shows at the button."""

    @classmethod
    def poll(cls, context):
        reason = cls.why_not(context)
        if reason:
            cls.poll_message_set(reason)
        return not reason


class Refusing:
    """Acts, or reports why it refuses and leaves the scene as it was."""

    def execute(self, context):
        try:
            self.act(context)
        except SkinCalibError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class OnMesh(Available):
    """Works on the active object if it is a mesh of this file."""

    @classmethod
    def why_not(cls, context):
        return link_objects.why_no_link(context, named=False)


class OnLink(Available):
    """Works on the active object if it also has a link name."""

    @classmethod
    def why_not(cls, context):
        return link_objects.why_no_link(context)


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


class OnResult(OnLink):
    """Works on the active link once it is fitted."""

    @classmethod
    def why_not(cls, context):
        has_result = context.object and results.find(context.object.skin_calib.result.key)
        return super().why_not(context) or ("" if has_result else "Fit the link first")


class Edit(Refusing, OnMesh):
    """Changes the plan of the active object in one step of undo."""

    bl_options = {"REGISTER", "UNDO"}

    def act(self, context):
        plan = context.object.skin_calib
        self.edit(context, plan)
        plan.result.outdated = True
