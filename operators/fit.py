# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit the active link."""

from time import perf_counter

import bpy
from mathutils import Vector

from ..skin_calib_addon.blender.live import updates
from ..skin_calib_addon.blender.live.background import Work
from ..skin_calib_addon.blender.overlay import drawing
from ..skin_calib_addon.blender.scene import results, scene, skins
from ..skin_calib_addon.common.errors import SkinCalibError
from .on_link import OnLink, OnResult

# [s] A fit that takes longer continues in a thread, and the window stays responsive.
MAX_BLOCKING_TIME = 0.3


class SKIN_OT_fit(OnLink, bpy.types.Operator):
    """Fit the surface and place the skins of the active link; Esc stops a long fit"""

    bl_idname = "skin_calib.fit"
    bl_label = "Fit"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        try:
            task = self.task(context)
            return self.keep(context, context.object, *task(lambda stage: None))
        except SkinCalibError as error:
            return self.refuse(error)

    def task(self, context):
        """Read the scene, and return the computation, which needs no Blender."""
        plan, facets = scene.read_plan(context.object, context.scene), updates.facets_of(context.object)
        self.given = plan, facets
        return lambda begin: results.fit(plan, facets.mesh(), begin)

    def keep(self, context, link, key, result):
        """Store and draw the result, and report its errors."""
        drawing.prepare(key, result)
        scene.write_result(link, context.scene, result, key)
        drawing.redraw()
        mean = result.fit.errors.surface_to_mesh.mean
        self.report({"INFO"}, f"{link.skin_calib.link}: mean error {mean * 1e3:.4f} mm")
        for warning in result.warnings:  # last, because the window shows what was reported last
            self.report({"WARNING"}, str(warning))
        return {"FINISHED"}

    def refuse(self, error):
        """Report an error; the last result stays."""
        self.report({"ERROR"}, skins.in_window(error))
        return {"CANCELLED"}

    def invoke(self, context, event):
        try:
            self.work = Work(self.task(context))
        except SkinCalibError as error:
            return self.refuse(error)
        self.link, self.start = context.object.name, perf_counter()
        if self.work.is_done(MAX_BLOCKING_TIME):
            return self.take(context)
        self.timer = context.window_manager.event_timer_add(0.1, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self.end(context)
            self.report({"INFO"}, f"The fit of {self.link} was stopped")
            return {"CANCELLED"}
        if event.type == "TIMER" and self.work.is_done():
            self.end(context)
            return self.take(context)
        seconds = perf_counter() - self.start
        context.workspace.status_text_set(f"Fitting {self.link}: {self.work.stage}, {seconds:.0f} s    Esc: stop")
        return {"PASS_THROUGH"}

    def take(self, context):
        """Store the result; it is outdated where the plan or the mesh has changed since the start."""
        link = bpy.data.objects.get(self.link)
        if link is None:
            return self.refuse(SkinCalibError(f"{self.link} was removed or renamed during the fit. Fit again."))
        try:
            self.keep(context, link, *self.work.result())
        except SkinCalibError as error:
            return self.refuse(error)
        if not self.is_unchanged(context, link):
            link.skin_calib.result.outdated = True
        return {"FINISHED"}

    def is_unchanged(self, context, link):
        """Return whether plan and mesh are still those of the fit."""
        plan, facets = self.given
        try:
            is_same = scene.read_plan(link, context.scene) == plan
            return is_same and scene.read_facets(link, context).is_same(facets)
        except SkinCalibError:
            return False

    def cancel(self, context):
        """End because Blender opens a file, or quits."""
        self.end(context)

    def end(self, context):
        """Clear the status bar and stop the computation."""
        self.work.stop()
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)


class SKIN_OT_show_worst(OnResult, bpy.types.Operator):
    """Move the 3D cursor and the view to the position of the maximum deviation of surface from mesh"""

    bl_idname = "skin_calib.show_worst"
    bl_label = "Show Maximum Deviation"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        _, point, distance = results.find(context.object.skin_calib.result.key).fit.worst
        place = scene.link_frame(context.object) @ (Vector(point) / scene.metres_per_unit(context.scene))
        context.scene.cursor.location = place
        if context.region_data is not None:
            context.region_data.view_location = place
        self.report({"INFO"}, f"Distance from surface to mesh at the 3D cursor: {distance * 1e3:.4f} mm")
        return {"FINISHED"}


CLASSES = (SKIN_OT_fit, SKIN_OT_show_worst)
