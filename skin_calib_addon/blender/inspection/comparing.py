# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the taxels of a link with those of a file.

Values on its object, lines in the view; the plan does not change.
"""

import hashlib
from pathlib import Path

import bpy

from ...calibration.exchange import FORMATS
from ...inspection.comparison import Comparison, compare, read_others
from ..overlay import drawing
from ..overlay.layers import comparison_of
from ..scene.units import metres_per_unit
from .taxels import result_of, taxels_of

TAXEL_ENDINGS = tuple(sorted({form.ending for form in FORMATS.values() if form.readable}))
ENDINGS = (".json", *TAXEL_ENDINGS)
# Notes of a comparison in the panel. Larger: a longer panel.
MAX_NOTES = 6


def compare_with(link: bpy.types.Object, path: str, scene: bpy.types.Scene) -> Comparison:
    """Compare the last result of a link with the taxels of a file, and store the result of the comparison."""
    settings, taxels = link.skin_calib, taxels_of(link)
    found = compare(taxels, read_others(path), result_of(link).cover, settings.link)
    _write(settings.inspect.comparison, found, metres_per_unit(scene))
    record, key = settings.inspect.comparison, settings.result.key
    record.file, record.key = path, key
    record.token = "comparison " + hashlib.sha256(key.encode() + found.ends.tobytes()).hexdigest()
    drawing.cache(record.token, comparison_of(taxels, found))
    drawing.redraw()
    return found


def _write(record: bpy.types.PropertyGroup, found: Comparison, metre: float) -> None:
    distances = found.distances / metre
    record.by = "by id" if found.by == "id" else "with the nearest"
    record.pairs, record.worst = len(found.ours), found.worst
    record.mean, record.max = distances.mean(), distances.max()
    record.has_angles = found.angles is not None
    if found.angles is not None:
        record.mean_angle, record.max_angle = found.angles.mean(), found.angles.max()
    record.remarks = "\n".join(found.notes[:MAX_NOTES])


def name_of(path: str) -> str:
    """Return the name of a file without its folder."""
    return Path(path).name
