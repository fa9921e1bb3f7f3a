# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces without skin: those that are selected in Edit Mode, or those of the active vertex group."""

import bpy
import numpy as np

from ..skin_calib_addon.blender.overlay import drawing
from ..skin_calib_addon.blender.scene import cut_away, skins
from ..skin_calib_addon.blender.scene.face_groups import group_triangles, triangles_of
from ..skin_calib_addon.blender.scene.skins import entry
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from ..skin_calib_addon.common.errors import InvalidMesh, SkinCalibError, counted
from ..skin_calib_addon.skin.single_taxels import short_id
from ..skin_calib_addon.skin.zones import discs_over, taxels_over
from .base import Edit, OnSkin, Operator


class SKIN_OT_zones_from_faces(OnSkin, Edit, Operator):
    bl_label = "Exclude Faces"
    bl_description = (
        "Keep the skin away from the faces selected in Edit Mode, or from those of the active vertex group. Boards get "
        "excluded zones, and follow the vertex group; taxels of a sheet or of a file are disabled once, as they are now"
    )

    radius: bpy.props.FloatProperty(
        name="Largest Radius [mm]",
        description="Of one zone of boards. Larger: fewer zones, which protrude more over the faces",
        default=10.0,
        min=1.0,
        max=1000.0,
    )

    def edit(self, context, plan):
        link, skin = context.object, entry(plan.skins, self.skin, "skin")
        group = "" if link.mode == "EDIT" else active_group(link)
        if group and skin.kind == "hexagons":
            skin.zone_group = group
            self.report({"INFO"}, f"{skin.name}: no boards over the vertex group {group}")
            return
        metre = metres_per_unit(context.scene)
        if group:
            self.disable(link, skin, group_triangles(link, group))
            return
        chosen = selected(link)
        triangles = triangles_of(link, metre, chosen)
        if skin.kind != "hexagons":
            self.disable(link, skin, triangles)
            return
        discs = discs_over(triangles, self.radius * 1e-3)
        for point, radius in discs:
            zone = skin.excluded.add()
            zone.point, zone.radius = point / metre, radius / metre
        self.report({"INFO"}, f"{skin.name}: {counted(len(discs), 'zone')} for {counted(int(chosen.sum()), 'face')}")

    def disable(self, link, skin, triangles):
        """Disable the taxels of the last fit whose cells are over faces."""
        patches = drawing.patches_of(link)
        if not patches:
            raise SkinCalibError("Fit the link first, to see its taxels.")
        patch = patches[self.skin]
        is_old = drawing.is_of_last_fit(link)
        over = np.flatnonzero(taxels_over(triangles, patch.taxels))
        for i in over:
            skins.single_taxel(skin, short_id(patch, patch.taxels.ids[i])).enabled = False
        done = f"{skin.name}: {counted(len(over), 'taxel')} disabled"
        if is_old:
            self.report({"WARNING"}, f"{done}, as in the last fit. If the skin has moved, fit and repeat this.")
        else:
            self.report({"INFO"}, done)


def selected(link):
    """Return which faces are selected in Edit Mode, shape (f,); an error if none is."""
    link.update_from_editmode()
    chosen = cut_away.selection_of(link)
    if not chosen.any():
        raise InvalidMesh(f"No face of {link.name} is selected. Select the faces without skin.")
    return chosen


def active_group(link):
    """Return the name of the active vertex group; an error without one, or if it has no complete face."""
    group = link.vertex_groups.active
    if group is None:
        raise InvalidMesh(f"{link.name} has no vertex group. Select faces in Edit Mode, or add a vertex group.")
    if not len(group_triangles(link, group.name)):
        raise InvalidMesh(f"The vertex group {group.name} of {link.name} has no complete face. Add vertices to it.")
    return group.name
