# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample links that the extension brings."""

from pathlib import Path

import bpy

from .base import Operator

SAMPLES = Path(__file__).resolve().parent.parent / "sample_scenes"


class SKIN_OT_open_sample(Operator):
    """Add a link with a plan that comes with the extension"""

    bl_label = "Open Sample"

    name: bpy.props.EnumProperty(
        name="Sample",
        description="Which link",
        items=[
            ("wrist", "Wrist", "A limb with a sheet around it"),
            ("sole", "Sole", "A foot with a sheet below its sole"),
            ("edge", "Edge", "A limb with an edge, and a sheet over it"),
        ],
    )

    def act(self, context):
        return bpy.ops.skin_calib.import_plan(filepath=str(SAMPLES / f"{self.name}.plan.json"))
