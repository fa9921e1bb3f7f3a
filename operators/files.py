# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that the author chooses in Blender's browser."""

import bpy
from bpy_extras.io_utils import ImportHelper


class FromFile(ImportHelper):
    """Asks for a file to read; its path may be relative to the .blend, as Blender keeps them."""

    filepath: bpy.props.StringProperty(
        name="File Path",
        description="The file to read",
        subtype="FILE_PATH",
        options={"HIDDEN", "SKIP_PRESET", "PATH_SUPPORTS_BLEND_RELATIVE"},
    )
