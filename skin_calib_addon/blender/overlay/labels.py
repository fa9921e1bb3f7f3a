# SPDX-License-Identifier: GPL-3.0-or-later
"""Write ids or channels of taxels over the 3D view, for taxels that face the viewer, without overlaps."""

from collections.abc import Iterable
from typing import Any

import blf
import bpy
import numpy as np

from ..scene.preferences import preferences
from .layers import Labels

# Cosine of the angle between a normal and the direction to the eye from which on a taxel has a label.
# Larger: fewer labels at the border of the link.
MIN_FACING = 0.2
# Width and height of a label's cell, relative to the widest label and to the text size. Larger: fewer labels.
LABEL_SPACING = (1.1, 1.3)
# Larger: slower redraw; smaller: labels are missing in large views.
MAX_LABELS = 1500
MAX_COLUMNS = 2**20  # Derived: more than the cells in a row of any region


def write(layer: Labels, settings: Any, frame: Any, zoom: float) -> None:
    """Write the labels of an object's taxels in the region that Blender draws now."""
    context = bpy.context
    region = context.region
    texts = layer.ids if settings.labels == "ID" else layer.channels
    text_size = zoom * settings.text_size * preferences().text_size * context.preferences.system.ui_scale
    blf.size(0, text_size)
    widest = blf.dimensions(0, max(texts, key=len, default=""))[0]
    size = np.array((widest * LABEL_SPACING[0], text_size * LABEL_SPACING[1]))
    pixels, eligible = on_screen(layer, frame, context.region_data, (zoom * region.width, zoom * region.height))
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0.0, 0.0, 0.0, 0.9)
    for row in without_overlap(pixels, layer.order[eligible[layer.order]], size):
        x, y = pixels[row].tolist()
        blf.position(0, x - blf.dimensions(0, texts[row])[0] / 2, y - text_size / 3, 0)
        blf.draw(0, texts[row])
    blf.disable(0, blf.SHADOW)


def on_screen(layer: Labels, frame: Any, view: Any, size: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the positions of the taxels in a region, and which of them are visible."""
    to_clip = np.array(view.perspective_matrix @ frame, np.float32)
    clip = layer.points @ to_clip[:, :3].T + to_clip[:, 3]
    depth = clip[:, 3]
    ahead = depth > 0
    flat = clip[:, :2] / np.where(ahead, depth, 1.0)[:, None]
    to_link = frame.inverted() @ view.view_matrix.inverted()
    if view.window_matrix[3][3] == 0:  # perspective view
        to_eye = np.array(to_link.translation, np.float32) - layer.points
        to_eye /= np.linalg.norm(to_eye, axis=1, keepdims=True)
    else:
        to_eye = np.array(to_link.to_3x3().col[2].normalized(), np.float32)
    facing = (layer.normals * to_eye).sum(axis=1) > MIN_FACING
    pixels = (flat + 1) / 2 * np.array(size, np.float32)
    return pixels, ahead & facing & (np.abs(flat) < 1).all(axis=1)


def without_overlap(pixels: np.ndarray, rows: Iterable[int], size: np.ndarray) -> list[int]:
    """Return the rows whose labels do not cover a label before them."""
    rows = np.asarray(rows, int)
    cells = pixels[rows] / size
    i, j = cells.astype(np.int64).T
    firsts = np.sort(np.unique(i * MAX_COLUMNS + j, return_index=True)[1])  # at most one in each cell
    kept: list[int] = []
    taken: dict[tuple[int, int], tuple[float, float]] = {}
    for row, x, y in zip(rows[firsts].tolist(), *cells[firsts].T.tolist()):
        i, j = int(x), int(y)
        if len(kept) == MAX_LABELS:
            break
        near = (taken.get((i + a, j + b)) for a in (-1, 0, 1) for b in (-1, 0, 1))
        if all(other is None or abs(other[0] - x) >= 1 or abs(other[1] - y) >= 1 for other in near):
            taken[i, j] = x, y
            kept.append(row)
    return kept
