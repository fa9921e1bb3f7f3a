# SPDX-License-Identifier: GPL-3.0-or-later
"""The last fits of this Blender, by a key of all that went into them.

An object keeps the key of its fit: undo brings both back, and no object can take another's result for its own.
"""

import hashlib
import json
from collections.abc import Callable
from threading import Lock

from ...geometry.mesh.triangle_mesh import TriangleMesh
from ...pipeline import Calibrated, calibrate
from ...pipeline.sources import file_hash, taxel_files
from ...plan import Plan, plan_document

KEPT = 16
_results: dict[str, Calibrated] = {}
_lock = Lock()  # fits run beside the main thread


def fit(plan: Plan, mesh: TriangleMesh, begin: Callable[[str], None] = lambda stage: None) -> tuple[str, Calibrated]:
    """Calibrate, or take what the same plan and mesh gave before; the result and its key.

    ``begin`` is told the name of each stage as it begins, and may raise to stop there.

    Raises
    ------
    SkinCalibError
        As :func:`calibrate` does.
    """
    files = [file_hash(path) for path in taxel_files(plan)]
    content = json.dumps((plan_document(plan), files), sort_keys=True) + mesh.sha256
    key = hashlib.sha256(content.encode()).hexdigest()
    result = _results.get(key) or calibrate(plan, mesh, begin)
    with _lock:
        _results.pop(key, None)
        _results[key] = result  # the last one used is the last to go
        while len(_results) > KEPT:
            del _results[next(iter(_results))]
    return key, result


def find(key: str) -> Calibrated | None:
    """The result of this key, if it is still kept."""
    return _results.get(key)


def clear() -> None:
    """Forget all results."""
    _results.clear()
