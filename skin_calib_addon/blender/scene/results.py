# SPDX-License-Identifier: GPL-3.0-or-later
"""Results of fits: a cache of the last ones by a key of all their input, and their figures on the objects of links.

An object keeps the key of its fit: undo restores both, and an object never uses the result of another. Whether plan and
mesh are still those of the fit follows from the key alone, after undo, renaming and reopening, too.
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from threading import Lock
from typing import Any

import bpy

from ...common.errors import SkinCalibError
from ...common.file_hash import file_hash
from ...common.warnings import Warning
from ...geometry.fit.surface_fit import SurfaceFit
from ...geometry.mesh.triangle_mesh import TriangleMesh
from ...pipeline import Calibrated, calibrate
from ...pipeline.report import covered_area, seen_area
from ...pipeline.sources import taxel_files
from ...plan import Plan, plan_document
from . import plans
from .face_groups import empty_groups
from .units import metres_per_unit
from .warnings import write_warnings

KEPT = 64  # results. Larger: more memory; smaller: links of a robot lose their fits, which are then fitted again
_results: dict[str, Calibrated] = {}
_seen: dict[str, float] = {}  # what can be seen of meshes from outside [m^2], by their hashes
_lock = Lock()  # fits run in other threads


def key_of(plan: Plan, sha256: str) -> str:
    """Return the key of a result: a hash of all its input. Names of mesh files are not part of it."""
    files = [file_hash(path) for path in taxel_files(plan)]
    content = json.dumps((plan_document(plan) | {"mesh": sha256}, files), sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()


def fit(
    plan: Plan,
    mesh: TriangleMesh,
    begin: Callable[[str], None] = lambda stage: None,
    known: Mapping[str, SurfaceFit] | None = None,
) -> tuple[str, Calibrated]:
    """Calibrate, or return the result of the same plan and mesh before; with its key."""
    key = key_of(plan, mesh.sha256)
    result = _results.get(key) or calibrate(plan, mesh, begin, known)
    seen = _seen.get(mesh.sha256) or seen_area(mesh)
    with _lock:
        _seen[mesh.sha256] = seen
        _results.pop(key, None)
        _results[key] = result  # the cache drops those that were not used for the longest time
        while len(_results) > KEPT:
            del _results[next(iter(_results))]
    return key, result


def find(key: str) -> Calibrated | None:
    """Return the result with this key; None if it is not in the cache."""
    return _results.get(key)


def is_current(link: bpy.types.Object) -> bool:
    """Return whether a link has a result that is not known to be outdated."""
    return bool(link.skin_calib.result.key) and not link.skin_calib.result.outdated


def least_exact(plan: Any) -> str:
    """Return what is written after a mean distance: of several surfaces it is the largest of their means."""
    return " (least exact surface)" if len(plans.surface_names(plan)) > 1 else ""


def verify(link: bpy.types.Object, scene: bpy.types.Scene, sha256: str) -> None:
    """Mark the result of a link as outdated if plan, mesh or taxel files are no longer those of its fit."""
    if not is_current(link):
        return
    try:
        is_same = key_of(plans.read_plan(link, scene), sha256) == link.skin_calib.result.key
    except SkinCalibError:
        is_same = False
    if not is_same:
        link.skin_calib.result.outdated = True


def clear() -> None:
    """Empty the cache."""
    _results.clear()


def warnings_of(link: bpy.types.Object, result: Calibrated) -> tuple[Warning, ...]:
    """Return the warnings of a fit, and those about vertex groups, which no plan file has."""
    return (*result.warnings, *empty_groups(link))


def write_result(link: bpy.types.Object, scene: bpy.types.Scene, result: Calibrated, key: str) -> None:
    """Store the figures of a fit on its object."""
    warnings = warnings_of(link, result)  # first: nothing is written if a group was removed during the fit
    record, fits = link.skin_calib.result, tuple(result.fits.values())
    to_mesh = [fit.errors.surface_to_mesh for fit in fits]
    record.key, record.outdated = key, False
    metre = metres_per_unit(scene)
    record.mean, record.max = max(d.mean for d in to_mesh) / metre, max(d.max for d in to_mesh) / metre
    record.hausdorff = max(fit.errors.hausdorff for fit in fits) / metre
    record.control_points = sum(fit.offsets.size for fit in fits)
    record.taxels = sum(len(p.taxels.ids) for p in result.calibration.patches)
    record.cells = covered_area(result.calibration)
    record.seen = _seen.get(result.calibration.mesh.sha256, 0.0)
    record.seconds = sum(result.seconds.values())
    write_warnings(record.warnings, warnings)
    link.skin_calib.steps.advance()
    record.warning_index, link.skin_calib.inspect.marked_place = 0, ""
