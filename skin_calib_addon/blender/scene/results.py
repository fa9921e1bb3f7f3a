# SPDX-License-Identifier: GPL-3.0-or-later
"""Cache of the last fits in this Blender, by a key of all their input.

An object keeps the key of its fit: undo restores both, and an object never uses the result of another.
"""

import hashlib
import json
from collections.abc import Callable
from threading import Lock

from ...common.file_hash import file_hash
from ...geometry.mesh.triangle_mesh import TriangleMesh
from ...pipeline import Calibrated, calibrate
from ...pipeline.sources import taxel_files
from ...plan import Plan, plan_document

KEPT = 64  # results. Larger: more memory; smaller: links of a robot lose their fits, which are then fitted again
_results: dict[str, Calibrated] = {}
_lock = Lock()  # fits run in other threads


def fit(plan: Plan, mesh: TriangleMesh, begin: Callable[[str], None] = lambda stage: None) -> tuple[str, Calibrated]:
    """Calibrate, or return the result of the same plan and mesh before; with its key.

    Parameters
    ----------
    plan : Plan
        Of the link.
    mesh : TriangleMesh
        Of the link, in metres in the link frame.
    begin : function, optional
        Called with the name of each stage at its start; an exception aborts the calibration.

    Returns
    -------
    key : str
        SHA-256 of the plan, the mesh and the taxel files.
    result : Calibrated
        The calibration, its fit and its warnings.

    Raises
    ------
    SkinCalibError
        As :func:`calibrate`.
    """
    files = [file_hash(path) for path in taxel_files(plan)]
    content = json.dumps((plan_document(plan), files), sort_keys=True) + mesh.sha256
    key = hashlib.sha256(content.encode()).hexdigest()
    result = _results.get(key) or calibrate(plan, mesh, begin)
    with _lock:
        _results.pop(key, None)
        _results[key] = result  # the cache drops those that were not used for the longest time
        while len(_results) > KEPT:
            del _results[next(iter(_results))]
    return key, result


def find(key: str) -> Calibrated | None:
    """Return the result with this key; None if it is not in the cache."""
    return _results.get(key)


def clear() -> None:
    """Empty the cache."""
    _results.clear()
