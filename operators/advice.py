# SPDX-License-Identifier: GPL-3.0-or-later
"""Show the place of a warning, and do what one advises that no other operator does."""

import bpy

from ..skin_calib_addon.blender.live import updates
from ..skin_calib_addon.blender.live.advice import REFUSAL, give_up, hidden_surface, mark_of, offered, warning_at
from ..skin_calib_addon.blender.overlay import drawing
from ..skin_calib_addon.blender.overlay.layers import place_of
from ..skin_calib_addon.blender.scene import link_objects, plans, skins
from ..skin_calib_addon.blender.scene.showing import show_place
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from ..skin_calib_addon.common.errors import SkinCalibError
from ..skin_calib_addon.pipeline.remedies import MARGIN_STEP, mends
from .base import INDEX, Operator, busy, no_link
from .working import Working


class OnWarning:
    """Works on a warning of the active link, or on the refusal of its last fit."""

    blocked_by = (no_link,)
    index: bpy.props.IntProperty(
        name="Index", description="Which warning, from 0; -1: the refusal", **INDEX | {"min": REFUSAL}
    )


class SKIN_OT_show_warning(OnWarning, Operator):
    """Mark the place of this warning, and move cursor and view there; again: remove the mark"""

    bl_label = "Show"

    def act(self, context):
        link = context.object
        warning, inspect = warning_at(link, self.index), link.skin_calib.inspect
        if warning is None or warning.where.point is None:
            self.report({"WARNING"}, "This warning has no single place")
            return {"CANCELLED"}
        token = mark_of(warning)
        drawing.redraw()
        if inspect.marked_place == token:
            inspect.marked_place = ""
            return None
        inspect.marked_place = token
        drawing.cache(token, (place_of(warning.where.point, link_objects.longest_side(link, context.scene)),))
        show_place(context, link, warning.where.point)
        return None


class SKIN_OT_take_advice(Working, OnWarning, Operator):
    """Do what this warning advises, if a trial shows that it helps, on its surface, which the panels then show"""

    bl_label = "Do What It Advises"
    blocked_by = (no_link, busy)

    doing = "Trying a change"

    def task(self, context, link):
        metre = metres_per_unit(context.scene)
        warning = warning_at(link, self.index)
        offers = list(offered(warning, link.skin_calib, metre)) if warning else []
        if not offers:
            raise SkinCalibError("No button does what this warning advises")
        action, properties = offers[0]
        self.given = warning, action, properties
        if not action.change:
            return lambda begin: True
        plan, facets = plans.read_plan(link, context.scene), updates.facets_of(link)
        return lambda begin: mends(action.change, plan, facets.mesh(), warning)

    def store(self, context, link, helps):
        """Make the change, or leave the plan as it is and do not offer it again."""
        warning, action, properties = self.given
        if not helps:
            give_up(link, warning, action)
            drawing.redraw()
            raise SkinCalibError(f"{action.text} was tried, and does not mend it. The plan is unchanged")
        with context.temp_override(object=link, active_object=link):
            surface = hidden_surface(warning, link.skin_calib)
            if surface is not None:
                bpy.ops.skin_calib.surface_show(index=surface)
            module, name = action.operator.split(".")
            getattr(getattr(bpy.ops, module), name)(**properties)

    def refuse(self, error):
        """Report why nothing was changed."""
        self.report({"WARNING"}, skins.in_window(error))
        return {"CANCELLED"}


class SKIN_OT_margin_widen(Operator):
    """Leave more of both ends of the link free"""

    bl_label = "Widen the Margin"
    blocked_by = (no_link,)

    def act(self, context):
        grid = context.object.skin_calib.grid
        before = 0.0 if grid.auto_margin else grid.margin
        grid.auto_margin = False
        step = MARGIN_STEP * link_objects.longest_side(context.object, context.scene)
        grid.margin = before + step / metres_per_unit(context.scene)


class SKIN_OT_grid_across(Operator):
    """Put the planes across a face with this outward normal"""

    bl_label = "Use Across"
    blocked_by = (no_link,)

    normal: bpy.props.FloatVectorProperty(
        name="Outward", description="Outward normal of the face, out of the robot", default=(0, 0, -1)
    )

    def act(self, context):
        grid = context.object.skin_calib.grid
        if grid.kind == "auto":
            grid.region = "across"
        else:
            grid.kind = "across"
        grid.normal = self.normal
