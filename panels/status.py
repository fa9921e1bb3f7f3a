# SPDX-License-Identifier: GPL-3.0-or-later
"""The state of the active link: first in the tab, and in the header of the view, which does not scroll."""

import bpy

from ..skin_calib_addon.blender.live.advice import PROPOSE, REFUSAL, hidden_surface, is_of_the_fit, mark_of, offered
from ..skin_calib_addon.blender.scene.link_meshes import placement_warnings
from ..skin_calib_addon.blender.scene.link_objects import namesakes, why_not
from ..skin_calib_addon.blender.scene.results import least_exact
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from ..skin_calib_addon.blender.scene.warnings import read_warning
from ..skin_calib_addon.blender.session import session
from ..skin_calib_addon.common.errors import counted
from .base import POPOVER_UNITS, button, buttons, serious_of, shortened, show_text, show_warning

# [1] warnings up to which the list cannot be folded, and rows of a longer list. Larger: the panels below move down.
MAX_OPEN, MAX_ROWS = 3, 8
ICONS = {"error": "CANCEL", "warning": "ERROR", "note": "INFO"}


def state_of(link):
    """Return the state of a link in a few words, with an icon."""
    if link is None or link.type != "MESH":
        return "Select or open a link", "INFO"
    if reason := why_not(link, named=False):
        return reason, "INFO"
    plan, report = link.skin_calib, session.of(link).report
    result = plan.result
    if words := session.progress_of(link):
        return words, "SORTTIME"
    if not plan.link:
        return "Open a mesh, URDF or robot, or enter a name to make this object a link", "INFO"
    if copy := same_name(link):
        return f"{copy} has the same link name", "ERROR"
    if report and report.refusal:
        return "The fit is refused", "CANCEL"
    if report:
        mean = f"{report.mean * 1e3:.4f} mm on the rays{least_exact(plan)}"
        return f"Preview: mean {mean}, {report.seconds * 1e3:.0f} ms", "PLAY"
    if not result.key:
        return "Not fitted: press Propose or Fit", "INFO"
    if result.outdated:
        return "Plan or mesh has changed: fit again", "INFO"
    mean = result.mean * metres_per_unit(bpy.context.scene) * 1e3
    taxels = f"{counted(result.taxels, 'taxel')}{covered(result)}" if result.taxels else "add a skin"
    worst = result.warnings[0].severity if result.warnings else ""
    worst = "warning" if worst in ("", "note") and serious_of(misplaced(link)) else worst
    icon = ICONS[worst] if worst in ("error", "warning") else "CHECKMARK"
    return f"Mean {mean:.4f} mm{least_exact(plan)}, {taxels}", icon


def covered(result):
    """Return, after the number of taxels, how much of the visible area they cover; empty if it is not known."""
    if any(warning.code in ("overlap", "skins-overlap") for warning in result.warnings):
        return ", which overlap"
    if not result.seen:
        return ""
    return f" on {result.cells * 1e4:.0f} of {result.seen * 1e4:.0f} cm² ({result.cells / result.seen:.0%})"


def misplaced(link):
    """Return the warnings about pose and scale of an object now, which its last fit need not have."""
    return placement_warnings(link, metres_per_unit(bpy.context.scene)) if link.skin_calib.link else ()


def same_name(link):
    """Return another object with the same link name, as a copy has; empty without one."""
    return next(iter(namesakes(link, bpy.context.scene)), "")


class SKIN_UL_warnings(bpy.types.UIList):
    """Warnings of the fit, the worst one first; the selected one is shown in full"""

    def draw_item(self, _context, layout, _data, warning, _icon, _active, _property, _index):
        about = warning.message.partition(": ")[2] if warning.surface else ""  # the names of its surfaces begin it
        layout.label(text=shortened(about or warning.message, ""), icon=ICONS[warning.severity])


def draw_status(layout, link):
    """Draw the state of a link, what is next, and the warnings with what mends them."""
    text, icon = state_of(link)
    show_text(layout, text, icon)
    if link is None or link.type != "MESH":
        return
    plan = link.skin_calib
    if plan.link and not link.visible_get(viewport=bpy.context.space_data):
        show_text(layout, "The link is hidden in this view, with its surface and its marks", "HIDE_ON")
    if same_name(link):
        show_text(layout, "Their files would have the same names. Rename one of both in Link.", "BLANK1")
    for warning in misplaced(link):
        show_warning(layout, warning)
    row = buttons(layout)
    button(row, "propose")
    button(row, "fit")
    row.prop(plan, "live", toggle=True, icon="PLAY")
    report, result = session.of(link).report, plan.result
    if plan.refusal and not plan.skins:
        show_text(layout, plan.refusal, "CANCEL")
    if report and not report.refusal:
        surface = "The surface is coarse. " if report.coarse else ""
        cells = "Cells are interpolated. " if report.interpolated else ""
        later = "Boards, errors and warnings" if report.left_out else "Errors and warnings"
        show_text(layout, f"{surface}{cells}{later} follow when the changes end", "SORTTIME")
    if report and report.refusal:
        draw_warning(layout, plan, report.refusal, REFUSAL)
        offers = [action for action, _ in offered(report.refusal, plan, metres_per_unit(bpy.context.scene))]
        if not plan.proposed and is_of_the_fit(report.refusal) and offers[:1] != [PROPOSE]:
            show_text(layout, "Or press Propose. It replaces the plan by one that can be fitted.", "INFO")
    elif result.key and result.warnings:
        if result.outdated:
            show_text(layout, "Warnings of the last fit, before the change:", "INFO")
        draw_warnings(layout, plan, result)


def draw_warnings(layout, plan, result):
    """Draw the selected warning of a result, and the list of all; a long list is one line until it is opened."""
    count, is_open = len(result.warnings), plan.steps.warnings
    index = min(result.warning_index, count - 1)
    warning = read_warning(result.warnings[index])
    if count > MAX_OPEN:
        row, icon = layout.row(), "DOWNARROW_HLT" if is_open else "RIGHTARROW"
        row.alignment = "LEFT"
        message = "" if is_open else f": {warning.message}"
        text = shortened(f"Warning {index + 1} of {count}{message}", "")
        row.prop(plan.steps, "warnings", text=text, icon=icon, emboss=False)
        if not is_open:
            draw_actions(layout, plan, warning, index)
            return
    if count > 1:
        rows = min(count, MAX_ROWS)
        names = "SKIN_UL_warnings", "", result, "warnings", result, "warning_index"
        layout.template_list(*names, rows=rows, maxrows=rows, sort_lock=True)
    draw_warning(layout, plan, warning, index)


def draw_warning(layout, plan, warning, index):
    """Draw a warning in full, and its buttons."""
    show_warning(layout, warning)
    draw_actions(layout, plan, warning, index)


def draw_actions(layout, plan, warning, index):
    """Draw the button that shows the place of a warning, and the one that does what it advises."""
    row = buttons(layout)
    if warning.where.point is not None:
        is_marked = plan.inspect.marked_place == mark_of(warning)
        button(row, "show_warning", depress=is_marked, index=index)
    metre = metres_per_unit(bpy.context.scene)
    for action, properties in list(offered(warning, plan, metre))[:1]:
        if action.change or hidden_surface(warning, plan) is not None:
            button(row, "take_advice", text=action.text, index=index)
            continue
        drawn = row.operator(action.operator, text=action.text)
        for name, value in properties.items():
            setattr(drawn, name, value)


class SKIN_PT_status(bpy.types.Panel):
    """What is missing, the result, its worst warning, and what mends it"""

    bl_label = "Skin"
    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"  # only a popover
    bl_ui_units_x = POPOVER_UNITS

    def draw(self, context):
        draw_status(self.layout, context.object)


def draw_header(header, context):
    """Draw the state of the active link at the right end of the tool header, over the sidebar; it opens the status."""
    link = context.object
    if link is None or link.type != "MESH" or not link.skin_calib.link:
        return
    text, icon = state_of(link)
    header.layout.popover("SKIN_PT_status", text=f"{link.skin_calib.link}: {text}", icon=icon)


def register():
    """Show the state in the header of the view."""
    bpy.types.VIEW3D_HT_tool_header.append(draw_header)


def unregister():
    """Remove it."""
    bpy.types.VIEW3D_HT_tool_header.remove(draw_header)
