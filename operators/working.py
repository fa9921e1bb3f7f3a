# SPDX-License-Identifier: GPL-3.0-or-later
"""Computations that continue in a thread if they take longer, so that the window stays responsive."""

from time import perf_counter

from ..skin_calib_addon.blender.live import updates
from ..skin_calib_addon.blender.live.background import Work
from ..skin_calib_addon.blender.scene import link_objects, skins
from ..skin_calib_addon.blender.session import session
from ..skin_calib_addon.common.errors import SkinCalibError

# [s] A computation that takes longer continues in a thread.
MAX_BLOCKING_TIME = 0.3


class WhileIdle:
    """Available while no other computation runs."""

    @classmethod
    def why_not(cls, context):
        busy = f"Wait for the work on {session.busy.name}, or press Esc to stop it" if session.busy else ""
        return super().why_not(context) or busy


class Waiting:
    """Waits for a computation in a thread; Esc stops it. Before, ``work`` and ``doing`` are set, and the object."""

    uid = None  # of the object; None: it works on a file

    def work_on(self, link):
        """Set the object, whose result is stored also if it gets another name."""
        self.subject, self.uid = link.name, link.session_uid

    def found(self):
        """Return the object, or raise because it was removed."""
        link = link_objects.of_uid(self.uid)
        if link is None:
            raise SkinCalibError(f"{self.subject} was removed in the meantime.")
        return link

    def store_result(self, context):
        """Store the result of the computation, or raise why there is none."""
        link = self.found()
        with link_objects.in_scene(link):  # the window can show another one now
            self.store(context, link, self.work.result())

    def wait(self, context):
        """Wait, while Blender handles other events."""
        updates.hold(self.uid, self.subject)
        self.start = perf_counter()
        self.show_progress(context)
        self.timer = context.window_manager.event_timer_add(0.1, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self.end(context)
            self.report({"INFO"}, f"{self.subject}: {self.doing} was stopped")
            return {"CANCELLED"}
        if event.type == "TIMER" and self.work.is_done():
            self.end(context)
            return self.take(context)
        self.show_progress(context)
        return {"PASS_THROUGH"}

    def show_progress(self, context, number=""):
        """Show stage and time in the status bar and in the status of the link; ``number`` counts the links."""
        stage = f": {self.work.stage}" if self.work.stage else ""
        seconds = f"{perf_counter() - self.start:.0f} s"
        context.workspace.status_text_set(f"{self.subject}{number}: {self.doing}{stage}, {seconds}    Esc: stop")
        updates.show_progress(f"{self.doing}{stage}, {seconds}. Esc stops it")

    def refuse(self, error):
        """Report an error; the scene stays as it was."""
        self.report({"ERROR"}, skins.in_window(error))
        return {"CANCELLED"}

    def cancel(self, context):
        """End because Blender opens a file, or quits."""
        self.end(context)

    def end(self, context):
        """Clear the status bar and stop the computation."""
        self.work.stop()
        updates.release()
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)


class Working(Waiting, WhileIdle):
    """Computes something for the active object, and stores it there; in a script and in batch it blocks."""

    def task(self, context):
        """Read the scene, and return the computation, which needs no Blender."""
        raise NotImplementedError

    def store(self, context, link, result):
        """Write the result to the scene and report it."""
        raise NotImplementedError

    def execute(self, context):
        self.work_on(context.object)
        try:
            task = self.task(context)
            self.store(context, context.object, task(lambda stage: None))
        except SkinCalibError as error:
            return self.refuse(error)
        return {"FINISHED"}

    def invoke(self, context, event):
        self.work_on(context.object)
        try:
            self.work = Work(self.task(context))
        except SkinCalibError as error:
            return self.refuse(error)
        return self.take(context) if self.work.is_done(MAX_BLOCKING_TIME) else self.wait(context)

    def take(self, context):
        """Store the result, if its object still exists."""
        try:
            self.store_result(context)
        except SkinCalibError as error:
            return self.refuse(error)
        return {"FINISHED"}
