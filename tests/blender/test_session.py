"""What the window shows of a link belongs to it through undo, other names, copies, files, Live, Esc and reload."""

import sys

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from tests.blender.conftest import modules
from tests.blender.test_registration import draw

PARTS = ("scene.link_meshes", "scene.plans", "scene.results", "live.updates", "live.diagnoses", "overlay.drawing")
MAX_LINKS = 3
PREVIEW_DEVIATION = 5e-5  # [m] of taxels, as docs/explanation/results.md states
AWAITED = ("facets", "report", "layers", "sketch", "changed_at", "touched_at", "hashing", "compared", "playing")
which = st.integers(0, MAX_LINKS - 1)


class Window(RuleBasedStateMachine):
    """Up to three links that are edited, fitted, and taken through everything that replaces or renames objects."""

    bpy = extension = folder = plan_file = None

    @initialize()
    def open(self):
        """Start with an empty file and one link."""
        self.bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        self.ours = modules(self.extension, *PARTS)
        self.session, self.error = self.ours.updates.session, self.ours.updates.SkinCalibError
        self.ours.diagnoses.CHECK_DELAY = self.ours.updates.PREVIEW_WAIT = 0
        self.bpy.ops.ed.undo_push(message="empty")
        self.add()
        self.fit(0)
        self.switch_live(0, True)

    def links(self):
        """Return all links, in the order of their names."""
        return sorted((o for o in self.bpy.data.objects if o.skin_calib.link), key=lambda o: o.name)

    def choose(self, k):
        """Make one of the links the active object."""
        links = self.links()
        self.bpy.context.view_layer.objects.active = links[k % len(links)]
        return self.bpy.context.object

    def let_run(self, delay=60.0):
        """Let the timers run: previews are drawn and meshes compared; without a delay complete fits end, too."""
        ours = self.ours
        self.bpy.context.view_layer.update()
        ours.updates.FIT_DELAY = delay
        while ours.diagnoses.verify() is not None:
            pass
        while ours.updates.tick() == ours.updates.POLL_INTERVAL or self.is_waiting(not delay):
            pass

    def is_waiting(self, for_fits):
        """Return whether a preview is due, or anything that follows a change; a tick ends with one job of one link."""
        changed = [state for state in self.session.states.values() if state.changed_at is not None]
        return any(for_fits or not state.is_previewed for state in changed)

    def step(self):
        """End an edit of the author: a step of undo, and all that follows from it."""
        self.bpy.ops.ed.undo_push(message="step")
        self.let_run()

    def content(self, link):
        """Return plan and mesh of a link."""
        plan = self.ours.plans.read_plan(link, self.bpy.context.scene)
        return self.ours.updates._text_of(plan), self.ours.link_meshes.read_mesh(link, self.bpy.context).sha256

    def known(self, by):
        """Return which links have a current fit, and which are refused."""
        results, of = self.ours.results, self.session.of
        current = {by(link): link.skin_calib.result.key for link in self.links() if results.is_current(link)}
        return current, {by(link) for link in self.links() if of(link).is_refused}

    def changes_nothing(self, act, by=lambda link: link.session_uid, keeps_refusals=True):
        """Do what changes neither plan nor mesh: fits stay current, and refusals stay."""
        current, refused = self.known(by)
        act()
        self.let_run()
        now, refused_now = self.known(by)
        assert current.items() <= now.items()
        assert not keeps_refusals or refused <= refused_now

    @precondition(lambda self: len(self.links()) < MAX_LINKS)
    @rule()
    def add(self):
        """Open a link."""
        self.bpy.ops.skin_calib.import_plan(filepath=self.plan_file)
        self.step()

    @rule(k=which, planes=st.integers(5, 7))
    def change_grid(self, k, planes):
        self.choose(k).skin_calib.grid.n = planes
        self.step()

    @rule(k=which, columns=st.sampled_from([2, 3, 40, 500]))
    def change_skin(self, k, columns):
        """Forty columns overlap, which only the complete fit refuses; 500 go beyond the edge."""
        self.choose(k).skin_calib.skins[0].columns = columns
        self.step()

    @rule(k=which, factor=st.sampled_from([1.0, 0.95, 0.9]))
    def change_mesh(self, k, factor):
        self.choose(k).scale = (factor,) * 3
        self.step()

    @rule(k=which)
    def fit(self, k):
        """Press Fit; the link is current or refused then."""
        link = self.choose(k)
        try:
            self.bpy.ops.skin_calib.fit("EXEC_DEFAULT", True)
        except RuntimeError:
            assert self.session.of(link).is_refused
        else:
            assert self.ours.results.is_current(link)
        self.let_run()

    @rule(k=which, live=st.booleans())
    def switch_live(self, k, live):
        link = self.choose(k)
        self.changes_nothing(lambda: setattr(link.skin_calib, "live", live), keeps_refusals=not live)
        self.bpy.ops.ed.undo_push(message="live")

    @rule()
    def wait(self):
        """Complete fits end: where Live is on, the link is current or refused."""
        self.let_run(0.0)
        for link in self.links():
            done = self.ours.results.is_current(link) or self.session.of(link).is_refused
            assert done or not link.skin_calib.live

    @rule(k=which, name=st.sampled_from(["arm", "leg", "other"]))
    def rename(self, k, name):
        """Give an object a new name, or that of another one, which Blender makes different."""
        link = self.choose(k)
        self.changes_nothing(lambda: setattr(link, "name", name))
        self.bpy.ops.ed.undo_push(message="name")

    @precondition(lambda self: len(self.links()) < MAX_LINKS)
    @rule(k=which)
    def copy(self, k):
        """A copy has the plan and the fit, but nothing of what runs for the original."""
        link = self.choose(k)
        copy = link.copy()
        assert not any(getattr(self.session.of(copy), name) for name in (*AWAITED, "refused"))
        self.changes_nothing(lambda: self.bpy.context.scene.collection.objects.link(copy))
        self.bpy.ops.ed.undo_push(message="copy")

    @precondition(lambda self: len(self.links()) > 1)
    @rule(k=which)
    def delete(self, k):
        self.bpy.data.objects.remove(self.choose(k))
        self.step()

    @rule(back=st.booleans())
    def undo(self, back):
        """Undo or redo: nothing is shown until it is computed anew, and a refusal stays where nothing has changed."""
        refused = {o.session_uid: self.content(o) for o in self.links() if self.session.of(o).is_refused}
        undo, redo = self.bpy.ops.ed.undo, self.bpy.ops.ed.redo
        act = undo if back else redo
        if not act.poll():
            return
        act()
        if not self.links():
            redo()
        assert not any(state.layers or state.report for state in self.session.states.values())
        self.let_run()
        for link in self.links():
            if refused.get(link.session_uid) == self.content(link):
                assert self.session.of(link).is_refused or link.skin_calib.live

    @rule(k=which, planes=st.integers(5, 7))
    def click(self, k, planes):
        """Paint: the skin follows the click although Live is off, until Esc, and is fitted then."""
        link, updates = self.choose(k), self.ours.updates
        updates.accompany(link)
        self.change_grid(k, planes)
        updates.leave(link.session_uid)
        self.let_run(0.0)
        assert self.ours.results.is_current(link) or self.session.of(link).is_refused

    @rule(k=which)
    def refuse(self, k):
        """Fit columns that overlap."""
        self.change_skin(k, 40)
        self.fit(k)
        assert self.session.of(self.choose(k)).is_refused

    @rule(k=which, planes=st.integers(5, 7))
    def change_during_fit(self, k, planes):
        """Change the plan when Live has just computed the fit of the plan before."""
        self.choose(k).skin_calib.live = True
        self.change_grid(k, planes)
        updates = self.ours.updates
        updates.FIT_DELAY = 0.0
        updates.tick()
        if self.session.job is not None:
            self.session.job.work.is_done(None)
        self.change_grid(k, planes + 1)

    @rule(k=which)
    def stop(self, k):
        """An operator waits for a fit, and Esc stops it."""
        link, updates = self.choose(k), self.ours.updates

        def wait_and_stop():
            updates.hold(link.session_uid, link.name)
            updates.show_progress("Fitting, 1 s")
            assert draw(self.bpy, "status")[0] == "Fitting, 1 s"
            self.let_run()
            updates.release()

        self.changes_nothing(wait_and_stop)
        assert self.session.busy is None

    @rule()
    def reload(self):
        """Disable and enable the extension: the file has plans and fits, and nothing is awaited."""

        def disable_and_enable():
            module = sys.modules[self.extension]
            module.unregister()
            assert not self.session.states and self.session.job is None
            module.register()

        self.changes_nothing(disable_and_enable, keeps_refusals=False)
        for link in self.links():
            link.skin_calib.live = link.skin_calib.live  # Live follows from the next change on
        self.let_run()

    @rule()
    def reopen(self):
        """Save the file and open it again."""
        path = str(self.folder / "links.blend")

        def save_and_open():
            self.bpy.ops.wm.save_as_mainfile(filepath=path)
            self.bpy.ops.wm.open_mainfile(filepath=path)
            assert self.session.states.keys() <= {thing.session_uid for thing in self.bpy.data.objects}

        self.changes_nothing(save_and_open, by=lambda link: link.name, keeps_refusals=False)

    @invariant()
    def state_is_that_of_the_link(self):
        """What is shown of each link follows from its plan and its mesh."""
        uids = {thing.session_uid for thing in self.bpy.data.objects}
        for uid, state in self.session.states.items():
            assert uid in uids or not any(getattr(state, name) for name in AWAITED)
        for link in self.links():
            state, key, full = self.session.of(link), None, None
            try:
                plan = self.ours.plans.read_plan(link, self.bpy.context.scene)
                key, full = self.ours.results.fit(plan, self.ours.link_meshes.read_mesh(link, self.bpy.context))
            except self.error:
                assert not self.ours.results.is_current(link)
            if full is not None:
                assert not state.is_refused
            if self.ours.results.is_current(link):
                assert link.skin_calib.result.key == key
            if full is not None and state.layers is not None:
                patches = full.calibration.patches
                exact = np.concatenate([patch.taxels.positions_link for patch in patches])
                assert np.linalg.norm(state.layers.taxels.positions - exact, axis=1).max() < PREVIEW_DEVIATION
                mean = max(np.nanmean(np.abs(fit.residuals)) for fit in full.fits.values())
                assert state.report.mean == pytest.approx(mean, rel=1e-6)
        self.choose(0)
        for name in ("status", "mesh", "robot", "cut", "grid", "skin"):
            draw(self.bpy, name)


def test_state_belongs_to_its_link_through_any_sequence(bpy, extension, tmp_path, plan_file):
    """No state of another object, of an earlier plan or of a removed object is shown, and no handler fails."""
    machine = type("Links", (Window,), {})
    machine.bpy, machine.extension, machine.folder, machine.plan_file = bpy, extension, tmp_path, str(plan_file())
    ours = modules(extension, "live.updates", "live.diagnoses")
    with pytest.MonkeyPatch.context() as patch:  # the machine sets these
        for module, name in (
            (ours.updates, "FIT_DELAY"),
            (ours.updates, "PREVIEW_WAIT"),
            (ours.diagnoses, "CHECK_DELAY"),
        ):
            patch.setattr(module, name, getattr(module, name))
        run_state_machine_as_test(
            machine, settings=settings(max_examples=settings().max_examples // 3, stateful_step_count=15)
        )
