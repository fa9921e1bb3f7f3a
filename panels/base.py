# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels have in common: where and when they are shown, and how they draw texts and planes."""

import textwrap

import blf
import bpy

from ..skin_calib_addon.blender.properties.millimetres import shown
from ..skin_calib_addon.blender.scene.plans import surface_names
from ..skin_calib_addon.blender.session import session
from ..skin_calib_addon.common.errors import counted

# Characters in a line without a region, as in a background process.
LINE_WIDTH = 34
# Characters in a line of several, relative to those of the whole text on average: lines can have wide letters. Larger:
# their ends are cut off; smaller: more lines.
WIDE_LETTERS = 0.85
# [pixel of a screen with standard density] Left and right of a text in the sidebar: edges of panels, tabs, an icon.
# Larger: texts are broken earlier; smaller: their ends are cut off.
TEXT_MARGIN = 80
# [pixel of a screen with standard density] Width of the sidebar below which labels are inside their fields, and buttons
# one below the other. Larger: wide sidebars look so, too; smaller: labels and buttons are cut off.
NARROW_WIDTH = 260
# [pixel of a screen with standard density] For the value of a field next to its label, in addition to the margin of a
# text. Larger: labels are above their fields in wider sidebars.
VALUE_WIDTH = 35
# [pixel of a screen with standard density] The same for a length with its unit, as 0.004766 mm; an angle, as -178.6°
LENGTH_WIDTH, ANGLE_WIDTH = 80, 55
ICON_WIDTH = (
    25  # [pixel of a screen with standard density] of an icon. Larger: buttons lose fewer words in narrow sidebars
)
# [pixel of a screen with standard density] of a button with only an icon. Larger: texts next to it are broken earlier
BUTTON_WIDTH = 20
LINKING = ("and", "as", "with")  # words that no short text of a button ends with
# Operators by their icons.
ICONS = {
    "ADD": "cut_add landmark_add plane_add skin_add surface_add zone_add",
    "ALIGN_JUSTIFY": "planes_spread",
    "ARMATURE_DATA": "import_robot",
    "ARROW_LEFTRIGHT": "cut_flip scale_to_unit",
    "BONE_DATA": "import_urdf",
    "BRUSH_DATA": "boards_paint",
    "EXPORT": "export_calibration export_plan export_robot export_taxels zones_save",
    "EYEDROPPER": "axis_from_sections cut_place place plane_place plane_take taxel",
    "FACESEL": "cut_away zones_from_faces",
    "FILE": "import_plan",
    "FILEBROWSER": "compare replay_open skin_import touches",
    "FULLSCREEN_EXIT": "margin_widen",
    "HIDE_ON": "taxel_toggle",
    "LINENUMBERS_ON": "taxel_channel",
    "LOOP_BACK": "bring_back",
    "MESH_CYLINDER": "open_sample",
    "MESH_DATA": "import_mesh",
    "MESH_PLANE": "grid_across planes_place",
    "MOD_MIRROR": "copy_to_mirror planes_mirror",
    "OUTLINER_DATA_LATTICE": "propose propose_all",
    "OUTLINER_OB_MESH": "taxel_mesh",
    "PIVOT_CURSOR": "keep_free place_at_cursor",
    "PLAY": "replay_play",
    "PRESET_NEW": "preset_save",
    "REMOVE": "plane_remove",
    "RESTRICT_RENDER_OFF": "save_picture",
    "RESTRICT_SELECT_OFF": "show_defects",
    "SNAP_ON": "touches_move",
    "SURFACE_DATA": "fit fit_all skin_surface surface_show",
    "VIEWZOOM": "diagnose frame_find",
    "X": "boundary_remove compare_end cut_remove landmark_remove registration_remove replay_close "
    "single_taxel_remove skin_remove surface_remove touches_end zone_remove",
    "ZOOM_SELECTED": "show_warning show_worst",
}
POPOVER_UNITS = 16  # width of the status as a popover, in units of a button's height


class SkinPanel:
    """States where and when the panels are shown."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Skin"

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == "MESH"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = not is_narrow()
        layout.use_property_decorate = False  # no property is animatable
        self.draw_plan(layout, context.object and context.object.skin_calib)


class Step:
    """A part of the work that opens and closes; closed, it is one line with a tick and its key figure.

    The first successful fit closes the steps before the skin, and opens that one. The program opens and closes nothing
    else, so that it never acts against the author.
    """

    label = ""
    name = ""  # of the property that keeps whether it is open

    def draw(self, layout, plan):
        """Draw its line, and below it what it contains if it is open."""
        header, body = layout.panel_prop(self.states(plan), self.name)
        header.label(text=self.label)
        figure = "" if body else self.figure(plan)
        if figure:
            row = header.row()
            row.alignment = "RIGHT"
            icon = "NONE" if not self.is_done(plan) else "ERROR" if self.has_warnings(plan) else "CHECKMARK"
            row.label(text="" if is_narrow() else shortened(figure, self.label), icon=icon)
        if body:
            self.draw_plan(body, plan)

    def states(self, plan):
        """Return the properties that keep which steps are open."""
        return plan.steps

    def is_done(self, plan):
        """Return whether the closed step has a tick or a warning sign: once the link is fitted as it is."""
        return bool(plan.result.key) and not plan.result.outdated

    def has_warnings(self, plan):
        """Return whether there are warnings about what the step does."""
        return False

    def figure(self, plan):
        """Return the key figure of the closed step; empty where there is none yet."""
        return ""

    def draw_plan(self, layout, plan):
        """Draw what it contains."""
        raise NotImplementedError


def surfaces_figure(plan):
    """Return the number of surfaces, as the key figure of steps that show one of several; empty for a single one."""
    count = len(surface_names(plan))
    return counted(count, "surface") if count > 1 else ""


def serious_of(warnings):
    """Return how many of some warnings are more than notes."""
    return sum(warning.severity != "note" for warning in warnings)


def more(layout, plan, name):
    """Return the layout for options that are rarely needed; None while they are closed."""
    header, body = layout.panel_prop(plan.steps, name)
    header.label(text="More")
    return body


def is_narrow():
    """Return whether the sidebar has no space for labels next to fields, and for buttons next to each other."""
    region = bpy.context.region
    is_sidebar = region is not None and region.type == "UI" and not bpy.app.background
    return is_sidebar and region.width < NARROW_WIDTH * bpy.context.preferences.system.ui_scale


def buttons(layout):
    """Return the layout of a row of buttons, which is a column in a narrow sidebar."""
    return layout.column(align=True) if is_narrow() else layout.row(align=True)


def field(layout, group, name, **words):
    """Draw a property; in a narrow sidebar its label is above it, or in several lines."""
    item = group.bl_rna.properties[name]
    text, is_several = words.get("text", item.name), getattr(item, "is_array", False) and "index" not in words
    if is_several and item.unit == "CAMERA":  # Blender writes no letters before the components of such a unit
        if is_narrow():
            layout.label(text=text)
        for i, letter in enumerate("XYZ"):
            layout.prop(group, name, index=i, text=letter if i or is_narrow() else f"{text} {letter}")
        return
    number = {"CAMERA": LENGTH_WIDTH, "ROTATION": ANGLE_WIDTH}.get(getattr(item, "unit", ""), VALUE_WIDTH)
    space = {"BOOLEAN": ICON_WIDTH, "INT": number, "FLOAT": number}.get(item.type)
    if not is_narrow() or is_several or not text or space is not None and fits(text, space):
        layout.prop(group, name, **words)
        return
    if item.type == "BOOLEAN":
        row = layout.row(align=True)
        row.prop(group, name, text="")
        show_text(row, text, "NONE", ICON_WIDTH)
        return
    column = layout.column(align=True)
    column.label(text=text)
    column.prop(group, name, **words | {"text": ""})


def search(layout, group, name, owner, names):
    """Draw a property with the name of one of ``owner.names``; in a narrow sidebar its label is above it."""
    text = group.bl_rna.properties[name].name
    if is_narrow():
        layout.label(text=text)
        text = ""
    layout.prop_search(group, name, owner, names, text=text)


def icon_of(name):
    """Return the icon of an operator of ours."""
    return next((icon for icon, names in ICONS.items() if name in names.split()), "NONE")


def button(layout, name, /, text=None, space=0, icon=None, depress=False, **properties):
    """Draw the button of an operator of ours, which sets properties of it.

    A narrow sidebar has no icon, or only the first words. ``space`` is the width of what is in the same row [pixel of a
    screen with standard density].
    """
    text = getattr(bpy.ops.skin_calib, name).get_rna_type().name if text is None else text
    icon = icon or icon_of(name)
    words = text.split()
    if is_narrow():
        if not fits(text, space):
            icon = "NONE"
        while len(words) > 1 and (words[-1] in LINKING or not fits(" ".join(words), space - ICON_WIDTH)):
            words.pop()
    _draw(layout, name, properties, text=" ".join(words), icon=icon, depress=depress)


def symbol(layout, name, /, emboss=True, **properties):
    """Draw the button of an operator of ours with only its icon; it sets properties of the operator."""
    _draw(layout, name, properties, text="", icon=icon_of(name), emboss=emboss)


def _draw(layout, name, properties, **words):
    drawn = layout.operator(f"skin_calib.{name}", **words)
    for key, value in properties.items():
        setattr(drawn, key, value)


def characters_of(text, space):
    """Return how many characters of a text a line of the sidebar has, or of the popover of the status.

    ``space`` is the width of what is in the same row [pixel of a screen with standard density].
    """
    region, system = bpy.context.region, bpy.context.preferences.system
    if region is None or bpy.app.background:
        return LINE_WIDTH
    blf.size(0, bpy.context.preferences.ui_styles[0].widget.points * system.ui_scale)
    width = region.width if region.type == "UI" else 20 * POPOVER_UNITS * system.ui_scale
    part = (width - (TEXT_MARGIN + space) * system.ui_scale) / max(blf.dimensions(0, text)[0], 1)
    return max(int(part * len(text)), 1)


def fits(text, space):
    """Return whether the sidebar has space for a text in one line."""
    return characters_of(text, space) >= len(text)


def lines_of(text, space=0):
    """Return a text in lines that are as wide as the sidebar, or as the popover of the status."""
    width = characters_of(text, space)
    if width < len(text) and not bpy.app.background:
        width = max(int(WIDE_LETTERS * width), 1)
    return textwrap.wrap(text, width)


def shortened(text, label):
    """Return a text, or its start and an ellipsis, so that it fits into one line with a label and its icons."""
    whole = f"{label} {text}"
    left = len(whole) - characters_of(whole, ICON_WIDTH)
    return text if left <= 0 else f"{text[: -left - 2]}…"


def show_text(layout, text, icon, space=0):
    """Draw a message in lines as wide as the sidebar, less a space next to it."""
    column = layout.column(align=True)
    for k, line in enumerate(lines_of(text, space)):
        column.label(text=line, icon="BLANK1" if k and icon != "NONE" else icon)


def show_warning(layout, warning):
    """Draw a warning: its message, and the advice below it."""
    column = layout.column(align=True)
    icon = {"error": "CANCEL", "warning": "ERROR"}.get(warning.severity, "DOT" if warning.advice else "CHECKMARK")
    show_text(column, warning.message, icon)
    if warning.advice:
        show_text(column, warning.advice, "BLANK1")


def what_is_wrong(settings, family, index):
    """Return why a plane is drawn red, from the last sketch of the planes of the link; empty if it is valid."""
    sketch = session.of(settings.id_data).sketch
    return sketch.wrong.get((family, index), "") if sketch else ""


def draw_plane(layout, plane, wrong):
    """Draw what is wrong with a plane, and below it its point and normal."""
    column = layout.column()
    if wrong:
        column.alert = True
        show_text(column, f"It {wrong}", "ERROR")
    field(column, plane, shown(plane, "point"))
    column.prop(plane, "normal")
