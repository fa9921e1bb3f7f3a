# SPDX-License-Identifier: GPL-3.0-or-later
"""The menu Skin in the header of the 3D view: every operator, so that F3, Quick Favorites and shortcuts have it."""

import bpy

from ..skin_calib_addon.blender.scene.plans import shown_index, surface_names

LINE = ""  # between two groups of entries
# Menus below Skin, each with its label and its operators: name and icon.
MENUS = {
    "open": (
        "Open",
        (
            ("import_mesh", "MESH_DATA"),
            ("import_urdf", "BONE_DATA"),
            ("import_robot", "ARMATURE_DATA"),
            ("import_plan", "FILE"),
            (LINE, ""),
            ("open_sample", "MESH_CYLINDER"),
        ),
    ),
    "mesh": (
        "Mesh",
        (("diagnose", "VIEWZOOM"), ("show_defects", "RESTRICT_SELECT_OFF"), ("scale_to_unit", "ARROW_LEFTRIGHT")),
    ),
    "cut": (
        "Cut",
        (
            ("cut_place", "EYEDROPPER"),
            ("cut_add", "ADD"),
            ("cut_flip", "ARROW_LEFTRIGHT"),
            ("cut_remove", "X"),
            (LINE, ""),
            ("cut_away", "FACESEL"),
            ("bring_back", "LOOP_BACK"),
        ),
    ),
    "grid": (
        "Grid",
        (
            ("axis_from_sections", "EYEDROPPER"),
            ("margin_widen", "FULLSCREEN_EXIT"),
            ("grid_across", "MESH_PLANE"),
            ("boundary_remove", "MOD_OUTLINE"),
            (LINE, ""),
            ("planes_place", "MESH_PLANE"),
            ("plane_place", "EYEDROPPER"),
            ("plane_take", "EYEDROPPER"),
            ("plane_add", "ADD"),
            ("plane_remove", "REMOVE"),
            ("planes_spread", "ALIGN_JUSTIFY"),
            ("planes_mirror", "MOD_MIRROR"),
        ),
    ),
    "inspect": (
        "Inspect",
        (
            ("show_warning", "ERROR"),
            ("show_worst", "ZOOM_SELECTED"),
            ("taxel", "EYEDROPPER"),
            ("taxel_toggle", "HIDE_ON"),
            ("taxel_channel", "LINENUMBERS_ON"),
            ("taxel_mesh", "OUTLINER_OB_MESH"),
            (LINE, ""),
            ("compare", "FILEBROWSER"),
            ("compare_end", "X"),
            ("touches", "FILEBROWSER"),
            ("touches_move", "SNAP_ON"),
            ("touches_end", "X"),
            (LINE, ""),
            ("replay_open", "FILEBROWSER"),
            ("replay_play", "PLAY"),
            ("replay_close", "X"),
        ),
    ),
    "robot": (
        "Robot",
        (("propose_all", "OUTLINER_DATA_LATTICE"), ("fit_all", "SURFACE_DATA"), ("export_robot", "EXPORT")),
    ),
    "export": ("Export", (("export_calibration", "EXPORT"), ("export_plan", "EXPORT"), ("export_taxels", "EXPORT"))),
}
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


def add(layout, context, name, icon, **arguments):
    """Add an entry; operators that need a value become a menu of its values."""
    if name in CHOICES:
        layout.operator_menu_enum(f"skin_calib.{name}", CHOICES[name], icon=icon)
        return
    entry = layout.operator(f"skin_calib.{name}", icon=icon)
    link = context.object
    if name in ARGUMENTS and link is not None:
        arguments = ARGUMENTS[name](link.skin_calib)
    for argument, value in arguments.items():
        setattr(entry, argument, value)


class Entries:
    """A menu of the table."""

    def draw(self, context):
        for name, icon in MENUS[self.bl_idname.removeprefix("SKIN_MT_")][1]:
            if name == LINE:
                self.layout.separator()
            else:
                add(self.layout, context, name, icon)


TABLE = [
    type(f"SKIN_MT_{name}", (Entries, bpy.types.Menu), {"bl_idname": f"SKIN_MT_{name}", "bl_label": label})
    for name, (label, _) in MENUS.items()
]


class SKIN_MT_surfaces(bpy.types.Menu):
    bl_idname = "SKIN_MT_surfaces"
    bl_label = "Surfaces"

    def draw(self, context):
        plan = context.object.skin_calib
        for k, name in enumerate(surface_names(plan)):
            icon = "RADIOBUT_ON" if k == shown_index(plan) else "RADIOBUT_OFF"
            self.layout.operator("skin_calib.surface_show", text=name, icon=icon).index = k
        self.layout.separator()
        add(self.layout, context, "surface_add", "ADD")
        add(self.layout, context, "surface_remove", "X")


class SKIN_MT_skins(bpy.types.Menu):
    bl_idname = "SKIN_MT_skins"
    bl_label = "Skins"

    def draw(self, context):
        layout = self.layout
        for kind, text in (("sheet", "Add Sheet"), ("hexagons", "Add Boards")):
            layout.operator("skin_calib.skin_add", text=text, icon="ADD").kind = kind
        add(layout, context, "skin_import", "FILEBROWSER")
        layout.menu("SKIN_MT_presets", icon="PRESET")
        for i, skin in enumerate(context.object.skin_calib.skins):
            layout.separator()
            layout.label(text=skin.name)
            self.draw_skin(context, skin, i)

    def draw_skin(self, context, skin, i):
        """Add the operators on one skin."""
        layout = self.layout
        lists = {"sheet": (("landmark", "landmarks"),), "hexagons": (("zone", "excluded"),)}.get(skin.kind, ())
        if skin.kind == "imported":
            add(layout, context, "frame_find", "VIEWZOOM", skin=i)
        else:
            for name, icon in (("place", "EYEDROPPER"), ("place_at_cursor", "PIVOT_CURSOR")):
                add(layout, context, name, icon, what="origin", skin=i)
        if skin.kind == "hexagons":
            add(layout, context, "boards_paint", "BRUSH_DATA", skin=i)
        add(layout, context, "zones_from_faces", "FACESEL", skin=i)
        for what, listed in lists:
            add(layout, context, f"{what}_add", "ADD", skin=i)
            if len(getattr(skin, listed)):
                add(layout, context, f"{what}_remove", "REMOVE", skin=i, index=len(getattr(skin, listed)) - 1)
        if len(skin.taxels):
            add(layout, context, "single_taxel_remove", "REMOVE", skin=i, index=len(skin.taxels) - 1)
        if skin.kind != "imported":
            add(layout, context, "preset_save", "PRESET_NEW", skin=i)
        names = surface_names(context.object.skin_calib)
        for name in names if len(names) > 1 else ():
            put = layout.operator("skin_calib.skin_surface", text=f"On {name}", icon="SURFACE_DATA")
            put.skin, put.name = i, name
        add(layout, context, "skin_remove", "X", index=i)


class SKIN_MT_presets(bpy.types.Menu):
    """Skins that are presets of Blender: those of the extension, and those that the author saved"""

    bl_idname = "SKIN_MT_presets"
    bl_label = "Presets"
    preset_subdir = "skin_calib"
    preset_operator = "skin_calib.preset"
    draw = bpy.types.Menu.draw_preset


class SKIN_MT_skin(bpy.types.Menu):
    bl_idname = "SKIN_MT_skin"
    bl_label = "Skin"

    def draw(self, context):
        layout, link = self.layout, context.object
        layout.menu("SKIN_MT_open", icon="IMPORT")
        layout.separator()
        add(layout, context, "propose", "OUTLINER_DATA_LATTICE")
        add(layout, context, "fit", "SURFACE_DATA")
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


CLASSES = (*TABLE, SKIN_MT_presets, SKIN_MT_surfaces, SKIN_MT_skins, SKIN_MT_skin)
