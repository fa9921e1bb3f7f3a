# SPDX-License-Identifier: GPL-3.0-or-later
"""Ids or channels of the taxels, written over the 3D view at those that face the viewer, as far as there is room."""

from collections.abc import Iterable
from typing import Any

import blf
import bpy
import numpy as np

from .layers import Labels

FACING = 0.2  # cosine between the normal and the way to the eye from which on a taxel is read
ROOM = (1.1, 1.3)  # of the widest name and of the letters' height
MOST = 1500  # names at a time
KEPT = 32  # views and objects whose names stay placed
MOST_ROOMS = 2**20  # beside each other in a region
_placed: dict[Any, tuple[Any, list[tuple[str, float, float]]]] = {}


def write(name: str, layer: Labels, looks: Any, frame: Any) -> None:
    """Write the names of an object's taxels in the region that is being drawn."""
    context = bpy.context
    region, view = context.region, context.region_data
    texts = layer.ids if looks.labels == "ID" else layer.channels
    letters = looks.text_size * context.preferences.system.ui_scale
    blf.size(0, letters)
    state = (layer, looks.labels, letters, region.width, region.height, _flat(view.perspective_matrix), _flat(frame))
    where = (region.as_pointer(), name)
    if _placed.get(where, (None,))[0] != state:
        if len(_placed) > KEPT:
            forget()
        widest = blf.dimensions(0, max(texts, key=len, default=""))[0]
        room = np.array((widest * ROOM[0], letters * ROOM[1]))
        pixels, eligible = on_screen(layer, frame, view, (region.width, region.height))
        rows = thinned(pixels, layer.order[eligible[layer.order]], room)
        _placed[where] = (state, [_centred(texts[row], pixels[row], letters) for row in rows])
    _write(_placed[where][1])


def _write(names: list[tuple[str, float, float]]) -> None:
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0.0, 0.0, 0.0, 0.9)
    for text, x, y in names:
        blf.position(0, x, y, 0)
        blf.draw(0, text)
    blf.disable(0, blf.SHADOW)


def _centred(text: str, pixel: np.ndarray, letters: float) -> tuple[str, float, float]:
    return text, float(pixel[0]) - blf.dimensions(0, text)[0] / 2, float(pixel[1]) - letters / 3


def _flat(matrix: Any) -> tuple[float, ...]:
    return tuple(x for row in matrix for x in row)


def on_screen(layer: Labels, frame: Any, view: Any, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Where the taxels are in a region (n, 2) [pixels], and which of them are in it and face the viewer (n,)."""
    to_clip = np.array(view.perspective_matrix @ frame, np.float32)
    clip = layer.points @ to_clip[:, :3].T + to_clip[:, 3]
    depth = clip[:, 3]
    ahead = depth > 0
    flat = clip[:, :2] / np.where(ahead, depth, 1.0)[:, None]
    to_link = frame.inverted() @ view.view_matrix.inverted()
    if view.window_matrix[3][3] == 0:  # in perspective
        ways = np.array(to_link.translation, np.float32) - layer.points
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    else:
        ways = np.array(to_link.to_3x3().col[2].normalized(), np.float32)
    facing = (layer.normals * ways).sum(axis=1) > FACING
    pixels = (flat + 1) / 2 * np.array(size, np.float32)
    return pixels, ahead & facing & (np.abs(flat) < 1).all(axis=1)


def thinned(pixels: np.ndarray, rows: Iterable[int], room: np.ndarray) -> list[int]:
    """The first of some rows whose names, each with its room (2,) [pixels], do not cover those before."""
    rows = np.asarray(rows, int)
    places = pixels[rows] / room
    i, j = places.astype(np.int64).T
    firsts = np.sort(np.unique(i * MOST_ROOMS + j, return_index=True)[1])  # at most one in each room
    kept: list[int] = []
    taken: dict[tuple[int, int], tuple[float, float]] = {}
    for row, x, y in zip(rows[firsts].tolist(), *places[firsts].T.tolist()):
        i, j = int(x), int(y)
        if len(kept) == MOST:
            break
        near = (taken.get((i + a, j + b)) for a in (-1, 0, 1) for b in (-1, 0, 1))
        if all(other is None or abs(other[0] - x) >= 1 or abs(other[1] - y) >= 1 for other in near):
            taken[i, j] = x, y
            kept.append(row)
    return kept


def forget() -> None:
    """Let go of what was written."""
    _placed.clear()
