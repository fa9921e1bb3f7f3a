# SPDX-License-Identifier: GPL-3.0-or-later
"""Store the values of one taxel on its object, and mark the taxel in the view."""

from collections.abc import Iterable
from contextlib import suppress
from typing import Any

import bpy
import numpy as np

from ...common.errors import SkinCalibError, UnknownTaxel
from ...inspection.all_taxels import AllTaxels
from ...pipeline import Calibrated
from ..overlay import drawing
from ..overlay.layers import mark_of
from ..scene import results
from ..scene.link_meshes import link_frame
from ..scene.points_on_link import point_on
from ..scene.units import metres_per_unit


def result_of(link: bpy.types.Object) -> Calibrated:
    """Return the last result of a link."""
    found = results.find(link.skin_calib.result.key)
    if found is None:
        raise SkinCalibError(f"{link.name} has no result since this file was opened. Fit it first")
    return found


def taxels_of(link: bpy.types.Object) -> AllTaxels:
    """Return the taxels of the last result of a link; raises as :func:`result_of` does."""
    return drawing.layers_for(result_of(link)).taxels


def all_taxels_of(link: bpy.types.Object) -> AllTaxels:
    """Return the taxels of the last result of a link, the disabled ones last; raises as :func:`result_of` does."""
    return drawing.layers_for(result_of(link)).with_disabled


def token_of(key: str, taxel: str) -> str:
    """Return the token under which the mark of a taxel is stored."""
    return f"taxel {taxel} of {key}"


def read_taxel(link: bpy.types.Object, word: str, scene: bpy.types.Scene) -> str:
    """Store the values of a taxel on its object, mark it, and return its id."""
    taxels, key = all_taxels_of(link), link.skin_calib.result.key
    row = taxels.row_of(word)
    link.skin_calib.inspect.taxel.disabled = row >= len(taxels_of(link).ids)
    _write(link.skin_calib.inspect.taxel, taxels, row, metres_per_unit(scene))
    link.skin_calib.inspect.taxel.key = key
    drawing.cache(token_of(key, taxels.ids[row]), mark_of(taxels, row))
    drawing.redraw()
    return taxels.ids[row]


def read_again(link: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Store the values that the taxel of a link has after another fit; nothing if it has no such taxel."""
    if link.skin_calib.inspect.taxel.id:
        with suppress(UnknownTaxel):  # the panel says that the values are of another fit
            read_taxel(link, link.skin_calib.inspect.taxel.id, scene)


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


def taxel_on_ray(link: bpy.types.Object, context: bpy.types.Context, start: Any, direction: Any) -> str | None:
    """Return the id of the first taxel on a ray that the link does not hide, or None."""
    taxels, to_link = all_taxels_of(link), link_frame(link).inverted()
    eye, ahead = to_link @ start, to_link.to_3x3() @ direction
    metre, farthest = metres_per_unit(context.scene), np.inf
    if link.mode == "OBJECT" and link.visible_get():
        met = point_on(link, context.evaluated_depsgraph_get(), start, direction)
        if met is not None:  # cells can be slightly below the visible surface
            farthest = ((met - eye).length + taxels.width / metre) / ahead.length
    row = taxels.under(metre * np.array(eye), metre * np.array(ahead), farthest)
    return None if row is None else taxels.ids[row]
