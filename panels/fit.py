# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of the fit, and the export of its files."""

import bpy

from ..skin_calib_addon.blender.properties.millimetres import shown
from ..skin_calib_addon.blender.scene.results import least_exact
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from .base import Step, button, buttons, field, serious_of, show_text


class FitStep(Step):
    label = "Fit"
    name = "fit"

    def figure(self, plan):
        mean = plan.result.mean * metres_per_unit(bpy.context.scene)
        return f"{mean * 1e3:.4f} mm" if plan.result.key else ""

    def has_warnings(self, plan):
        return serious_of(warning for warning in plan.result.warnings if not warning.skin) > 0

    def draw_plan(self, layout, plan):
        result = plan.result
        if not result.key:
            show_text(layout, "Press Fit above", "INFO")
            return
        column = layout.column(align=True)
        column.enabled = False
        for name in ("mean", "max", "hausdorff", "control_points", "taxels", "seconds"):
            field(column, result, shown(result, name))
        if least_exact(plan):
            show_text(layout, "Mean: of the least exact surface", "INFO")
        is_marked = plan.inspect.marked == result.key
        button(layout, "show_worst", depress=is_marked)


class ExportStep(Step):
    label = "Export"
    name = "export"

    def draw_plan(self, layout, plan):
        column = layout.column(align=True)
        button(column, "export_calibration", text="Calibration")
        row = buttons(column)
        button(row, "export_plan", text="Plan")
        button(row, "export_taxels", text="Taxels...")
