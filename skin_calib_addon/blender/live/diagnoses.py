# SPDX-License-Identifier: GPL-3.0-or-later
"""What was found on the meshes of links, and whether they are still those meshes.

A diagnosis keeps the hash of its mesh. When Blender tells that an object may look otherwise, it is doubted at once, and
cleared once things have rested if the mesh turns out to be the same: nothing about that is stored, so undo cannot lie.
"""

from time import perf_counter
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...common.errors import InvalidMesh, SkinCalibError
from ...geometry.mesh.defects import Diagnosis, diagnose
from ..overlay import overlay
from ..scene import scene
from ..scene.warnings import write_warnings
from . import events

REST = 0.3  # [s] without a change, after which a mesh is compared with the one that was looked at

doubted: set[str] = set()  # objects, by name, whose mesh may be another than the one that was looked at
_changed: dict[str, float] = {}  # those that are to be compared, and when they changed


def look(link: bpy.types.Object, context: bpy.types.Context) -> Diagnosis:
    """Look at the mesh of a link as it is seen.

    Raises
    ------
    InvalidMesh
        If it is no surface, or cannot be read.
    """
    facets = scene.read_facets(link, context)
    try:
        return diagnose(*facets.triangles())
    except InvalidMesh as error:
        raise InvalidMesh(f"{link.name}: {error}", **error.numbers) from error


def keep(link: bpy.types.Object, found: Diagnosis) -> None:
    """Write what was found on the object."""
    record = link.skin_calib.diagnosis
    record.key, record.inner, record.edges = found.mesh.sha256, found.inner, len(found.edges())
    write_warnings(record.findings, found.findings())
    doubted.discard(link.name)
    _changed.pop(link.name, None)


def is_current(link: bpy.types.Object, context: bpy.types.Context) -> bool:
    """Whether the mesh is the one that was looked at."""
    try:
        return scene.read_facets(link, context).welded().sha256 == link.skin_calib.diagnosis.key
    except SkinCalibError:
        return False


def settle() -> float | None:
    """Compare what has rested; the seconds to the next call, none when nothing is left."""
    for name, since in list(_changed.items()):
        link = bpy.data.objects.get(name)
        if link is None or not link.skin_calib.diagnosis.key:
            doubted.discard(name)
        elif perf_counter() - since < REST:
            continue
        elif is_current(link, bpy.context):
            doubted.discard(name)
        _changed.pop(name)
    overlay.redraw()
    return REST if _changed else None


def _doubt(link: bpy.types.Object) -> None:
    """The mesh of an object may be another one."""
    if not link.skin_calib.diagnosis.key:
        return
    doubted.add(link.name)
    _changed[link.name] = perf_counter()
    if not bpy.app.background:  # no timer runs there, but exit waits for it
        events.wake(settle, REST)


@persistent
def _updated(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Objects whose mesh or place was evaluated anew."""
    for update in depsgraph.updates:
        if isinstance(update.id, bpy.types.Object) and (update.is_updated_geometry or update.is_updated_transform):
            _doubt(update.id.original)


@persistent
def _went_back(*_: Any) -> None:
    """After undo, redo, or another file, every diagnosis is compared."""
    doubted.clear()
    _changed.clear()
    for link in bpy.data.objects:
        _doubt(link)


HANDLERS = dict.fromkeys(events.TIME_TRAVEL, _went_back) | {"depsgraph_update_post": _updated}


def register() -> None:
    """Notice changes."""
    events.listen(HANDLERS)


def unregister() -> None:
    """Notice nothing any more."""
    events.ignore(HANDLERS, (settle,))
    doubted.clear()
    _changed.clear()
