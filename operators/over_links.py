# SPDX-License-Identifier: GPL-3.0-or-later
"""Computations for several links, one after the other, in a thread."""

from ..skin_calib_addon.blender.live import updates
from ..skin_calib_addon.blender.live.background import Work
from ..skin_calib_addon.blender.overlay import drawing
from ..skin_calib_addon.blender.scene import link_objects, skins
from ..skin_calib_addon.common.errors import SkinCalibError, counted
from .working import Waiting, WhileIdle


class OverLinks(Waiting, WhileIdle):
    """Computes something for each of several links, and stores each result as soon as it is there.

    Esc keeps what is finished. In a script and in batch it blocks.
    """

    did = ""  # words before the number of links in the final report

    def chosen(self, context):
        """Return the links to work on; report or raise why there are none."""
        raise NotImplementedError

    def task(self, context, link):
        """Read the scene, and return the computation for a link, which needs no Blender."""
        raise NotImplementedError

    def store(self, context, link, result):
        """Write the result to the scene, or raise why the link has none."""
        raise NotImplementedError

    def keep_reason(self, link, error):
        """Keep why a link has no result, for the list of links."""
        raise NotImplementedError

    def execute(self, context):
        try:
            self.choose(context)
        except SkinCalibError as error:
            return self.refuse(error)
        while self.start_next(context):
            self.work.is_done(None)
            self.finish_link(context)
        return self.conclude()

    def invoke(self, context, event):
        try:
            self.choose(context)
        except SkinCalibError as error:
            return self.refuse(error)
        return self.wait(context) if self.start_next(context) else self.conclude()

    def modal(self, context, event):
        if event.type == "ESC":
            self.end(context)
            self.report({"INFO"}, f"Stopped. Finished: {self.done} of {counted(self.total, 'link')}")
            return {"FINISHED"} if self.done else {"CANCELLED"}  # what is finished is one step of undo
        if event.type == "TIMER" and self.work.is_done():
            updates.release()
            self.finish_link(context)
            if not self.start_next(context):
                self.end(context)
                return self.conclude()
            updates.hold(self.uid, self.subject)
        number = f" ({self.total - len(self.left)} of {self.total})" if self.total > 1 else ""
        self.show_progress(context, number)
        return {"PASS_THROUGH"}

    def choose(self, context):
        """Choose the links."""
        self.left = [(link.name, link.session_uid) for link in self.chosen(context)]
        self.total, self.done, self.refusals = len(self.left), 0, []

    def start_next(self, context):
        """Start the computation for the next link; return whether there is one."""
        while self.left:
            self.subject, self.uid = self.left.pop(0)
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

    def finish_link(self, context):
        """Store the result of the computation, or why there is none."""
        try:
            self.store_result(context)
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

    def conclude(self):
        """Report how many links have a result; a single link that is refused is an error."""
        if self.total == 1 and self.refusals:
            return self.refuse(self.refusals[0])
        refused = f"; refused: {len(self.refusals)}" if self.refusals else ""
        if self.total:
            self.report({"INFO"}, f"{self.did} {counted(self.done, 'link')}{refused}")
        return {"FINISHED"}
