# SPDX-License-Identifier: GPL-3.0-or-later
"""Update what is drawn while a plan changes: hand-placed planes, and with Live on, surface and skin.

A change only requests an update. A timer starts it between two redraws, so that many changes at a time make one update.
A thread computes it. The result is a preview, which is not part of the file and of undo. After a short time without
changes, a complete fit replaces the preview.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...common.errors import SkinCalibError
from ...common.warnings import Warning
from ...plan import Plan, plan_document
from ..overlay import drawing
from ..scene import link_meshes, link_objects, plans, results
from ..scene.face_groups import groups_of
from ..scene.facets import Facets
from ..scene.plane_lists import read_hand_planes
from ..scene.warnings import refusal_of
from . import events
from .background import Work
from .preview import Preview, PreviewInput, PreviewReport, StepCache, compute_preview
from .sketch import Sketch, sketch_of

# [s] Time without a change after which the complete fit starts. Larger: the exact errors come later; smaller: fits
# start between two steps of a drag.
FIT_DELAY = 0.4
# [s] Time for which the window waits for a preview. Larger: the window freezes longer; smaller: the preview comes one
# redraw later.
PREVIEW_WAIT = 0.03
POLL_INTERVAL = 0.01  # [s] between two checks of a running job. Larger: results are drawn later


@dataclass(frozen=True, eq=False)
class Job:
    """A running computation for an object."""

    name: str
    since: float  # time of the change that it follows [s]
    work: Work
    use: Callable[[bpy.types.Object, Any], None]
    is_final: bool


Input = tuple[str, Facets | None]  # plan as text, and mesh of a link; or why one of them cannot be read, and None

reports: dict[str, PreviewReport] = {}  # by the object's name
sketches: dict[str, Sketch] = {}
after_fit: list[Callable[[bpy.types.Object, bpy.types.Scene], None]] = []  # called once a complete fit is stored
_changed: dict[str, float] = {}  # time of the last change of objects without a new fit
_previewed: set[str] = set()  # objects whose preview shows the last change
_possibly_changed: set[str] = set()  # objects whose mesh or position may have changed
_fitted_facets: dict[str, Facets] = {}  # facets of the last fit
_fitted_groups: dict[str, Any] = {}  # zones of the vertex groups of that time
_caches: dict[str, StepCache] = {}
_guests: set[str] = set()  # objects that are followed although Live is off
_leaving: set[str] = set()  # guests until their next result
_refused: dict[str, tuple[Input, PreviewReport]] = {}  # the last refusal, and what was refused
_held: dict[str, str] = {}  # progress of the operator that works on an object, by its name
_accompanied: set[tuple[str, str]] = set()  # names of guests, and their plans: undo and redo bring these back
_job: Job | None = None
_last_final: Work | None = None  # can still run after it was stopped


def request(link: bpy.types.Object) -> None:
    """Request an update, because a plan or its mesh has changed."""
    _stop_final(link.name)
    _changed[link.name] = perf_counter()
    _previewed.discard(link.name)
    events.wake(tick)


def _stop_final(name: str) -> None:
    """Stop the complete fit of an object."""
    global _job
    if _job is not None and _job.is_final and _job.name == name:
        _job.work.stop()
        _job = None


def hold(name: str) -> None:
    """Stop the complete fit of an object, and start none until :func:`release`: the button Fit makes one."""
    _stop_final(name)
    _held[name] = ""


def release(name: str) -> None:
    """Allow complete fits of an object again."""
    _held.pop(name, None)
    drawing.redraw()  # the status has the progress


def held() -> str:
    """Return the name of the object that the button Fit works on; empty without one."""
    return next(iter(_held), "")


def show_progress(name: str, words: str) -> None:
    """Show in the status of an object that an operator works on it, between :func:`hold` and :func:`release`."""
    if _held[name] != words:
        _held[name] = words
        drawing.redraw()


def progress(name: str) -> str:
    """Return what an operator does with an object now; empty without one."""
    return _held.get(name, "")


def accompany(link: bpy.types.Object) -> None:
    """Follow the changes of a link until :func:`leave`, although Live is off."""
    _guests.add(link.name)
    _leaving.discard(link.name)
    request(link)


def leave(name: str) -> None:
    """End :func:`accompany`, after the fit of the last change."""
    if name in _changed:
        _leaving.add(name)
    else:
        _guests.discard(name)


def _leave_now(name: str) -> None:
    """End :func:`accompany` for an object that waits for it."""
    if name in _leaving:
        _leaving.discard(name)
        _guests.discard(name)


def changed(result: Any, _context: Any) -> None:
    """Request an update of a link whose result has become outdated. A change, or a fit, ends an earlier refusal."""
    result.id_data.skin_calib.refusal = ""
    if result.outdated:
        result.id_data.skin_calib.diagnosis.outdated = True
        request(result.id_data)


def switched(plan: Any, _context: Any) -> None:
    """Start or stop live updates of a link."""
    forget(plan.id_data.name)
    request(plan.id_data)


def facets_of(link: bpy.types.Object) -> Facets:
    """Return the facets of an object that is to be fitted; its result becomes outdated when they change."""
    _fitted_facets[link.name] = link_meshes.read_facets(link, bpy.context, _fitted_facets.get(link.name))
    _fitted_groups[link.name] = groups_of(link)
    _possibly_changed.discard(link.name)  # Blender has just evaluated the object
    return _fitted_facets[link.name]


def possibly_changed(link: bpy.types.Object) -> None:
    """Request a comparison of a mesh with the one that was fitted or drawn, because it may have changed."""
    if link.name in _fitted_facets:
        _possibly_changed.add(link.name)
        events.wake(tick)


def tick() -> float | None:
    """Start, draw and finish updates; return the seconds to the next call, None if nothing is left."""
    global _job
    _check_possibly_changed()
    if _job is None:
        _begin()
    if _job is not None and _job.work.is_done(PREVIEW_WAIT):
        job, _job = _job, None
        _use_result(job)
        drawing.redraw()
    if _job is not None:
        return POLL_INTERVAL
    return 0.05 if _changed else None


def _check_possibly_changed() -> None:
    """Mark results as outdated whose mesh, or a vertex group without boards, has changed."""
    names = tuple(_possibly_changed)
    _possibly_changed.clear()
    for name in names:  # not those that reading and writing touch: a property of an object with nodes touches it again
        link = bpy.data.objects.get(name)
        if link is None or name not in _fitted_facets or link_objects.why_not(link):
            continue
        if name in _changed and name not in _previewed and follows(link):  # the preview that is due reads the mesh
            continue
        before = _fitted_facets[name]
        try:
            with link_objects.in_scene(link):
                facets = link_meshes.read_facets(link, bpy.context, before)
                groups = groups_of(link)
        except SkinCalibError:
            link.skin_calib.result.outdated = True
            continue
        if facets is before and groups == _fitted_groups[name]:
            continue
        if link.skin_calib.result.outdated:  # since an earlier change: its preview, or its fit, is of another mesh
            _fitted_facets[name], _fitted_groups[name] = facets, groups
        link.skin_calib.result.outdated = True


def _begin() -> None:
    """Start the next job."""
    for name in list(_changed):
        link = bpy.data.objects.get(name)
        if link is None or link_objects.why_not(link):
            forget(name)
            continue
        if name not in _previewed:
            _previewed.add(name)
            _start(link, _preview, _show, False)
        elif (
            follows(link)
            and name not in _held
            and perf_counter() - _changed[name] >= FIT_DELAY
            and (_last_final is None or _last_final.is_done())
        ):
            _start(link, _finish, _store, True)
        if _job is not None:
            return
        if name in _changed and not follows(link):
            forget(name)
            _refuse_again(link)


def follows(link: bpy.types.Object) -> bool:
    """Return whether Live is on for a link, or it is accompanied, and its result is outdated."""
    plan = link.skin_calib
    is_on = plan.live or link.name in _guests
    return bool(is_on and plan.link and (plan.result.outdated or results.find(plan.result.key) is None))


def _start(link: bpy.types.Object, make: Callable[..., Any], use: Callable[..., None], is_final: bool) -> None:
    """Read the scene, and start the task of ``make`` in a thread."""
    global _job, _last_final
    try:
        with link_objects.in_scene(link):
            task = make(link)
    except SkinCalibError as error:
        refuse(link, refusal_of(error))
        return
    if task is not None:
        _job = Job(link.name, _changed[link.name], Work(task), use, is_final)
        _last_final = _job.work if is_final else _last_final


def _use_result(job: Job) -> None:
    """Draw or store the result of a job, if its object exists and its plan has not been replaced by undo."""
    link = bpy.data.objects.get(job.name)
    if link is None or job.name not in _changed:
        return
    try:
        with link_objects.in_scene(link):
            job.use(link, job.work.result())
    except SkinCalibError as error:
        refuse(link, refusal_of(error))


def refuse(link: bpy.types.Object, refusal: Warning) -> None:
    """Report why a plan cannot be computed. The reason stays while plan and mesh are the same."""
    if results.is_current(link):
        link.skin_calib.result.outdated = True  # with a new name of the object, the reason is lost, and the tick shown
    link.skin_calib.inspect.marked_place = ""  # of a warning that the refusal replaces
    reports[link.name] = PreviewReport(refusal=refusal)
    _refused[link.name] = _input_of(link, _fitted_facets.get(link.name)), reports[link.name]
    _changed.pop(link.name, None)
    _previewed.discard(link.name)
    _leave_now(link.name)
    drawing.redraw()


def is_refused(link: bpy.types.Object) -> bool:
    """Return whether the plan of a link cannot be computed."""
    return link.name in reports and reports[link.name].refusal is not None


def of_warnings(link: bpy.types.Object) -> str:
    """Return what the warnings of a link are about: the plan that is refused, or the key of the fit."""
    return _refused[link.name][0][0] if is_refused(link) else str(link.skin_calib.result.key)


def _refuse_again(link: bpy.types.Object) -> None:
    """Report the last refusal of a link again if plan and mesh are as they were, as after undo of something else."""
    result = link.skin_calib.result
    if link.name not in _refused or result.key and not result.outdated:
        return
    given, report = _refused[link.name]
    if _input_of(link, given[1]) == given:
        reports[link.name] = report
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
    plan, refusal, start = None, None, perf_counter()
    if follows(link):
        try:
            plan = plans.read_plan(link, bpy.context.scene)
        except SkinCalibError as error:
            refusal = refusal_of(error)
        if plan is not None and link.name in _guests:
            _accompanied.add((link.name, _text_of(plan)))
    elif not planes.are_there:
        _remove_sketch(link.name)
        return None
    given = PreviewInput(start, facets_of(link), planes, plan, refusal, drawing.switched_on(link))
    cache = _caches.setdefault(link.name, StepCache())
    return lambda begin: compute_preview(cache, given)


def _text_of(plan: Plan) -> str:
    return json.dumps(plan_document(plan), sort_keys=True)


def _was_accompanied(link: bpy.types.Object) -> bool:
    """Return whether the plan of a link was followed although Live was off, and its fit is not stored now."""
    if not link.skin_calib.link or not link.skin_calib.result.outdated or not _accompanied:
        return False
    try:
        with link_objects.in_scene(link):
            return (link.name, _text_of(plans.read_plan(link, bpy.context.scene))) in _accompanied
    except SkinCalibError:
        return False


def _show(link: bpy.types.Object, preview: Preview) -> None:
    """Draw a preview."""
    _draw_sketch(link, preview.sketch)
    reports.pop(link.name, None)
    if preview.report is None:
        return
    if preview.report.refusal:
        refuse(link, preview.report.refusal)
    else:
        reports[link.name], drawing.previews[link.name] = preview.report, preview.layers


def _draw_sketch(link: bpy.types.Object, sketch: Sketch) -> None:
    sketches[link.name] = sketch
    drawing.set_layers("planes", link.name, tuple(sketch.layers))


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
    _draw_sketch(link, sketch)
    drawing.prepare(key, result)
    results.write_result(link, bpy.context.scene, result, key)
    for act in after_fit:
        act(link, bpy.context.scene)
    forget(link.name)
    _leave_now(link.name)


def forget(name: str) -> None:
    """Remove the requests and the preview of an object; the sketch of its planes stays."""
    _changed.pop(name, None)
    _previewed.discard(name)
    drawing.previews.pop(name, None)
    reports.pop(name, None)
    if name not in bpy.data.objects:
        _remove_sketch(name)
        _caches.pop(name, None)
        _fitted_facets.pop(name, None)
        _fitted_groups.pop(name, None)
        _refused.pop(name, None)


def _remove_sketch(name: str) -> None:
    if sketches.pop(name, None) is not None:
        drawing.remove_layers("planes", name)
        drawing.redraw()


@persistent
def _scene_replaced(*_: Any) -> None:
    """Update all links after undo, redo, or the opening of a file: the drawn previews are of other plans."""
    _clear()
    for link in bpy.data.objects:
        if link.type == "MESH" and (link.skin_calib.live or link.skin_calib.link):
            request(link)
            if link.name not in _guests and _was_accompanied(link):
                _guests.add(link.name)
                _leaving.add(link.name)


@persistent
def _updated(_scene: Any, depsgraph: bpy.types.Depsgraph) -> None:
    """Remember objects whose mesh, modifiers or position may have changed."""
    for update in depsgraph.updates:
        is_other = update.is_updated_geometry or update.is_updated_transform
        if is_other and isinstance(update.id, bpy.types.Object):
            possibly_changed(update.id)


@persistent
def _frame_changed(_scene: Any, depsgraph: bpy.types.Depsgraph) -> None:
    """Remember animated links with Live on; meshes of others are not read while frames are played."""
    for update in depsgraph.updates:
        if isinstance(update.id, bpy.types.Object) and update.id.original.skin_calib.live:
            possibly_changed(update.id)


def _clear() -> None:
    """Stop all updates, and remove all previews."""
    global _job
    if _job is not None:
        _job.work.stop()
        _job = None
    for of_names in (
        _changed,
        _previewed,
        _possibly_changed,
        _fitted_facets,
        _fitted_groups,
        _caches,
        reports,
        sketches,
        drawing.previews,
    ):
        of_names.clear()
    drawing.remove_layers("planes")
    for name in tuple(_leaving):
        _leave_now(name)


HANDLERS = dict.fromkeys(events.SCENE_REPLACED, _scene_replaced) | {
    "depsgraph_update_post": _updated,
    "frame_change_post": _frame_changed,
}


def register() -> None:
    """Listen to undo, redo and changes of meshes."""
    events.listen(HANDLERS)


def unregister() -> None:
    """Stop listening."""
    events.ignore(HANDLERS, (tick,))
    _clear()
    for of_operators in (_guests, _leaving, _held, _accompanied, _refused):
        of_operators.clear()
