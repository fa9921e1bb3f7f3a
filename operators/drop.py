# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are dropped into a 3D view; where several handlers accept a file, Blender asks which one."""

import bpy


class IntoView:
    """Accepts files that are dropped into a 3D view."""

    @classmethod
    def poll_drop(cls, context):
        return context.area is not None and context.area.type == "VIEW_3D"


class SKIN_FH_mesh(IntoView, bpy.types.FileHandler):
    bl_idname = "SKIN_FH_mesh"
    bl_label = "Skin Link Mesh"
    bl_import_operator = "skin_calib.import_mesh"
    bl_file_extensions = ".stl;.ply;.obj;.off;.dae;.glb"


class SKIN_FH_robot(IntoView, bpy.types.FileHandler):
    bl_idname = "SKIN_FH_robot"
    bl_label = "Robot"
    bl_import_operator = "skin_calib.import_robot"
    bl_file_extensions = ".urdf"


class SKIN_FH_link(IntoView, bpy.types.FileHandler):
    bl_idname = "SKIN_FH_link"
    bl_label = "Skin Link of a Robot"
    bl_import_operator = "skin_calib.import_urdf"
    bl_file_extensions = ".urdf"


class SKIN_FH_plan(IntoView, bpy.types.FileHandler):
    bl_idname = "SKIN_FH_plan"
    bl_label = "Skin Plan"
    bl_import_operator = "skin_calib.import_plan"
    bl_file_extensions = ".json"


CLASSES = (SKIN_FH_mesh, SKIN_FH_robot, SKIN_FH_link, SKIN_FH_plan)
