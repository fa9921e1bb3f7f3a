# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the taxels of a link with those of a file.

Values on its object, lines in the view; the plan does not change.
"""

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...calibration.exchange import FORMATS
from ...common.arrays import Array
from ...common.errors import listed
from ...common.warnings import Warning
from ...inspection.comparison import Comparison, compare, read_others
from ...inspection.touch_file import read_touch_file
from ...pipeline.refine import refine
from ...pipeline.touch_distance import check_touches
from ...validation import Placement, directions_of, placements, summarize
from ..overlay import drawing
from ..overlay.layers import Layer, comparison_of, place_of, touches_of
from ..scene.link_meshes import read_mesh
from ..scene.link_objects import longest_side
from ..scene.plans import read_plan
from ..scene.showing import show_place
from ..scene.skins import move_skin
from ..scene.units import metres_per_unit
from ..scene.warnings import write_warnings
from .taxels import result_of, taxels_of

TAXEL_ENDINGS = tuple(sorted({form.ending for form in FORMATS.values() if form.readable}))
ENDINGS = (".json", *TAXEL_ENDINGS)
# Notes of a comparison in the panel. Larger: a longer panel.
MAX_NOTES = 6
MAX_LISTED = 200  # Touches in the list of the panel. Larger: slower.


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


def compare_touches(link: bpy.types.Object, context: bpy.types.Context, path: str) -> list[Placement]:
    """Compare the last result of a link with a table of touches, and keep what was found."""
    calibration = result_of(link).calibration
    touches = read_touch_file(path, calibration, lambda: read_mesh(link, context))
    check_touches(calibration, touches)
    found = placements(calibration, touches)
    many = len(calibration.patches) > 1
    lines = [_named(p, line, many) for p in found for line in summarize(p)]
    if touches.unused:
        lines.append(f"Columns not used: {listed(touches.unused)}")
    lines += [f"The recording: {note}" for note in touches.notes]
    directions, _ = directions_of(calibration, touches)
    if directions:
        lines.append(f"Forces: {directions.summary()}")
    if touches.tool:
        lines += [line.strip() for _, line in touches.tool.summary()]
    of_tool = touches.tool.warnings() if touches.tool else ()
    in_order = not any(p.wiring.order.words for p in found)
    of_forces = directions.warnings(in_order) if directions else ()
    warnings = (*of_tool, *of_forces, *(warning for p in found for warning in p.warnings()))
    _keep(link, "touches", path, lines, warnings, np.concatenate([p.places for p in found]), touches_of(found))
    _list(link.skin_calib.inspect.touches, found)
    return found


def _list(record: Any, found: list[Placement]) -> None:
    """List the touches, the one with the largest distance first."""
    record.property_unset("chosen")
    record.places.clear()
    touches = [(float(p.residuals[k]), k, p) for p in found for k in range(len(p.rows))]
    for distance, k, placement in sorted(touches, key=lambda touch: -touch[0])[:MAX_LISTED]:
        item, name = record.places.add(), placement.patch.taxels.ids[placement.rows[k]]
        item.words = f"{1e3 * distance:.1f} mm  {name}  line {placement.lines[k]}"
        item.point, item.far = placement.places[k], k in placement.outliers


def mark_of(record: Any) -> str:
    """Return the name under which the mark of the touch that was chosen in the list is cached."""
    return f"{record.token} {record.chosen}"


def show_touch(link: bpy.types.Object, context: bpy.types.Context) -> None:
    """Mark the touch that is chosen in the list, and move cursor and view there."""
    record = link.skin_calib.inspect.touches
    if 0 <= record.chosen < len(record.places):
        point = tuple(record.places[record.chosen].point)
        drawing.cache(mark_of(record), (place_of(point, longest_side(link, context.scene)),))
        show_place(context, link, point)
        drawing.redraw()


def _named(placement: Placement, line: str, many: bool) -> str:
    """Return a line about a patch, with its name if there are several."""
    return f"{placement.patch.name}: {line}" if many else line[0].upper() + line[1:]


def move_to_touches(link: bpy.types.Object, context: bpy.types.Context) -> None:
    """Move the skins of a plan to their measured placement, from the displayed touches."""
    settings, result, scene = link.skin_calib, result_of(link), context.scene
    path = settings.inspect.touches.file
    touches = read_touch_file(path, result.calibration, lambda: read_mesh(link, context))
    plan = read_plan(link, scene)
    refined = refine(plan, result, touches)
    for skin, before, after in zip(settings.skins, plan.skins, refined.plan.skins):
        if after != before:
            move_skin(skin, after, metres_per_unit(scene))
