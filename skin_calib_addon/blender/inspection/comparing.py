# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the taxels of a link with those of a file.

Values on its object, lines in the view; the plan does not change.
"""

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path

import bpy
import numpy as np

from ...calibration.exchange import FORMATS
from ...common.arrays import Array
from ...common.errors import listed
from ...common.warnings import Warning
from ...inspection.comparison import Comparison, compare, read_others
from ...pipeline.refine import refine
from ...pipeline.touch_distance import check_touches
from ...validation import Placement, directions_of, placements, read_touches, summarize
from ..overlay import drawing
from ..overlay.layers import Layer, comparison_of, touches_of
from ..scene.plans import read_plan
from ..scene.skins import move_skin
from ..scene.units import metres_per_unit
from ..scene.warnings import write_warnings
from .taxels import result_of, taxels_of

TAXEL_ENDINGS = tuple(sorted({form.ending for form in FORMATS.values() if form.readable}))
ENDINGS = (".json", *TAXEL_ENDINGS)
# Notes of a comparison in the panel. Larger: a longer panel.
MAX_NOTES = 6


def compare_with(link: bpy.types.Object, path: str) -> Comparison:
    """Compare the last result of a link with the taxels of a file, and keep what was found."""
    taxels = taxels_of(link)
    found = compare(taxels, read_others(path), result_of(link).cover, link.skin_calib.link)
    notes = (Warning("comparison", "warning", note) for note in found.notes[:MAX_NOTES])
    _keep(link, "comparison", path, _lines_of(found), notes, found.ends, comparison_of(taxels, found))
    return found


def _lines_of(found: Comparison) -> Iterator[str]:
    distances = 1e3 * found.distances
    yield f"{len(found.ours)} taxels paired {'by id' if found.by == 'id' else 'with the nearest'}"
    yield f"Distance: mean {distances.mean():.4f} mm, max {distances.max():.4f} mm at {found.worst}"
    if found.angles is not None:
        angles = np.rad2deg(found.angles)
        yield f"Angle of the normals: mean {angles.mean():.2f}°, max {angles.max():.2f}°"


def _keep(
    link: bpy.types.Object,
    name: str,
    path: str,
    lines: Iterable[str],
    warnings: Iterable[Warning],
    places: Array,
    layers: tuple[Layer, ...],
) -> None:
    """Keep what was compared, and draw it as long as the fit is the same; ``places`` name the drawing."""
    record, key = getattr(link.skin_calib.inspect, name), link.skin_calib.result.key
    record.file, record.key, record.remarks = path, key, "\n".join(lines)
    write_warnings(record.warnings, warnings)
    record.token = f"{name} {hashlib.sha256(key.encode() + places.tobytes()).hexdigest()}"
    drawing.cache(record.token, layers)
    drawing.redraw()


def name_of(path: str) -> str:
    """Return the name of a file without its folder."""
    return Path(path).name


def compare_touches(link: bpy.types.Object, path: str) -> list[Placement]:
    """Compare the last result of a link with a table of touches, and keep what was found."""
    calibration = result_of(link).calibration
    touches = read_touches(path, calibration)
    check_touches(calibration, touches)
    found = placements(calibration, touches)
    many = len(calibration.patches) > 1
    lines = [_named(p, line, many) for p in found for line in summarize(p)]
    if touches.unused:
        lines.append(f"Columns not used: {listed(touches.unused)}")
    directions, _ = directions_of(calibration, touches)
    if directions:
        lines.append(f"Forces: {directions.summary()}")
    of_forces = directions.warnings() if directions and not any(p.wiring.order.words for p in found) else ()
    warnings = (*of_forces, *(warning for p in found for warning in p.warnings()))
    _keep(link, "touches", path, lines, warnings, np.concatenate([p.places for p in found]), touches_of(found))
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
