# SPDX-License-Identifier: GPL-3.0-or-later
"""Tools of the toolbar, which work with a click on the link."""

import bpy

CLICK = {"type": "LEFTMOUSE", "value": "PRESS"}
AT_MOUSE = {"properties": [("at_mouse", True)]}


class SkinTool:
    """Where the tools are shown."""

    bl_space_type = "VIEW_3D"
    bl_context_mode = "OBJECT"
    bl_widget = None


class CutTool(SkinTool, bpy.types.WorkSpaceTool):
    bl_idname = "skin_calib.cut_tool"
    bl_label = "Cut Link"
    bl_description = "Click on the link to add a plane that cuts it there; handles move and tilt the plane"
    bl_icon = "ops.mesh.bisect"
    bl_keymap = (("skin_calib.cut_place", CLICK, AT_MOUSE),)


class PlanesTool(SkinTool, bpy.types.WorkSpaceTool):
    bl_idname = "skin_calib.planes_tool"
    bl_label = "Place Planes"
    bl_description = (
        "Click on the link to add a plane across it, Shift click to add one along it, Ctrl click to remove the nearest "
        "plane; handles move and tilt planes"
    )
    bl_icon = "ops.mesh.loopcut_slide"
    bl_keymap = (
        ("skin_calib.plane_place", CLICK, {"properties": [("at_mouse", True), ("family", "u")]}),
        ("skin_calib.plane_place", CLICK | {"shift": True}, {"properties": [("at_mouse", True), ("family", "v")]}),
        ("skin_calib.plane_take", CLICK | {"ctrl": True}, AT_MOUSE),
    )


class BoardsTool(SkinTool, bpy.types.WorkSpaceTool):
    bl_idname = "skin_calib.boards_tool"
    bl_label = "Paint Boards"
    bl_description = "Click on a board to remove it, or next to the boards to add one"
    bl_icon = "ops.generic.select_paint"
    bl_keymap = (("skin_calib.boards_paint", CLICK, AT_MOUSE),)


def register():
    """Add the tools below those of Blender."""
    bpy.utils.register_tool(CutTool, separator=True)
    bpy.utils.register_tool(PlanesTool, after={CutTool.bl_idname})
    bpy.utils.register_tool(BoardsTool, after={PlanesTool.bl_idname})


def unregister():
    """Remove them."""
    for tool in (BoardsTool, PlanesTool, CutTool):
        bpy.utils.unregister_tool(tool)
