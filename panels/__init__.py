# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tabs Skin and Inspect, the menu Skin, and the state in the header; they draw stored values."""

from pathlib import Path

import bpy

from . import cut, grid, inspect, menus, robot, status, tools, work

CLASSES = tuple(cls for module in (status, robot, cut, grid, work, inspect, menus) for cls in module.CLASSES)


FOLDER = str(Path(__file__).parents[1])  # has the folder of presets


def register():
    """Add the panels, and state and menu in the header of the view."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.VIEW3D_HT_tool_header.append(status.draw_header)
    bpy.types.VIEW3D_MT_editor_menus.append(menus.draw_menu)
    bpy.utils.register_preset_path(FOLDER)
    tools.register()


def unregister():
    """Remove them."""
    tools.unregister()
    bpy.utils.unregister_preset_path(FOLDER)
    bpy.types.VIEW3D_MT_editor_menus.remove(menus.draw_menu)
    bpy.types.VIEW3D_HT_tool_header.remove(status.draw_header)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
