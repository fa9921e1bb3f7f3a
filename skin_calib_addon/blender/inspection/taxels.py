# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of one taxel, kept on its object and marked in the view."""

from collections.abc import Iterable
from typing import Any

import bpy
import numpy as np

from ...common.errors import SkinCalibError
from ...inspection.all_taxels import AllTaxels
from ...pipeline import Calibrated
from ..overlay import overlay
from ..overlay.layers import mark_of
from ..scene import results
from ..scene.scene import link_frame, metres_per_unit, point_on


def result_of(link: bpy.types.Object) -> Calibrated:
    """The last result of a link.

    Raises
    ------
    SkinCalibError
        If there is none here: a file keeps no surface.
    """
    found = results.find(link.skin_calib.result.key)
    if found is None:
        raise SkinCalibError(f"{link.name} was not fitted since this file was opened: fit it first")
    return found


def taxels_of(link: bpy.types.Object) -> AllTaxels:
    """The taxels of the last result of a link; raises as :func:`result_of` does."""
    return overlay.prepare(link.skin_calib.result.key, result_of(link)).taxels


def token_of(key: str, taxel: str) -> str:
    """Under which the mark of a taxel of a result is kept."""
    return f"taxel {taxel} of {key}"


def read_taxel(link: bpy.types.Object, word: str, scene: bpy.types.Scene) -> str:
    """Keep the numbers of a taxel, named by id or channel, on its object, and mark it; its id.

    Raises
    ------
    SkinCalibError
        If there is no such taxel.
    """
    taxels, key = taxels_of(link), link.skin_calib.result.key
    row = taxels.row_of(word)
    _write(link.skin_calib.inspect.taxel, taxels, row, metres_per_unit(scene))
    link.skin_calib.inspect.taxel.key = key
    overlay.keep(token_of(key, taxels.ids[row]), mark_of(taxels, row))
    overlay.redraw()
    return taxels.ids[row]


def _write(record: Any, taxels: AllTaxels, row: int, metre: float) -> None:
    strain, tilt = taxels.strain[row], taxels.tilt[row]
    record.id, record.channel, record.index = taxels.ids[row], int(taxels.channels[row]), taxels.index[row].tolist()
    record.position, record.normal = (taxels.positions[row] / metre).tolist(), taxels.normals[row].tolist()
    record.area, record.neighbours = taxels.areas[row] / metre**2, ", ".join(taxels.neighbours[row])
    record.has_strain, record.has_tilt = not np.isnan(strain).any(), not np.isnan(tilt)
    record.strain_along, record.strain_across, record.shear = _known((100 * strain[0], 100 * strain[1], strain[2]))
    (record.tilt,) = _known((tilt,))


def _known(values: Iterable[float]) -> list[float]:
    return [0.0 if np.isnan(value) else float(value) for value in values]


def taxel_on_ray(link: bpy.types.Object, context: bpy.types.Context, start: Any, way: Any) -> str | None:
    """The id of the taxel that a ray in the world meets before the link hides it; None where it meets none."""
    taxels, to_link = taxels_of(link), link_frame(link).inverted()
    eye, ahead = to_link @ start, to_link.to_3x3() @ way
    metre, farthest = metres_per_unit(context.scene), np.inf
    if link.mode == "OBJECT" and link.visible_get():
        met = point_on(link, context.evaluated_depsgraph_get(), start, way)
        if met is not None:  # cells may lie a little below what one sees
            farthest = ((met - eye).length + taxels.width / metre) / ahead.length
    row = taxels.under(metre * np.array(eye), metre * np.array(ahead), farthest)
    return None if row is None else taxels.ids[row]
