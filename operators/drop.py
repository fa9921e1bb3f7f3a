# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are dropped into a 3D view; where several handlers accept a file, Blender asks which one."""

import bpy


class IntoView:
    """Accepts files that are dropped into a 3D view."""

    @classmethod
    def poll_drop(cls, context):
        return context.area is not None and context.area.type == "VIEW_3D"


def handler(name, label, operator, endings):
    """Return the class of a handler."""
    words = {"bl_idname": f"SKIN_FH_{name}", "bl_label": label, "bl_file_extensions": endings}
    words["bl_import_operator"] = f"skin_calib.{operator}"
    return type(words["bl_idname"], (IntoView, bpy.types.FileHandler), words)


SKIN_FH_mesh = handler("mesh", "Skin Link Mesh", "import_mesh", ".stl;.ply;.obj;.off;.dae;.glb")
SKIN_FH_robot = handler("robot", "Robot", "import_robot", ".urdf")
SKIN_FH_link = handler("link", "Skin Link of a Robot", "import_urdf", ".urdf")
SKIN_FH_plan = handler("plan", "Skin Plan", "import_plan", ".json")
