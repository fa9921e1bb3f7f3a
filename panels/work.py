# SPDX-License-Identifier: GPL-3.0-or-later
"""The tab Skin: the state of the active link, and the steps of the work below it."""

import bpy

from .base import SkinPanel, is_narrow
from .cut import CutStep
from .fit import ExportStep, FitStep
from .grid import GridStep
from .link import LinkStep, MeshStep, draw_imports
from .robot import ReasonsStep, RobotStep
from .skin import SkinStep
from .status import draw_status


class SKIN_PT_work(SkinPanel, bpy.types.Panel):
    """State and steps are one panel: between panels there are gaps, and the program can only open parts of a panel"""

    bl_label = "Skin"
    bl_options = {"HIDE_HEADER"}

    robot = RobotStep()
    steps = (LinkStep(), ReasonsStep(), MeshStep(), CutStep(), GridStep(), FitStep(), SkinStep(), ExportStep())

    @classmethod
    def poll(cls, context):
        return True

    def draw(self, context):
        layout = self.layout
        draw_status(layout.column(), context.object)
        layout.use_property_split = not is_narrow()
        layout.use_property_decorate = False  # no property is animatable
        self.robot.draw(layout, None)
        if not SkinPanel.poll(context):
            draw_imports(layout)
            return
        for step in self.steps:
            step.draw(layout, context.object.skin_calib)
