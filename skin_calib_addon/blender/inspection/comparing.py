# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the taxels of a link with those of a file.

Values on its object, lines in the view; the plan does not change.
"""

import hashlib
from pathlib import Path

import bpy
import numpy as np

from ...calibration.exchange import FORMATS
from ...inspection.comparison import Comparison, compare, read_others
from ...pipeline.refine import refine
from ...pipeline.touch_distance import check_touches
from ...validation import Placement, placements, read_touches, summarize
from ..overlay import drawing
from ..overlay.layers import comparison_of, touches_of
from ..scene.plans import read_plan
from ..scene.skins import move_skin
from ..scene.units import metres_per_unit
from ..scene.warnings import write_warnings
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


def compare_touches(link: bpy.types.Object, path: str) -> list[Placement]:
    """Compare the last result of a link with a table of touches, and store the result of the comparison."""
    settings = link.skin_calib
    calibration, record, key = result_of(link).calibration, settings.inspect.touches, settings.result.key
    touches = read_touches(path, calibration)
    check_touches(calibration, touches)
    found = placements(calibration, touches)
    many = len(calibration.patches) > 1
    record.file, record.key = path, key
    record.remarks = "\n".join(_named(p, line, many) for p in found for line in summarize(p))
    write_warnings(record.warnings, (warning for p in found for warning in p.warnings()))
    places = np.concatenate([p.places for p in found])
    record.token = "touches " + hashlib.sha256(key.encode() + places.tobytes()).hexdigest()
    drawing.cache(record.token, touches_of(found))
    drawing.redraw()
    return found


def _named(placement: Placement, line: str, many: bool) -> str:
    """Return a line about a patch, with its name if there are several."""
    return f"{placement.patch.name}: {line}" if many else line[0].upper() + line[1:]


def move_to_touches(link: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Move the skins of a plan to their measured placement, from the displayed touches."""
    settings, result = link.skin_calib, result_of(link)
    touches = read_touches(settings.inspect.touches.file, result.calibration)
    plan = read_plan(link, scene)
    refined = refine(plan, result, touches)
    for skin, before, after in zip(settings.skins, plan.skins, refined.plan.skins):
        if after != before:
            move_skin(skin, after, metres_per_unit(scene))
