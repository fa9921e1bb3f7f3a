# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn while a plan changes: planes placed by hand, and where the author wants that surface and skin.

A change only asks for a look; a timer begins it between two draws, so that many changes in one go make one, and it is
computed beside the main thread. What is drawn meanwhile is a preview, which no file and no undo step knows. Once the
plan has rested, the fit that the button makes takes its place.
"""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...common.errors import SkinCalibError
from ..overlay import overlay
from ..scene import results, scene
from ..scene.facets import Facets
from ..scene.plane_lists import read_hand_planes
from ..scene.skins import in_window
from . import events
from .background import Work
from .preview import Asked, Kept, Look, Told, look
from .sketch import Sketch

REST = 0.4  # [s] without a change, after which the fit is finished
FRAME = 0.03  # [s] for which a preview is waited for, before the window goes on without it
POLL = 0.01  # [s]


@dataclass(frozen=True, eq=False)
class Job:
    """What is being computed for which object."""

    name: str
    since: float  # of the change that it answers
    work: Work
    take: Callable[[bpy.types.Object, Any], None]
    is_final: bool


told: dict[str, Told] = {}  # by the object's name
sketches: dict[str, Sketch] = {}
_changed: dict[str, float] = {}  # objects whose plan changed since their last fit, and when
_drawn: set[str] = set()  # those whose preview shows the last change
_touched: set[str] = set()  # those whose mesh or place may have changed
_seen: dict[str, Facets] = {}  # that were fitted last
_kept: dict[str, Kept] = {}
_job: Job | None = None
_last_final: Work | None = None  # may go on for a while after nobody waits for it


def request(link: bpy.types.Object) -> None:
    """A plan or its mesh has changed: look at it soon."""
    global _job
    if _job is not None and _job.is_final and _job.name == link.name:
        _job.work.stop()
        _job = None
    _changed[link.name] = perf_counter()
    _drawn.discard(link.name)
    events.wake(tick)


def changed(result: Any, _context: Any) -> None:
    """The result of a link is outdated, or no longer."""
    if result.outdated:
        request(result.id_data)


def switched(plan: Any, _context: Any) -> None:
    """A link begins to follow, or stops."""
    forget(plan.id_data.name)
    request(plan.id_data)


def facets_of(link: bpy.types.Object) -> Facets:
    """The facets of an object that is going to be fitted; others will outdate its result."""
    _seen[link.name] = scene.read_facets(link, bpy.context)
    return _seen[link.name]


def tick() -> float | None:
    """Begin what has changed, draw what is done, finish what has rested. The seconds to the next call, if any."""
    global _job
    _look_at_touched()
    if _job is None:
        _begin()
    if _job is not None and _job.work.is_done(FRAME):
        job, _job = _job, None
        _take(job)
    overlay.redraw()
    if _job is not None:
        return POLL
    return 0.05 if _changed else None


def _look_at_touched() -> None:
    """Results whose mesh is another one now are outdated."""
    names = tuple(_touched)
    _touched.clear()
    for name in names:  # not those that reading and writing touch: a property of an object with nodes touches it again
        link = bpy.data.objects.get(name)
        if link is None or name not in _seen or scene.why_not(link):
            continue
        try:
            is_same = scene.read_facets(link, bpy.context).is_same(_seen[name])
        except SkinCalibError:
            is_same = False
        if not is_same and not link.skin_calib.result.outdated:
            link.skin_calib.result.outdated = True


def _begin() -> None:
    """Begin the next job."""
    for name in list(_changed):
        link = bpy.data.objects.get(name)
        if link is None or scene.why_not(link):
            forget(name)
            continue
        if name not in _drawn:
            _drawn.add(name)
            _start(link, _preview, _show, False)
        elif (
            follows(link) and perf_counter() - _changed[name] >= REST and (_last_final is None or _last_final.is_done())
        ):
            _start(link, _finish, _keep, True)
        if _job is not None:
            return
        if name in _changed and not follows(link):
            forget(name)


def follows(link: bpy.types.Object) -> bool:
    """Whether the author wants surface and skin of a link to follow, and they do not yet."""
    plan = link.skin_calib
    return bool(plan.live and plan.link and (plan.result.outdated or results.find(plan.result.key) is None))


def _start(link: bpy.types.Object, make: Callable[..., Any], take: Callable[..., None], is_final: bool) -> None:
    """Read the scene, and compute what ``make`` says beside the main thread."""
    global _job, _last_final
    try:
        task = make(link)
    except SkinCalibError as error:
        _tell(link, in_window(error))
        return
    if task is not None:
        _job = Job(link.name, _changed[link.name], Work(task), take, is_final)
        _last_final = _job.work if is_final else _last_final


def _take(job: Job) -> None:
    """Draw or keep what has been computed, if its object is still there and nobody has gone back in time."""
    link = bpy.data.objects.get(job.name)
    if link is None or job.name not in _changed:
        return
    try:
        job.take(link, job.work.result())
    except SkinCalibError as error:
        _tell(link, in_window(error))


def _tell(link: bpy.types.Object, problem: str) -> None:
    """The plan cannot be carried out; the last result stays, and nothing more is tried before the next change."""
    told[link.name] = Told(problem=problem)
    _changed.pop(link.name, None)
    _drawn.discard(link.name)


def _preview(link: bpy.types.Object) -> Callable[..., Look] | None:
    """Sketch the planes; where the author wants it, fit and lay without the exact errors."""
    planes = read_hand_planes(link, bpy.context.scene)
    plan, problem, start = None, "", perf_counter()
    if follows(link):
        try:
            plan = scene.read_plan(link, bpy.context.scene)
        except SkinCalibError as error:
            problem = in_window(error)
    elif not planes.are_there:
        _forget_sketch(link.name)
        return None
    asked = Asked(start, facets_of(link), planes, plan, problem, overlay.switched_on(link))
    kept = _kept.setdefault(link.name, Kept())
    return lambda begin: look(kept, asked)


def _show(link: bpy.types.Object, seen: Look) -> None:
    """Draw a preview."""
    sketches[link.name] = seen.sketch
    overlay.hand_over("planes", link.name, tuple(seen.sketch.layers))
    told.pop(link.name, None)
    if seen.told is None:
        return
    if seen.told.problem:
        _tell(link, seen.told.problem)
    else:
        told[link.name], overlay.previews[link.name] = seen.told, seen.layers


def _finish(link: bpy.types.Object) -> Callable[..., Any]:
    """The fit that the button makes."""
    plan, facets = scene.read_plan(link, bpy.context.scene), facets_of(link)
    return lambda begin: results.fit(plan, facets.mesh(), begin)


def _keep(link: bpy.types.Object, fitted: Any) -> None:
    """Keep the result."""
    key, result = fitted
    overlay.prepare(key, result)
    scene.write_result(link, bpy.context.scene, result, key)
    forget(link.name)


def forget(name: str) -> None:
    """Nothing of an object is waiting any more, and its preview is gone; what its planes do stays drawn."""
    _changed.pop(name, None)
    _drawn.discard(name)
    overlay.previews.pop(name, None)
    told.pop(name, None)
    if name not in bpy.data.objects:
        _forget_sketch(name)
        _kept.pop(name, None)
        _seen.pop(name, None)


def _forget_sketch(name: str) -> None:
    sketches.pop(name, None)
    overlay.take_back("planes", name)


@persistent
def _went_back(*_: Any) -> None:
    """After undo, redo, or another file, what was drawn is of another plan; all links are looked at anew."""
    _clear()
    for link in bpy.data.objects:
        if link.type == "MESH" and (link.skin_calib.live or link.skin_calib.link):
            request(link)


@persistent
def _updated(_scene: Any, depsgraph: bpy.types.Depsgraph) -> None:
    """A mesh, a modifier or a place may have changed from which something was made."""
    for update in depsgraph.updates:
        is_other = update.is_updated_geometry or update.is_updated_transform
        if is_other and isinstance(update.id, bpy.types.Object) and update.id.name in _seen:
            _touched.add(update.id.name)
            events.wake(tick)


def _clear() -> None:
    """Wait for nothing any more, and draw no previews."""
    global _job
    if _job is not None:
        _job.work.stop()
        _job = None
    for of_names in (_changed, _drawn, _touched, _seen, _kept, told, sketches, overlay.previews):
        of_names.clear()
    overlay.take_back("planes")


HANDLERS = dict.fromkeys(events.TIME_TRAVEL, _went_back) | {"depsgraph_update_post": _updated}


def register() -> None:
    """Notice when time goes back, and when meshes change."""
    events.listen(HANDLERS)


def unregister() -> None:
    """Notice nothing any more."""
    events.ignore(HANDLERS, (tick,))
    _clear()
