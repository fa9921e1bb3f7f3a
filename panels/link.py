# SPDX-License-Identifier: GPL-3.0-or-later
"""Which object is which link, and the state of its mesh."""

from dataclasses import replace

import bpy

from ..skin_calib_addon.blender.live import diagnoses
from ..skin_calib_addon.blender.live.advice import shown_warnings
from ..skin_calib_addon.blender.scene.link_objects import longest_side
from ..skin_calib_addon.blender.scene.warnings import read_warning
from ..skin_calib_addon.blender.session import session
from ..skin_calib_addon.common.errors import counted
from ..skin_calib_addon.geometry.mesh.units import UNIT_NAMES, is_plausible, possible_units
from .base import Step, button, buttons, field, serious_of, show_text, show_warning
from .robot import draw_choice, listed
from .rows import draw_keys, keys_in
from .status import misplaced


class LinkStep(Step):
    label = "Link"
    name = "link"

    def figure(self, plan):
        return plan.link

    def has_warnings(self, plan):
        return serious_of(misplaced(plan.id_data)) > 0

    def draw_plan(self, layout, plan):
        draw_keys(layout, plan, keys_in("Link"))
        field(layout, plan, "mesh_file")
        if len(listed()) == 1:  # for several links, the step Robot has it
            draw_choice(layout)
        self.draw_unit(layout)
        draw_imports(layout)

    def draw_unit(self, layout):
        """Draw a warning about a size that links do not have, and a button for each unit that may be the right one."""
        context = bpy.context
        side = longest_side(context.object, context.scene)
        if not context.object.skin_calib.link or not side or is_plausible(side):
            return
        units = possible_units(side)
        column = layout.box().column(align=True)
        show_text(column, f"This mesh is {side:.3g} m long:", "ERROR")
        show_text(column, "what is its unit?" if units else "check its scale", "BLANK1")
        for unit, factor in units.items():
            text = f"{UNIT_NAMES[unit].capitalize()}: {side * factor * 1e3:.4g} mm"
            button(column, "scale_to_unit", text=text, icon="NONE", unit=unit)


def shortened_by(finding, above):
    """Return the finding of the foreseen fit without what warnings above it say: those of the fit, or its refusal."""
    repeated = next((warning.message for warning in above if warning.message in finding.message), "")
    if not repeated or finding.code != "fit" and finding.severity != "error":
        return finding
    rest = finding.message.removesuffix(repeated).strip() or "Fit is refused: see the reason above"
    return replace(finding, message=rest, advice="")


def draw_imports(layout):
    """Draw the buttons that open a link."""
    row = buttons(layout)
    for name, text in (("mesh", "Mesh"), ("urdf", "URDF"), ("robot", "Robot"), ("plan", "Plan")):
        button(row, f"import_{name}", text=text, icon="NONE")
    row.operator_menu_enum("skin_calib.open_sample", "name", text="", icon="MESH_CYLINDER")


class MeshStep(Step):
    label = "Mesh"
    name = "mesh"

    def figure(self, plan):
        if not self.is_done(plan):
            return ""
        serious = serious_of(diagnoses.not_repeated(plan.diagnosis.findings))
        return counted(serious, "warning") if serious else "checked"

    def is_done(self, plan):
        return bool(plan.diagnosis.key) and not plan.diagnosis.outdated

    def has_warnings(self, plan):
        return serious_of(plan.diagnosis.findings) > 0

    def draw_plan(self, layout, plan):
        found = plan.diagnosis
        button(layout, "diagnose")
        if not found.key:
            return
        if session.of(plan.id_data).is_unverified:
            show_text(layout, "The mesh has changed: check again", "INFO")
        elif found.outdated:
            show_text(layout, "The plan has changed: check again", "INFO")
        above = () if plan.result.outdated and not session.of(plan.id_data).is_refused else shown_warnings(plan.id_data)
        for finding in diagnoses.not_repeated(found.findings):
            show_warning(layout, shortened_by(read_warning(finding), above))
        if found.inner:
            row = layout.row(align=True)
            row.use_property_split = False
            row.label(text="Keep")
            for shell in ("outer", "seen", "all"):
                row.prop_enum(plan.cover, "shell", shell)
        if found.edges:
            button(layout, "show_defects")
