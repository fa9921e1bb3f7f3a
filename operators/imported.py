# SPDX-License-Identifier: GPL-3.0-or-later
"""Taxels of a file: add them as a skin, and find their frame."""

from pathlib import Path

import bpy

from ..skin_calib_addon.blender.inspection.comparing import TAXEL_ENDINGS
from ..skin_calib_addon.blender.properties.of_keys import menu_of, words_of
from ..skin_calib_addon.blender.scene import link_meshes, plans, skins
from ..skin_calib_addon.blender.scene.fields import kept_path, write_key
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from ..skin_calib_addon.calibration.exchange import read_taxels
from ..skin_calib_addon.geometry import cut_cover
from ..skin_calib_addon.plan.keys import IMPORTED
from ..skin_calib_addon.plan.skins import Frame
from ..skin_calib_addon.skin.imported import frame_on
from .base import Edit, KeepsLink, OnSkin, Operator
from .files import FromFile


class SKIN_OT_skin_import(KeepsLink, Edit, FromFile, Operator):
    """Add a skin to the active link: the taxels of a file that another program wrote"""

    bl_label = "Import Taxels"

    filter_glob: bpy.props.StringProperty(
        default=";".join(f"*{ending}" for ending in TAXEL_ENDINGS), options={"HIDDEN"}
    )
    format: bpy.props.EnumProperty(**menu_of(IMPORTED.key("format")))
    only: bpy.props.StringProperty(**words_of(IMPORTED.key("only")))

    def edit(self, context, plan):
        path = bpy.path.abspath(self.filepath)
        taxels = read_taxels(path, None if self.format == "auto" else self.format, self.only or None)
        metre = metres_per_unit(context.scene)
        skin = skins.add_skin(plan.skins, "imported", metre, Path(path).stem)
        skin.file, skin.format, skin.only = kept_path(path), self.format, self.only
        named = "" if taxels.frame is None else f" in the frame {taxels.frame}"
        self.report({"INFO"}, f"{Path(path).name}: {len(taxels.labels)} taxels{named}")


class SKIN_OT_frame_find(OnSkin, Edit, Operator):
    """Find the rotation and translation that put the taxels of the file on the mesh, if only one pose fits"""

    bl_label = "Find Frame"

    def edit(self, context, plan):
        skins.of_kind(plan, self.skin, "imported", "frame of a file")
        read = plans.read_plan(context.object, context.scene)
        skin = read.skins[self.skin]
        taxels = read_taxels(skin.file, skin.format, skin.only)
        surface = next(surface for surface in read.surfaces if surface.name == read.surface_of(skin))
        cover = cut_cover(link_meshes.read_mesh(context.object, context), surface.cover)
        rotation, translation = frame_on(taxels, cover, skin.name, skin.frame)
        frame = Frame(tuple(map(tuple, rotation.tolist())), tuple(translation.tolist()))
        write_key(IMPORTED.key("frame"), plan.skins[self.skin], frame, metres_per_unit(context.scene))
