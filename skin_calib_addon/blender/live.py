# SPDX-License-Identifier: GPL-3.0-or-later
"""Live fit: while the author changes a plan, surface and skin follow; the errors come when the hand rests.

A change only asks for a fit; a timer makes it between two draws, so that many changes in one go make one. What is drawn
meanwhile is a preview, which no file and no undo step knows; the result is written once the plan has rested.
"""

from dataclasses import dataclass
from time import perf_counter
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..errors import SkinCalibError
from ..geometry import SurfaceFit, TriangleMesh, cut_cover
from ..laying import lay_all
from ..pipeline import fit_grid
from ..plan import Plan
from . import overlay, results, scene
from .layers import layers_of

REST = 0.4  # [s] without a change, after which the fit is finished


@dataclass(frozen=True)
class Told:
    """What the panel says of a preview."""

    mean: float  # distance along the rays of the fit [m]
    seconds: float
    problem: str = ""


@dataclass(frozen=True, eq=False)
class Fitted:
    """The last fit of a preview, and what it was made from: changes of the skins alone need no other."""

    mesh: TriangleMesh
    asked: tuple[Any, ...]  # the cover, grid, degree and chords of the plan
    fit: SurfaceFit


told: dict[str, Told] = {}  # by the object's name
_changed: dict[str, float] = {}  # objects whose plan changed since their last fit, and when
_fitted: dict[str, Fitted] = {}
_drawn: set[str] = set()  # those whose preview shows the last change


def request(link: bpy.types.Object) -> None:
    """A plan has changed: fit it soon, if its author wants that."""
    if not link.skin_calib.live:
        return
    _changed[link.name] = perf_counter()
    _drawn.discard(link.name)
    if not bpy.app.timers.is_registered(tick):
        bpy.app.timers.register(tick, first_interval=0.0)


def changed(result: Any, _context: Any) -> None:
    """The result of a link is outdated, or no longer."""
    if result.outdated:
        request(result.id_data)


def switched(plan: Any, _context: Any) -> None:
    """A link begins to follow, or stops."""
    if plan.live:
        request(plan.id_data)
    else:
        forget(plan.id_data.name)


def tick() -> float | None:
    """Draw what has changed; finish what has rested. The seconds to the next call, none when nothing is left."""
    for name in list(_changed):
        link = bpy.data.objects.get(name)
        if link is None or not link.skin_calib.live or scene.why_not(link):
            forget(name)
        elif name not in _drawn:
            _preview(link)
            _drawn.add(name)
        elif perf_counter() - _changed[name] >= REST:
            _finish(link)
            forget(name)
    overlay.redraw()
    return 0.05 if _changed else None


def forget(name: str) -> None:
    """Nothing of an object is waiting any more, and its preview is gone."""
    _changed.pop(name, None)
    _drawn.discard(name)
    overlay.previews.pop(name, None)
    if not told.get(name, Told(0, 0)).problem:
        told.pop(name, None)


def _preview(link: bpy.types.Object) -> None:
    """Fit and lay without the exact errors, and draw that."""
    start = perf_counter()
    try:
        plan = scene.read_plan(link, bpy.context.scene)
        fit = _fit(link.name, plan, scene.read_mesh(link, bpy.context))
        patches = tuple(done.patch for done in lay_all(plan.skins, fit))
    except SkinCalibError as error:
        told[link.name] = Told(0.0, 0.0, str(error))
        return
    drawn = SimpleNamespace(fit=fit, calibration=SimpleNamespace(patches=patches))
    overlay.previews[link.name] = layers_of(drawn)
    told[link.name] = Told(float(np.nanmean(np.abs(fit.residuals))), perf_counter() - start)


def _fit(name: str, plan: Plan, mesh: TriangleMesh) -> SurfaceFit:
    """The fit of a plan, the last one where neither the mesh nor what was asked of it has changed."""
    asked, last = (plan.cover, plan.grid, plan.degree, plan.chords), _fitted.get(name)
    same = last and last.asked == asked and np.array_equal(last.mesh.vertices, mesh.vertices)
    if not (same and np.array_equal(last.mesh.faces, mesh.faces)):
        last = Fitted(mesh, asked, fit_grid(cut_cover(mesh, plan.cover), plan.grid, plan.degree, plan.chords))
    _fitted[name] = last
    return last.fit


def _finish(link: bpy.types.Object) -> None:
    """The fit that the button makes."""
    if told.get(link.name, Told(0, 0)).problem:
        return
    try:
        plan = scene.read_plan(link, bpy.context.scene)
        key, result = results.fit(plan, scene.read_mesh(link, bpy.context))
    except SkinCalibError as error:
        told[link.name] = Told(0.0, 0.0, str(error))
        return
    overlay.prepare(key, result)
    scene.write_result(link, bpy.context.scene, result, key)


@persistent
def _went_back(*_: Any) -> None:
    """After undo, redo, or another file, what was drawn is of another plan; links that follow catch up."""
    for name in {*_changed, *overlay.previews, *told}:
        told.pop(name, None)
        forget(name)
    _fitted.clear()
    for link in bpy.data.objects:
        if link.skin_calib.live and link.skin_calib.result.outdated:
            request(link)


HANDLERS = ("undo_post", "redo_post", "load_post")


def register() -> None:
    """Notice when time goes back."""
    for name in HANDLERS:
        getattr(bpy.app.handlers, name).append(_went_back)


def unregister() -> None:
    """Wait for nothing any more."""
    for name in HANDLERS:
        getattr(bpy.app.handlers, name).remove(_went_back)
    if bpy.app.timers.is_registered(tick):
        bpy.app.timers.unregister(tick)
    _changed.clear()
    _drawn.clear()
    _fitted.clear()
    told.clear()
