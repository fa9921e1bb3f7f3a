# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels have in common: where and when they are shown, and how they draw texts and planes."""

import textwrap

from ..skin_calib_addon.blender.live import updates

# Characters in a line of the sidebar at its initial width.
LINE_WIDTH = 34


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
        layout.use_property_split = True
        layout.use_property_decorate = False  # no property is animatable
        self.draw_plan(layout, context.object and context.object.skin_calib)


def show_text(layout, text, icon):
    """Draw a message in lines as wide as the sidebar."""
    column = layout.column(align=True)
    for k, line in enumerate(textwrap.wrap(text, LINE_WIDTH)):
        column.label(text=line, icon="BLANK1" if k and icon != "NONE" else icon)


def show_warning(layout, warning):
    """Draw a warning: its message, and the advice below it."""
    column = layout.column(align=True)
    icon = {"note": "DOT" if warning.advice else "CHECKMARK"}.get(warning.severity, "ERROR")
    show_text(column, warning.message, icon)
    if warning.advice:
        show_text(column, warning.advice, "BLANK1")


def what_is_wrong(settings, family, index):
    """Return why a plane is drawn red, from the last sketch of the planes of the link; empty if it is valid."""
    sketch = updates.sketches.get(settings.id_data.name)
    return sketch.wrong.get((family, index), "") if sketch else ""


def draw_plane(layout, plane, wrong):
    """Draw what is wrong with a plane, and below it its point and normal."""
    column = layout.column()
    if wrong:
        column.alert = True
        column.label(text=f"It {wrong}", icon="ERROR")
    column.prop(plane, "point")
    column.prop(plane, "normal")
