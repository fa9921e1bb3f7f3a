# SPDX-License-Identifier: GPL-3.0-or-later
"""Computations that continue in a thread if they take longer, so that the window stays responsive."""

from time import perf_counter

from ..skin_calib_addon.blender.live import updates
from ..skin_calib_addon.blender.live.background import Work
from ..skin_calib_addon.blender.overlay import drawing
from ..skin_calib_addon.blender.scene import link_objects, skins
from ..skin_calib_addon.common.errors import SkinCalibError, counted

# [s] A computation that takes longer continues in a thread.
MAX_BLOCKING_TIME = 0.3


class Waiting:
    """Waits for a computation in a thread; Esc stops it. Before, ``work``, ``doing`` and ``subject`` are set."""

    uid = None  # of the object whose name is the subject; None: it is a file
    number = ""  # of the object among several

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
            return self.stopped()
        if event.type == "TIMER" and self.work.is_done():
            updates.release()
            done = self.take(context)
            if done:
                self.end(context)
                return done
            updates.hold(self.uid, self.subject)
        self.show_progress(context)
        return {"PASS_THROUGH"}

    def take(self, context):
        """Use the result of the computation; return that of the operator, or None if another computation runs."""
        raise NotImplementedError

    def stopped(self):
        """Report that the computation was stopped; return the result of the operator."""
        self.report({"INFO"}, f"{self.subject}: {self.doing} was stopped")
        return {"CANCELLED"}

    def show_progress(self, context):
        """Show stage and time in the status bar and in the status of the link."""
        stage = f": {self.work.stage}" if self.work.stage else ""
        seconds = f"{perf_counter() - self.start:.0f} s"
        context.workspace.status_text_set(f"{self.subject}{self.number}: {self.doing}{stage}, {seconds}    Esc: stop")
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


class Working(Waiting):
    """Computes something for the active object, or for each of several, and stores each result as soon as it is there.

    Esc keeps what is finished. In a script and in batch it blocks.
    """

    did = ""  # words before the number of links in the final report; empty: ``store`` reports

    def chosen(self, context):
        """Return the links to work on; report or raise why there are none."""
        return [context.object]

    def task(self, context, link):
        """Read the scene, and return the computation for a link, which needs no Blender."""
        raise NotImplementedError

    def store(self, context, link, result):
        """Write the result to the scene, or raise why the link has none."""
        raise NotImplementedError

    def keep_reason(self, link, error):
        """Keep why a link has no result, for the panels."""

    def execute(self, context):
        return self.work_on_all(context, is_blocking=True)

    def invoke(self, context, event):
        return self.work_on_all(context, is_blocking=False)

    def work_on_all(self, context, is_blocking):
        """Compute and store the results; if it takes longer, wait while Blender handles other events."""
        try:
            self.left = [(link.name, link.session_uid) for link in self.chosen(context)]
        except SkinCalibError as error:
            return self.refuse(error)
        self.total, self.done, self.refusals = len(self.left), 0, []
        seconds = None if is_blocking else MAX_BLOCKING_TIME if self.total == 1 else 0.0
        while self.start_next(context):
            if not self.work.is_done(seconds):
                return self.wait(context)
            self.finish_link(context)
        return self.conclude()

    def take(self, context):
        self.finish_link(context)
        return None if self.start_next(context) else self.conclude()

    def start_next(self, context):
        """Start the computation for the next link; return whether there is one."""
        while self.left:
            self.subject, self.uid = self.left.pop(0)
            self.number = f" ({self.total - len(self.left)} of {self.total})" if self.total > 1 else ""
            try:
                link = self.found()
                self.subject = link.name
                self.work = Work(self.task(context, link))
            except SkinCalibError as error:
                self.note(error)
                continue
            drawing.redraw()  # the list marks the link
            return True
        return False

    def found(self):
        """Return the object, also if it has got another name, or raise because it was removed."""
        link = link_objects.of_uid(self.uid)
        if link is None:
            raise SkinCalibError(f"{self.subject} was removed in the meantime.")
        return link

    def finish_link(self, context):
        """Store the result of the computation, or why there is none."""
        try:
            link = self.found()
            with link_objects.in_scene(link):  # the window can show another one now
                self.store(context, link, self.work.result())
            self.done += 1
        except SkinCalibError as error:
            self.note(error)
        drawing.redraw()

    def note(self, error):
        """Keep and report why a link has no result."""
        self.refusals.append(error)
        link = link_objects.of_uid(self.uid)
        if link is not None:
            self.keep_reason(link, error)
        if self.total > 1:
            self.report({"WARNING"}, f"{link.name}: {skins.in_window(error)}" if link else str(error))

    def stopped(self):
        if self.total == 1:
            return super().stopped()
        self.report({"INFO"}, f"Stopped. Finished: {self.done} of {counted(self.total, 'link')}")
        return {"FINISHED"} if self.done else {"CANCELLED"}  # what is finished is one step of undo

    def conclude(self):
        """Report how many links have a result; a single link that is refused is an error."""
        if self.total == 1 and self.refusals:
            return self.refuse(self.refusals[0])
        refused = f"; refused: {len(self.refusals)}" if self.refusals else ""
        if self.total and self.did:
            self.report({"INFO"}, f"{self.did} {counted(self.done, 'link')}{refused}")
        return {"FINISHED"}
