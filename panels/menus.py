# SPDX-License-Identifier: GPL-3.0-or-later
"""The menu Skin in the header of the 3D view: every operator, so that F3, Quick Favorites and shortcuts have it."""

import bpy

from ..skin_calib_addon.blender.scene.plans import shown_index, surface_names
from .base import button, icon_of

# Operators that work on one entry of a list in the plan, and what selects it: the row that the panels show.
ARGUMENTS = {
    "cut_flip": lambda plan: {"index": plan.cover.cut_index},
    "cut_remove": lambda plan: {"index": plan.cover.cut_index},
    "plane_place": lambda plan: {"family": family_of(plan)},
    "plane_add": lambda plan: {"family": family_of(plan)},
    "plane_remove": lambda plan: {"family": family_of(plan), "index": getattr(plan.grid, f"{family_of(plan)}_index")},
    "planes_spread": lambda plan: {"family": family_of(plan)},
    "planes_mirror": lambda plan: {"family": family_of(plan)},
    "show_warning": lambda plan: {"index": plan.result.warning_index},
}
# Menus of values, by the operators that need one.
CHOICES = {"scale_to_unit": "unit", "open_sample": "name"}


def family_of(plan):
    """Return the planes that have handles: u or v."""
    return "v" if plan.held == "V" else "u"


def menu(label, operators):
    """Return the class of a menu of operators; a line separates groups of them."""

    def draw(self, context):
        for name in operators.split():
            if name == "|":
                self.layout.separator()
            elif name in CHOICES:
                self.layout.operator_menu_enum(f"skin_calib.{name}", CHOICES[name], icon=icon_of(name))
            else:
                of_plan = ARGUMENTS.get(name) if context.object is not None else None
                button(self.layout, name, **of_plan(context.object.skin_calib) if of_plan else {})

    return type(f"SKIN_MT_{label.lower()}", (bpy.types.Menu,), {"bl_label": label, "draw": draw})


SKIN_MT_open = menu("Open", "import_mesh import_urdf import_robot import_plan | open_sample")
SKIN_MT_mesh = menu("Mesh", "diagnose show_defects scale_to_unit")
SKIN_MT_cut = menu("Cut", "cut_place cut_add cut_flip cut_remove | cut_away bring_back")
SKIN_MT_grid = menu(
    "Grid",
    "axis_from_sections margin_widen grid_across boundary_remove | planes_place plane_place plane_take plane_add "
    "plane_remove planes_spread planes_mirror",
)
SKIN_MT_inspect = menu(
    "Inspect",
    "show_warning show_worst taxel taxel_toggle taxel_channel | taxel_mesh save_picture | compare compare_end touches "
    "touches_move touches_end | replay_open replay_play replay_close",
)
SKIN_MT_robot = menu("Robot", "propose_all fit_all copy_to_mirror | keep_free zones_save | export_robot")
SKIN_MT_export = menu("Export", "export_calibration export_plan export_taxels")


class SKIN_MT_surfaces(bpy.types.Menu):
    bl_label = "Surfaces"

    def draw(self, context):
        plan = context.object.skin_calib
        for k, name in enumerate(surface_names(plan)):
            icon = "RADIOBUT_ON" if k == shown_index(plan) else "RADIOBUT_OFF"
            button(self.layout, "surface_show", text=name, icon=icon, index=k)
        self.layout.separator()
        button(self.layout, "surface_add")
        button(self.layout, "surface_remove")


class SKIN_MT_skins(bpy.types.Menu):
    bl_label = "Skins"

    def draw(self, context):
        layout, plan = self.layout, context.object.skin_calib
        button(layout, "skin_add", text="Add Sheet", kind="sheet")
        button(layout, "skin_add", text="Add Boards", kind="hexagons")
        button(layout, "skin_import")
        layout.menu("SKIN_MT_presets", icon="PRESET")
        for i, skin in enumerate(plan.skins):
            layout.separator()
            layout.label(text=skin.name)
            self.draw_skin(plan, skin, i)

    def draw_skin(self, plan, skin, i):
        """Add the operators on one skin."""
        layout = self.layout
        if skin.kind == "imported":
            button(layout, "frame_find", skin=i)
        else:
            button(layout, "place", what="origin", skin=i)
            button(layout, "place_at_cursor", what="origin", skin=i)
        if skin.kind == "hexagons":
            button(layout, "boards_paint", skin=i)
        button(layout, "zones_from_faces", skin=i)
        if skin.touches:
            button(layout, "registration_remove", skin=i)
        lists = {"sheet": (("landmark", skin.landmarks),), "hexagons": (("zone", skin.excluded),)}.get(skin.kind, ())
        for what, listed in lists:
            button(layout, f"{what}_add", skin=i)
            if listed:
                button(layout, f"{what}_remove", skin=i, index=len(listed) - 1)
        if skin.taxels:
            button(layout, "single_taxel_remove", skin=i, index=len(skin.taxels) - 1)
        if skin.kind != "imported":
            button(layout, "preset_save", skin=i)
        names = surface_names(plan)
        for name in names if len(names) > 1 else ():
            button(layout, "skin_surface", text=f"On {name}", skin=i, name=name)
        button(layout, "skin_remove", index=i)


class SKIN_MT_presets(bpy.types.Menu):
    """Skins that are presets of Blender: those of the extension, and those that the author saved"""

    bl_label = "Presets"
    preset_subdir = "skin_calib"
    preset_operator = "skin_calib.preset"
    draw = bpy.types.Menu.draw_preset


class SKIN_MT_skin(bpy.types.Menu):
    bl_label = "Skin"

    def draw(self, context):
        layout, link = self.layout, context.object
        layout.menu("SKIN_MT_open", icon="IMPORT")
        layout.separator()
        button(layout, "propose")
        button(layout, "fit")
        is_mesh = link is not None and link.type == "MESH"
        if is_mesh:
            layout.prop(link.skin_calib, "live", icon="PLAY")
        layout.separator()
        for name, icon in (("mesh", "MESH_DATA"), ("cut", "MOD_BOOLEAN"), ("grid", "MESH_GRID")):
            layout.menu(f"SKIN_MT_{name}", icon=icon)
        if is_mesh:
            layout.menu("SKIN_MT_surfaces", icon="SURFACE_DATA")
            layout.menu("SKIN_MT_skins", icon="LIGHTPROBE_VOLUME")
        layout.menu("SKIN_MT_inspect", icon="VIEWZOOM")
        layout.separator()
        layout.menu("SKIN_MT_robot", icon="ARMATURE_DATA")
        layout.menu("SKIN_MT_export", icon="EXPORT")


def draw_menu(menus, _context):
    """Add the menu Skin to the header of the 3D view."""
    menus.layout.menu("SKIN_MT_skin")


def register():
    """Show the menu."""
    bpy.types.VIEW3D_MT_editor_menus.append(draw_menu)


def unregister():
    """Remove it."""
    bpy.types.VIEW3D_MT_editor_menus.remove(draw_menu)
