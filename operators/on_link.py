# SPDX-License-Identifier: GPL-3.0-or-later
"""Base classes of operators on a link: when they are available, and how an edit of its plan ends."""

import bpy

from ..skin_calib_addon.blender.scene import link_objects, results
from ..skin_calib_addon.common.errors import SkinCalibError


class OnMesh:
    """Works on the active object if it is a mesh of this file."""

    @classmethod
    def poll(cls, context):
        return cls.says(link_objects.why_no_link(context, named=False))

    @classmethod
    def says(cls, reason):
        """Return whether there is no reason to refuse; Blender shows the reason at the button."""
        if reason:
            cls.poll_message_set(reason)
        return not reason


class OnLink(OnMesh):
    """Works on the active object if it also has a link name."""

    @classmethod
    def poll(cls, context):
        return cls.says(link_objects.why_no_link(context))


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
    def poll(cls, context):
        if not super().poll(context):
            return False
        has_result = results.find(context.object.skin_calib.result.key) is not None
        return cls.says("" if has_result else "Fit the link first")


class Edit(OnMesh):
    """Changes the plan of the active object in one step of undo, or refuses and leaves it as it was."""

    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        plan = context.object.skin_calib
        try:
            self.edit(context, plan)
        except SkinCalibError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        plan.result.outdated = True
        return {"FINISHED"}
