# SPDX-License-Identifier: GPL-3.0-or-later
"""The axis of the grid through two sections that the author picks, as in the paper."""

import bpy

from ..skin_calib_addon.blender.scene import link_meshes, plans
from ..skin_calib_addon.blender.scene.decimals import in_units, vector
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from ..skin_calib_addon.geometry import cut_cover
from ..skin_calib_addon.geometry.grid.axis import axis_through
from .base import Edit, Operator, no_link
from .picking import POINT, Picking


class SKIN_OT_axis_from_sections(Picking, Edit, Operator):
    """Click on the link twice: the axis joins the centres of the two sections there, towards the second"""

    bl_label = "Axis from Two Sections"
    blocked_by = (no_link,)

    first: bpy.props.FloatVectorProperty(name="First", description="A point of the first section", **POINT)
    second: bpy.props.FloatVectorProperty(name="Second", description="A point of the second section", **POINT)

    def edit(self, context, plan):
        link, metre = context.object, metres_per_unit(context.scene)
        cover = cut_cover(link_meshes.read_mesh(link, context), plans.shown_surface(link, context.scene).cover)
        axis = axis_through(cover, vector(self.first, metre), vector(self.second, metre))
        plan.grid.auto_axis = False
        plan.grid.point, plan.grid.direction = in_units(axis.point, metre), axis.direction

    prompts = tuple(f"Click on the {which} section of the link    Esc: keep the axis" for which in ("first", "second"))

    def take(self, points):
        self.first, self.second = points
