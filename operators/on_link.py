# SPDX-License-Identifier: GPL-3.0-or-later
"""Base classes of operators on a link: when they are available, and how an edit of its plan ends."""

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
