# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit the active link."""

from dataclasses import replace

from ..skin_calib_addon.blender.live import updates
from ..skin_calib_addon.blender.overlay import drawing
from ..skin_calib_addon.blender.overlay.layers import maximum_of
from ..skin_calib_addon.blender.properties.inspect import maximum_token
from ..skin_calib_addon.blender.scene import link_meshes, plans, results, skins
from ..skin_calib_addon.blender.scene.showing import show_place
from ..skin_calib_addon.blender.scene.units import metres_per_unit
from ..skin_calib_addon.blender.scene.warnings import refusal_of
from ..skin_calib_addon.blender.session import session
from ..skin_calib_addon.common.errors import SkinCalibError
from .base import Operator, busy, no_fit, no_link
from .working import Working


def fit_of(context, link):
    """Return plan and facets of a link, and the computation of its fit, which needs no Blender."""
    plan, facets = plans.read_plan(link, context.scene), updates.facets_of(link)
    return (plan, facets), lambda begin: results.fit(plan, facets.mesh(), begin)


def store_fit(context, link, given, result):
    """Store and draw the fit of a link; it is outdated if plan or facets are no longer those that were given."""
    key, calibrated = result
    session.of(link).report = None
    updates.store(link, context.scene, key, calibrated)
    link.skin_calib.result.outdated = not _is_unchanged(context, link, *given)
    drawing.redraw()


def _is_unchanged(context, link, plan, facets):
    """Return whether plan and mesh are still those of the fit."""
    try:
        is_same = replace(plans.read_plan(link, context.scene), mesh=plan.mesh) == plan  # an export names the mesh
        return is_same and link_meshes.read_facets(link, context).is_same(facets)
    except SkinCalibError:
        return False


class SKIN_OT_fit(Working, Operator):
    """Fit the surface and place the skins of the active link; Esc stops a long fit"""

    bl_label = "Fit"
    blocked_by = (no_link, busy)

    doing = "Fitting"

    def task(self, context, link):
        self.given, task = fit_of(context, link)
        return task

    def store(self, context, link, result):
        """Store the result, and report its errors."""
        _, calibrated = result
        store_fit(context, link, self.given, result)
        mean = f"{calibrated.mean * 1e3:.4f} mm{results.least_exact(link.skin_calib)}"
        self.report({"INFO"}, f"{link.skin_calib.link}: mean error {mean}")
        warnings = link_meshes.placement_warnings(link, metres_per_unit(context.scene))
        for warning in (*warnings, *results.warnings_of(link, calibrated)):  # last: the window shows the last report
            self.report({"WARNING"}, str(warning))

    def keep_reason(self, link, error):
        updates.refuse(link, refusal_of(error))

    def refuse(self, error):
        """Report why there is no fit. The reason is in the panel, which a pop-up would hide."""
        if not self.options.is_invoke:
            return super().refuse(error)
        self.report({"WARNING"}, skins.in_window(error))
        return {"CANCELLED"}


class SKIN_OT_show_worst(Operator):
    """Mark the maximum deviation of surface from mesh, and move cursor and view there; again: remove the mark"""

    bl_label = "Show Maximum Deviation"
    blocked_by = (no_link, no_fit)

    def act(self, context):
        settings = context.object.skin_calib
        key, inspect = settings.result.key, settings.inspect
        drawing.redraw()
        if inspect.marked == key:
            inspect.marked = ""
            return
        inspect.marked, fit = key, results.find(key).worst_fit
        drawing.cache(maximum_token(key), (maximum_of(fit),))
        _, point, distance = fit.worst
        show_place(context, context.object, point)
        self.report({"INFO"}, f"Distance from surface to mesh at the 3D cursor: {distance * 1e3:.4f} mm")
