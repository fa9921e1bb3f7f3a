# SPDX-License-Identifier: GPL-3.0-or-later
"""The surfaces of a link: show one of them in the panels, add and remove them."""

from dataclasses import replace
from itertools import count

import bpy

from ..skin_calib_addon.blender.scene import plans
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from ..skin_calib_addon.common.errors import InvalidPlan
from .base import INDEX, Edit, OnSkin, Operator


class OnSurfaces(Edit):
    """Changes the surfaces of the plan, or which of them the panels show."""

    def edit(self, context, plan):
        metre = metres_per_unit(context.scene)
        surfaces, shown = self.changed(plans.read_surfaces(plan, metre), plans.shown_index(plan))
        plans.write_surfaces(plan, surfaces, shown, metre)


class SKIN_OT_surface_show(OnSurfaces, Operator):
    """Show this surface in the panels, to change its cuts and planes"""

    bl_label = "Show Surface"

    index: bpy.props.IntProperty(name="Index", description="Which surface, from 0", **INDEX)

    def changed(self, surfaces, shown):
        if self.index >= len(surfaces):
            raise InvalidPlan(f"The plan has no surface {self.index}. It has {len(surfaces)}.")
        return surfaces, self.index

    def execute(self, context):
        plan = context.object.skin_calib
        before = plan.result.outdated, plan.diagnosis.outdated
        done = super().execute(context)
        plan.result.outdated, plan.diagnosis.outdated = before  # the plan is the same
        return done


class SKIN_OT_surface_add(OnSurfaces, Operator):
    """Add a surface, with the cuts and planes of the one that is shown, for another side of the link"""

    bl_label = "Add Surface"

    def changed(self, surfaces, shown):
        names = {surface.name for surface in surfaces}
        name = next(n for n in (f"surface_{k}" for k in count(2)) if n not in names)
        return (*surfaces, replace(surfaces[shown], name=name)), len(surfaces)


class SKIN_OT_surface_remove(OnSurfaces, Operator):
    """Remove the surface that is shown"""

    bl_label = "Remove Surface"

    def edit(self, context, plan):
        read = plans.read_plan(context.object, context.scene)
        name = read.surfaces[plans.shown_index(plan)].name
        on_it = [skin.name for skin in read.skins if read.surface_of(skin) == name]
        if on_it:
            raise InvalidPlan(f"Skin {on_it[0]!r} is on surface {name!r}. Move it to another surface first.")
        super().edit(context, plan)

    def changed(self, surfaces, shown):
        if len(surfaces) == 1:
            raise InvalidPlan("A plan needs a surface. This is the only one.")
        return surfaces[:shown] + surfaces[shown + 1 :], max(shown - 1, 0)


class SKIN_OT_skin_surface(OnSkin, Edit, Operator):
    """Put this skin on another surface of the link"""

    bl_label = "Surface"

    name: bpy.props.StringProperty(name="Surface", description="Name of the surface")

    def edit(self, context, plan):
        if self.name not in plans.surface_names(plan):
            raise InvalidPlan(f"The plan has no surface {self.name!r}.")
        plan.skins[self.skin].surface = self.name
