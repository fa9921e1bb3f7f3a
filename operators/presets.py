# SPDX-License-Identifier: GPL-3.0-or-later
"""Skins as presets of Blender: scripts in its folders of presets, which add a skin to the active link."""

from pathlib import Path

import bpy
from bl_operators.presets import AddPresetBase

from ..skin_calib_addon.blender.properties.millimetres import shown
from ..skin_calib_addon.blender.scene.skins import entry
from ..skin_calib_addon.blender.scene.units import exact
from ..skin_calib_addon.common.errors import SkinCalibError
from .base import Edit, OnSkin, Operator, no_mesh

OURS = str(Path(__file__).parents[1])  # has the folder of presets
FOLDER = "skin_calib"  # below each folder of presets
# What a preset keeps: what the skin is, not where it is on its link.
KEPT = {
    "sheet": ("rows", "columns", "pitch", "hand", "offset", "trim"),
    "hexagons": ("side", "auto_gap", "gap", "offset"),
}


class SKIN_OT_preset(Edit, Operator):
    """Add the skin of this preset to the active link"""

    bl_label = "Add Skin of a Preset"

    filepath: bpy.props.StringProperty(name="File", subtype="FILE_PATH", options={"HIDDEN", "SKIP_SAVE"})

    def edit(self, context, plan):
        if not self.filepath:
            raise SkinCalibError("No preset was given. Choose one from the menu Presets of the step Skin.")
        bpy.utils.execfile(self.filepath)


class SKIN_OT_preset_save(OnSkin, AddPresetBase, Operator):
    """Save what this skin is, without its place on the link, as a preset for other links"""

    bl_label = "Save Skin as Preset"
    blocked_by = (no_mesh,)
    bl_options = {"REGISTER"}

    preset_menu = "SKIN_MT_presets"
    preset_subdir = FOLDER

    def add(self, context, path):
        """Write the script of the preset."""
        skin = entry(context.object.skin_calib.skins, self.skin, "skin")
        lines = ["import bpy", "", f'bpy.ops.skin_calib.skin_add(kind="{skin.kind}")']
        lines.append("skin = bpy.context.object.skin_calib.skins[-1]")
        for name in (shown(skin, name) for name in KEPT[skin.kind]):
            lines.append(f"skin.{name} = {_written(getattr(skin, name))}")
        with open(path, "w", encoding="utf-8") as file:
            file.write("\n".join(lines) + "\n")

    def execute(self, context):
        skins = context.object.skin_calib.skins
        if self.skin >= len(skins) or skins[self.skin].kind not in KEPT:
            self.report({"ERROR"}, "Presets keep sheets and boards. Choose one of them.")
            return {"CANCELLED"}
        return super().execute(context)


def _written(value):
    """Return a value of a property as Python code; numbers have the digits that single precision has."""
    if isinstance(value, float):
        return repr(exact(value))
    is_single = isinstance(value, (str, bool, int))
    return repr(value) if is_single else f"({', '.join(map(_written, value))})"


def register():
    """Add the folder with the presets of the extension."""
    bpy.utils.register_preset_path(OURS)


def unregister():
    """Remove it."""
    bpy.utils.unregister_preset_path(OURS)
