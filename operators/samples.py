# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample links that the extension brings."""

from pathlib import Path

import bpy

SAMPLES = Path(__file__).resolve().parent.parent / "sample_scenes"


class SKIN_OT_open_sample(bpy.types.Operator):
    """Add a link with a plan that comes with the extension"""

    bl_idname = "skin_calib.open_sample"
    bl_label = "Open Sample"
    bl_options = {"REGISTER", "UNDO"}

    name: bpy.props.EnumProperty(
        name="Sample",
        description="Which link",
        items=[
            ("wrist", "Wrist", "A limb with a sheet around it"),
            ("sole", "Sole", "A foot with a sheet below its sole"),
            ("edge", "Edge", "A limb with an edge, and a sheet over it"),
        ],
    )

    def execute(self, context):
        return bpy.ops.skin_calib.import_plan(filepath=str(SAMPLES / f"{self.name}.plan.json"))


CLASSES = (SKIN_OT_open_sample,)
