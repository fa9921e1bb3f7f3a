# SPDX-License-Identifier: GPL-3.0-or-later
"""Store what was found on the meshes of links, and whether the meshes have changed since a diagnosis or a fit.

Diagnoses and results contain hashes of their meshes. When Blender reports a change of an object, its diagnosis becomes
unverified at once. After a short time without changes the mesh is compared. If it is the same, the diagnosis is
verified; if not, the result is outdated. What is unverified is not stored in the file, so that undo cannot make it
wrong.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from time import perf_counter
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...common.errors import InvalidMesh, SkinCalibError, counted
from ...common.warnings import Warning
from ...geometry.mesh.defects import Diagnosis, diagnose
from ..overlay import drawing
from ..scene import link_meshes, link_objects, plans, results
from ..scene.face_groups import empty_groups
from ..scene.units import metres_per_unit
from ..scene.warnings import refusal_of, write_warnings
from ..session import SCENE_REPLACED, session, wake
from . import updates
from .background import Work

# [s] Time without a change after which a mesh is compared with the one before. Larger: a note, or the tick of a fit,
# stays longer; smaller: large meshes are compared while they change.
CHECK_DELAY = 0.3
# [s] Time for which the window waits for the hashes of meshes. Larger: the window freezes longer; smaller: the note
# stays longer for meshes of medium size.
HASH_WAIT = 0.2


def examination(link: bpy.types.Object, context: bpy.types.Context) -> Callable[..., Diagnosis]:
    """Read the mesh of a link as it is displayed, with modifiers, and return what diagnoses it without Blender."""
    facets = link_meshes.read_facets(link, context)

    def examine(_begin: Callable[[str], None] | None = None) -> Diagnosis:
        try:
            return diagnose(*facets.triangles())
        except InvalidMesh as error:
            raise InvalidMesh(f"{facets.name}: {error}", **error.numbers) from error

    return examine


def trial(link: bpy.types.Object, context: bpy.types.Context) -> Callable[..., Warning]:
    """Read plan and mesh of a link, and return what fits it without Blender: whether Fit succeeds at these settings."""
    try:
        plan, facets = plans.read_plan(link, context.scene), link_meshes.read_facets(link, context)
        of_groups = empty_groups(link)
    except SkinCalibError as error:
        refusal = refusal_of(error)
        return lambda begin: refusal

    def attempt(begin: Callable[[str], None]) -> Warning:
        try:
            result = results.fit(plan, facets.mesh(), begin)[1]
        except SkinCalibError as error:
            return refusal_of(error)
        words = f"These settings fit: mean error {result.mean * 1e3:.2g} mm"
        serious = [warning for warning in (*result.warnings, *of_groups) if warning.severity != "note"]
        if not serious:
            return Warning("fit", "note", words)
        return replace(
            serious[0], code="fit", message=f"{words}, {counted(len(serious), 'warning')}. {serious[0].message}"
        )

    return attempt


def not_repeated(findings: Iterable[Any]) -> list[Any]:
    """Return the findings of a check without the one that the line of the foreseen fit ends with."""
    found = list(findings)
    foreseen = "".join(finding.message for finding in found if finding.code == "fit")
    return [finding for finding in found if not foreseen.endswith(f". {finding.message}")]


def store(link: bpy.types.Object, found: Diagnosis, foreseen: Warning) -> None:
    """Write a diagnosis to the properties of the object."""
    record = link.skin_calib.diagnosis
    record.key, record.inner, record.edges = found.mesh.sha256, found.inner, len(found.edges())
    write_warnings(record.findings, (*found.findings(), foreseen))
    record.outdated = False
    state = session.of(link)
    state.is_unverified, state.touched_at, state.hashing = False, None, None


def verify() -> float | None:
    """Compare the meshes that have not changed for a while; large ones in a thread.

    Return the seconds to the next call, None if none are left.
    """
    begin = perf_counter()
    for link, state in session.links():
        if state.touched_at is None:
            continue
        drawn = state.is_unverified, results.is_current(link)
        if not _is_compared(link):
            state.is_unverified = False
        elif perf_counter() - state.touched_at < CHECK_DELAY:
            continue
        else:
            if state.hashing is None:
                state.hashing = Work(_hash_of(link))
                state.hashing.is_done(max(0.0, begin + HASH_WAIT - perf_counter()))
            if not state.hashing.is_done():
                continue
            _use_hash(link, state.hashing.result())
        state.hashing = state.touched_at = None
        if (state.is_unverified, results.is_current(link)) != drawn:
            drawing.redraw()
    return CHECK_DELAY if any(state.touched_at is not None for state in session.states.values()) else None


def _hash_of(link: bpy.types.Object) -> Callable[..., str]:
    """Return what computes the hash of the mesh of a link without Blender; empty if the mesh is invalid."""
    state = session.of(link)
    try:
        with link_objects.in_scene(link):
            facets = state.compared = link_meshes.read_facets(link, bpy.context, state.compared)
    except SkinCalibError:
        return lambda begin: ""
    return lambda begin: facets.sha256


def _use_hash(link: bpy.types.Object, sha256: str) -> None:
    """Compare the mesh of a link, given by its hash, with those of its diagnosis and its fit."""
    if sha256 == link.skin_calib.diagnosis.key:
        session.of(link).is_unverified = False
    with link_objects.in_scene(link):
        if not link_objects.why_not(link) and link.visible_get():  # others are read differently, or not at all
            results.verify(link, bpy.context.scene, sha256)


def _is_compared(link: bpy.types.Object) -> bool:
    """Return whether a diagnosis or a result depends on the mesh of an object."""
    return bool(link.skin_calib.diagnosis.key) or results.is_current(link)


def touched(link: bpy.types.Object) -> None:
    """Mark the diagnosis and the result of an object, because its mesh may have changed."""
    if not _is_compared(link):
        return
    state = session.of(link)
    if link.skin_calib.diagnosis.key:
        state.is_unverified = True
    state.hashing, state.touched_at = None, perf_counter()
    if not bpy.app.background:  # without a window timers do not run, but the exit waits for them
        wake(verify, CHECK_DELAY)


def _evaluated(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> Iterator[bpy.types.Object]:
    """Yield the objects whose mesh or position Blender has evaluated again; with another unit of the scene, all."""
    metre = metres_per_unit(scene)
    if session.metres.get(scene.session_uid) != metre:
        session.metres[scene.session_uid] = metre
        yield from scene.objects
    for update in depsgraph.updates:
        if isinstance(update.id, bpy.types.Object) and (update.is_updated_geometry or update.is_updated_transform):
            yield update.id.original


@persistent
def _updated(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Compare the meshes that may have changed."""
    for link in _evaluated(scene, depsgraph):
        touched(link)
        updates.touched(link)


@persistent
def _frame_changed(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Compare the meshes of an animation, which updates objects without the other event, once it stands still.

    Meshes of links with Live on are also read while frames are played.
    """
    for link in _evaluated(scene, depsgraph):
        touched(link)
        if link.skin_calib.live:
            updates.touched(link)


@persistent
def _scene_replaced(*_: Any) -> None:
    """Compare every diagnosis and every result after undo, redo, or the opening of a file."""
    session.metres.update((scene.session_uid, metres_per_unit(scene)) for scene in bpy.data.scenes)
    for link in bpy.data.objects:
        touched(link)


HANDLERS = dict.fromkeys(SCENE_REPLACED, _scene_replaced) | {
    "depsgraph_update_post": _updated,
    "frame_change_post": _frame_changed,
}
TIMERS = (verify,)
