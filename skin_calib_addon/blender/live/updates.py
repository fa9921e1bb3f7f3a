# SPDX-License-Identifier: GPL-3.0-or-later
"""Update what is drawn while a plan changes: hand-placed planes, and with Live on, surface and skin.

A change only requests an update. A timer starts it between two redraws, so that many changes at a time make one update.
A thread computes it. The result is a preview, which is not part of the file and of undo. After a short time without
changes, a complete fit replaces the preview.
"""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...common.errors import SkinCalibError
from ...common.warnings import Warning
from ...plan import Plan, plan_document
from ..inspection.taxels import read_again
from ..overlay import drawing
from ..scene import link_meshes, link_objects, plans, results
from ..scene.face_groups import groups_of
from ..scene.facets import Facets
from ..scene.plane_lists import read_hand_planes
from ..scene.warnings import refusal_of
from ..session import SCENE_REPLACED, Busy, Input, Job, LinkState, session, wake
from .background import Work
from .preview import Preview, PreviewInput, PreviewReport, compute_preview
from .sketch import Sketch, sketch_of

# [s] Time without a change after which the complete fit starts. Larger: the exact errors come later; smaller: fits
# start between two steps of a drag.
FIT_DELAY = 0.4
# [s] Time for which the window waits for a preview. Larger: the window freezes longer; smaller: the preview comes one
# redraw later.
PREVIEW_WAIT = 0.03
POLL_INTERVAL = 0.01  # [s] between two checks of a running job. Larger: results are drawn later


def request(link: bpy.types.Object) -> None:
    """Request an update, because a plan or its mesh has changed."""
    session.stop_fit(link.session_uid)
    session.of(link).change()
    wake(tick)


def hold(uid: int | None, name: str) -> None:
    """Stop the complete fit of an object, and start none until :func:`release`: the button Fit makes one."""
    session.stop_fit(uid)
    session.busy = Busy(uid, name)


def release() -> None:
    """Allow complete fits again."""
    session.busy = None
    drawing.redraw()  # the status has the progress


def show_progress(words: str) -> None:
    """Show in the status of an object that an operator works on it, between :func:`hold` and :func:`release`."""
    if session.busy is not None and session.busy.progress != words:
        session.busy.progress = words
        drawing.redraw()


def accompany(link: bpy.types.Object) -> None:
    """Follow the changes of a link until :func:`leave`, although Live is off."""
    session.of(link).is_accompanied = True
    request(link)


def leave(uid: int) -> None:
    """End :func:`accompany`, after the fit of the last change."""
    state = session.of_uid(uid)
    state.is_accompanied, state.is_followed_once = False, state.changed_at is not None


def changed(result: Any, _context: Any) -> None:
    """Request an update of a link whose result has become outdated. A change, or a fit, ends an earlier refusal."""
    result.id_data.skin_calib.refusal = ""
    if result.outdated:
        result.id_data.skin_calib.diagnosis.outdated = True
        request(result.id_data)


def switched(plan: Any, _context: Any) -> None:
    """Start or stop live updates of a link."""
    session.of(plan.id_data).forget()
    request(plan.id_data)


def facets_of(link: bpy.types.Object) -> Facets:
    """Return the facets of an object that is to be fitted; its result becomes outdated when they change."""
    state = session.of(link)
    state.facets = link_meshes.read_facets(link, bpy.context, state.facets)
    state.groups, state.is_touched = groups_of(link), False  # Blender has just evaluated the object
    return state.facets


def touched(link: bpy.types.Object) -> None:
    """Request a comparison of a mesh with the one that was fitted or drawn, because it may have changed."""
    state = session.states.get(link.session_uid)
    if state is not None and state.facets is not None:
        state.is_touched = True
        wake(tick)


def tick() -> float | None:
    """Start, draw and finish updates; return the seconds to the next call, None if nothing is left."""
    links = list(session.links())
    _compare_touched(links)
    if session.job is None:
        _begin(links)
    if session.job is not None and session.job.work.is_done(PREVIEW_WAIT):
        job, session.job = session.job, None
        _use_result(job)
        drawing.redraw()
    if session.job is not None:
        return POLL_INTERVAL
    return 0.05 if any(state.changed_at is not None for state in session.states.values()) else None


def _compare_touched(links: list[tuple[bpy.types.Object, LinkState]]) -> None:
    """Mark results as outdated whose mesh, or a vertex group without boards, has changed."""
    known = [(link, state) for link, state in links if state.is_touched]
    for _, state in known:
        state.is_touched = False
    for link, state in known:  # reading and writing can touch it again: a property of an object with nodes does
        before = state.facets
        if before is None or link_objects.why_not(link):
            continue
        if state.changed_at is not None and not state.is_previewed and follows(link):
            continue  # the preview that is due reads the mesh
        try:
            with link_objects.in_scene(link):
                facets = link_meshes.read_facets(link, bpy.context, before)
                groups = groups_of(link)
        except SkinCalibError:
            link.skin_calib.result.outdated = True
            continue
        if facets.is_same(before) and groups == state.groups:
            continue
        if link.skin_calib.result.outdated:  # since an earlier change: its preview, or its fit, is of another mesh
            state.facets, state.groups = facets, groups
        link.skin_calib.result.outdated = True


def _begin(links: list[tuple[bpy.types.Object, LinkState]]) -> None:
    """Start the next job."""
    for link, state in links:
        if state.changed_at is None:
            continue
        if link_objects.why_not(link):
            state.forget()
            continue
        if not state.is_previewed:
            state.is_previewed = True
            _start(link, _preview, _show, False)
        elif (
            follows(link)
            and (session.busy is None or session.busy.uid != link.session_uid)
            and perf_counter() - state.changed_at >= FIT_DELAY
            and (session.last_final is None or session.last_final.is_done())
        ):
            _start(link, _finish, _store, True)
        if session.job is not None:
            return
        if state.changed_at is not None and not follows(link):
            state.forget()
            _refuse_again(link)


def follows(link: bpy.types.Object) -> bool:
    """Return whether Live is on for a link, or it is accompanied, and its result is outdated."""
    plan, state = link.skin_calib, session.of(link)
    is_on = plan.live or state.is_accompanied or state.is_followed_once
    return bool(is_on and plan.link and (plan.result.outdated or results.find(plan.result.key) is None))


def _start(link: bpy.types.Object, make: Callable[..., Any], use: Callable[..., None], is_final: bool) -> None:
    """Read the scene, and start the task of ``make`` in a thread."""
    try:
        with link_objects.in_scene(link):
            task = make(link)
    except SkinCalibError as error:
        refuse(link, refusal_of(error))
        return
    if task is not None:
        session.job = Job(link.session_uid, Work(task), use, is_final)
        session.last_final = session.job.work if is_final else session.last_final


def _use_result(job: Job) -> None:
    """Draw or store the result of a job, if its object exists and its plan has not been replaced by undo."""
    link = link_objects.of_uid(job.uid)
    if link is None or session.of(link).changed_at is None:
        return
    try:
        with link_objects.in_scene(link):
            job.use(link, job.work.result())
    except SkinCalibError as error:
        refuse(link, refusal_of(error))


def refuse(link: bpy.types.Object, refusal: Warning) -> None:
    """Report why a plan cannot be computed. The reason stays while plan and mesh are the same."""
    if results.is_current(link):
        link.skin_calib.result.outdated = True  # a file has no refusals, and would show the tick
    link.skin_calib.inspect.marked_place = ""  # of a warning that the refusal replaces
    state = session.of(link)
    state.refuse(_input_of(link, state.facets), PreviewReport(refusal=refusal))
    drawing.redraw()


def of_warnings(link: bpy.types.Object) -> str:
    """Return what the warnings of a link are about: the plan that is refused, or the key of the fit."""
    state = session.of(link)
    return state.refused[0][0] if state.is_refused and state.refused else str(link.skin_calib.result.key)


def _refuse_again(link: bpy.types.Object) -> None:
    """Report the last refusal of a link again if plan and mesh are as they were, as after undo of something else."""
    state, result = session.of(link), link.skin_calib.result
    if state.refused is None or result.key and not result.outdated:
        return
    (text, facets), report = state.refused
    text_now, facets_now = _input_of(link, facets)
    if text_now == text and (facets_now is facets or facets_now is not None and facets_now.is_same(facets)):
        state.report = report
        drawing.redraw()


def _input_of(link: bpy.types.Object, before: Facets | None) -> Input:
    """Return plan and mesh of a link, for comparison with those of another time, whose facets are ``before``."""
    try:
        with link_objects.in_scene(link):
            text = _text_of(plans.read_plan(link, bpy.context.scene))
            return text, link_meshes.read_facets(link, bpy.context, before)
    except SkinCalibError as error:
        return str(error), None


def _preview(link: bpy.types.Object) -> Callable[..., Preview] | None:
    """Return the task of a preview: planes only, or surface and skin without exact errors if Live is on."""
    planes = read_hand_planes(link, bpy.context.scene)
    state, plan, refusal, start = session.of(link), None, None, perf_counter()
    if follows(link):
        try:
            plan = plans.read_plan(link, bpy.context.scene)
        except SkinCalibError as error:
            refusal = refusal_of(error)
        if plan is not None and (state.is_accompanied or state.is_followed_once):
            state.accompanied_plans.add(_text_of(plan))
    elif not planes.are_there:
        if state.sketch is not None:
            state.sketch = None
            drawing.redraw()
        return None
    given = PreviewInput(start, facets_of(link), planes, plan, refusal, drawing.switched_on(link))
    return lambda begin: compute_preview(state.steps, given)


def _text_of(plan: Plan) -> str:
    """Return a plan as text, without the name of its mesh, which can be that of the object."""
    return json.dumps(plan_document(replace(plan, mesh=Path("mesh"))), sort_keys=True)


def _was_accompanied(link: bpy.types.Object) -> bool:
    """Return whether the plan of a link was followed although Live was off, and its fit is not stored now."""
    plans_before = session.of(link).accompanied_plans
    if not link.skin_calib.link or not link.skin_calib.result.outdated or not plans_before:
        return False
    try:
        with link_objects.in_scene(link):
            return _text_of(plans.read_plan(link, bpy.context.scene)) in plans_before
    except SkinCalibError:
        return False


def _show(link: bpy.types.Object, preview: Preview) -> None:
    """Draw a preview."""
    state = session.of(link)
    state.sketch, state.report = preview.sketch, None
    if preview.report is None:
        return
    if preview.report.refusal:
        refuse(link, preview.report.refusal)
    else:
        state.report, state.layers = preview.report, preview.layers


def _finish(link: bpy.types.Object) -> Callable[..., Any]:
    """Return the task of a complete fit, and of the sketch, which was coarse if cuts moved."""
    plan, facets = plans.read_plan(link, bpy.context.scene), facets_of(link)
    planes = read_hand_planes(link, bpy.context.scene)

    def fit(begin: Any) -> tuple[str, Any, Sketch]:
        mesh = facets.mesh()
        return *results.fit(plan, mesh, begin), sketch_of(mesh, planes)

    return fit


def _store(link: bpy.types.Object, fitted: Any) -> None:
    """Store the result of a complete fit, and draw its sketch."""
    key, result, sketch = fitted
    state = session.of(link)
    state.sketch = sketch
    store(link, bpy.context.scene, key, result)
    state.forget()
    state.is_followed_once = False


def store(link: bpy.types.Object, scene: bpy.types.Scene, key: str, result: Any) -> None:
    """Store and draw a complete fit."""
    results.write_result(link, scene, result, key)
    read_again(link, scene)


@persistent
def _scene_replaced(*_: Any) -> None:
    """Update all links after undo, redo, or the opening of a file: the drawn previews are of other plans."""
    for link in bpy.data.objects:
        if link.type == "MESH" and (link.skin_calib.live or link.skin_calib.link):
            request(link)
            session.of(link).is_followed_once = _was_accompanied(link)


HANDLERS = dict.fromkeys(SCENE_REPLACED, _scene_replaced)
TIMERS = (tick,)
