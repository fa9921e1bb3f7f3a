# SPDX-License-Identifier: GPL-3.0-or-later
"""Export of files."""

import bpy

from .base import SkinPanel


class SKIN_PT_export(SkinPanel, bpy.types.Panel):
    bl_label = "Export"

    def draw_plan(self, layout, plan):
        column = layout.column()
        column.operator("skin_calib.export_calibration", text="Calibration", icon="EXPORT")
        column.operator("skin_calib.export_plan", text="Plan", icon="EXPORT")
        column.operator("skin_calib.export_taxels", text="Taxels for...", icon="EXPORT")


CLASSES = (SKIN_PT_export,)
