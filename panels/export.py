# SPDX-License-Identifier: GPL-3.0-or-later
"""Export of files."""

from .base import Step, button, buttons


class ExportStep(Step):
    label = "Export"
    name = "export"

    def draw_plan(self, layout, plan):
        column = layout.column(align=True)
        button(column, "export_calibration", text="Calibration")
        row = buttons(column)
        button(row, "export_plan", text="Plan")
        button(row, "export_taxels", text="Taxels...")
