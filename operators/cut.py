# SPDX-License-Identifier: GPL-3.0-or-later
"""Which part of the link is covered: planes that cut it, and faces that the author cuts away."""

import bpy
import numpy as np

from ..skin_calib_addon.blender.scene import cut_away, link_meshes
from ..skin_calib_addon.blender.scene.skins import entry
from ..skin_calib_addon.blender.scene.units import metres_per_unit, vector
from ..skin_calib_addon.common.errors import InvalidMesh, SkinCalibError, counted
from ..skin_calib_addon.geometry.grid.cut_planes import cut_normal
from .base import INDEX, Edit, Operator, no_mesh, not_editable
from .lists import RemoveEntry
from .picking import NORMAL, AtCursor, Picking


class AddCut(AtCursor, Edit):
    """Adds a plane across the link through a point; it keeps the larger part. The redo panel has point and normal."""

    normal: bpy.props.FloatVectorProperty(
        name="Normal", description="Perpendicular to the cut, towards the part that is kept", **NORMAL
    )

    def edit(self, context, plan):
        self.start(context)
        if not self.properties.is_property_set("normal"):
            self.normal = self.across(context, plan)
        cut = plan.cover.cuts.add()
        cut.point, cut.normal = self.point, self.normal
        plan.cover.cut_index = len(plan.cover.cuts) - 1

    def across(self, context, plan):
        """Return the normal across the link: along the author's axis, else along that of the mesh, else along z."""
        grid = plan.grid
        has_axis = not grid.auto_axis and grid.kind != "planes" and any(grid.direction)
        try:
            mesh = link_meshes.read_facets(context.object, context).welded()
        except InvalidMesh:
            return (0, 0, 1)
        at = np.array(vector(self.point, metres_per_unit(context.scene)))
        return cut_normal(mesh, at, np.array(grid.direction) if has_axis else None)


class SKIN_OT_cut_add(AddCut, Operator):
    """Add a plane that cuts the cover; it starts at the 3D cursor, across the link, and keeps the larger part"""

    bl_label = "Add Cut"


class SKIN_OT_cut_place(Picking, AddCut, Operator):
    """Click on the link to add a plane that cuts it there, across the link, and keeps the larger part"""

    bl_label = "Add Cut on Link"

    prompts = ("Click on the link to cut it there    Esc: no cut",)


class SKIN_OT_cut_flip(Edit, Operator):
    """Keep the other side of this cut"""

    bl_label = "Flip Cut"

    index: bpy.props.IntProperty(name="Index", description="Which cut, from 0", **INDEX)

    def edit(self, context, plan):
        cut = entry(plan.cover.cuts, self.index, "cut")
        cut.normal = [0.0 - x for x in cut.normal]  # no minus zero


class SKIN_OT_cut_remove(RemoveEntry, Operator):
    """Remove this cut from the active link"""

    bl_label = "Remove Cut"
    what = "cut"

    def entries(self, plan):
        return plan.cover.cuts

    def edit(self, context, plan):
        super().edit(context, plan)
        plan.cover.cut_index = max(
            0, min(plan.cover.cut_index - (self.index < plan.cover.cut_index), len(plan.cover.cuts) - 1)
        )


def not_in_edit_mode(context):
    """Return that faces have to be selected first."""
    return "" if context.mode == "EDIT_MESH" else "Select faces in Edit Mode (Tab) first"


class SKIN_OT_cut_away(Operator):
    """Remove the selected faces from the cover; the mesh keeps them, and Bring Back restores them"""

    bl_label = "Cut Away Selection"
    blocked_by = (no_mesh, not_editable, not_in_edit_mode)

    def act(self, context):
        link = context.object
        bpy.ops.object.mode_set(mode="OBJECT")  # the result is visible there, and one step of undo reverts all of it
        try:
            chosen = cut_away.selected(link)
        except SkinCalibError:
            bpy.ops.object.mode_set(mode="EDIT")
            raise
        cut_away.cut(link, chosen)
        link.skin_calib.result.outdated = True
        self.report({"INFO"}, f"{link.name}: {counted(int(chosen.sum()), 'face')} cut away")


def nothing_cut_away(context):
    """Return that no face was cut away by hand."""
    return "" if cut_away.modifier_of(context.object) else "No face of this link was cut away by hand"


class SKIN_OT_bring_back(Operator):
    """Add the faces that were cut away by hand to the cover again"""

    bl_label = "Bring Back"
    blocked_by = (no_mesh, nothing_cut_away)

    def act(self, context):
        link = context.object
        if link.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        cut_away.bring_back(link)
        link.skin_calib.result.outdated = True
