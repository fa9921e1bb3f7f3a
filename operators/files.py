# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that the author chooses in the file browser."""

import bpy
from bpy_extras.io_utils import ImportHelper

from ..skin_calib_addon.common.errors import SkinCalibError


class FromFile(ImportHelper):
    """Asks for a file to read; its path may be relative to the .blend."""

    filepath: bpy.props.StringProperty(
        name="File Path",
        description="The file to read",
        subtype="FILE_PATH",
        options={"HIDDEN", "SKIP_PRESET", "PATH_SUPPORTS_BLEND_RELATIVE"},
    )


class LooksAtFile(FromFile):
    """Compares the active link with a file; ``look`` returns the result in one line."""

    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        try:
            result = self.look(context, bpy.path.abspath(self.filepath))
        except SkinCalibError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, result)
        return {"FINISHED"}
