# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the layers of the fitted links over the 3D view."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import bpy
import gpu
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ...calibration.model import Patch
from ...pipeline import Calibrated
from ..scene import results
from ..scene.scene import link_frame, metres_per_unit
from . import labels, legend
from .layers import Labels, Layer, Layers, layers_of

# Lines are drawn nearer to the eye by this share of their distance, so that the facets they lie on do not hide them.
NEARER = 0.004
COLOURS = {
    "SECTIONS": (1.0, 0.6, 0.1, 0.9),
    "LINES": (0.3, 0.85, 0.4, 0.8),
    "NET": (0.85, 0.45, 0.95, 0.8),
    "SURFACE": (0.35, 0.65, 1.0, 0.6),
    "CELLS": (1.0, 1.0, 1.0, 0.9),
    "NORMALS": (0.95, 0.2, 0.2, 1.0),
}
WIDTHS = {"SECTIONS": 2.0, "LINES": 1.5, "NET": 1.0, "SURFACE": 1.0, "CELLS": 1.5, "NORMALS": 2.0}
# So many ends of segments are drawn as plain lines, one pixel wide, unless the author wants more than so many pixels:
# without a graphics card wide lines of 10 000 cells alone take longer than a thirtieth of a second.
MANY, THIN = 10000, 2.0
HEATS = {"ERROR", "STRAIN", "TILT", "FORCE"}
OF_FORCE = {"CONTACTS", "COP", "POLYGONS"}  # drawn with the forces
SWITCHED = HEATS | OF_FORCE | COLOURS.keys() | {"PLANES"}  # drawn only where the author wants them
KEPT = 64  # marks and comparisons

Drawn = Layers | tuple[Layer, ...]

# Layers drawn in place of an object's result while its plan changes, by the object's name.
previews: dict[str, Drawn] = {}
# Layers drawn besides: by who hands them over, then by the object's name.
added: dict[str, dict[str, tuple[Layer, ...]]] = {}
_handles: list[Any] = []
_prepared: dict[str, Layers] = {}
_kept: dict[str, tuple[Layer, ...]] = {}


def prepare(key: str, result: Calibrated) -> Layers:
    """Take a result to be drawn; its layers."""
    for old in [k for k in _prepared if results.find(k) is None]:
        del _prepared[old]
    if key not in _prepared:
        _prepared[key] = layers_of(result)
    return _prepared[key]


def keep(token: str, layers: tuple[Layer, ...]) -> None:
    """Layers that are drawn of any link whose properties name the token: undo brings both back."""
    _kept.pop(token, None)
    _kept[token] = layers
    while len(_kept) > KEPT:
        del _kept[next(iter(_kept))]


def hand_over(source: str, name: str, layers: tuple[Layer, ...]) -> None:
    """Draw layers of an object besides its result, in place of those that this source gave before."""
    added.setdefault(source, {})[name] = layers


def take_back(source: str, name: str | None = None) -> None:
    """Draw no more what a source handed over, of one object or of all."""
    if name is None:
        added.pop(source, None)
    else:
        added.get(source, {}).pop(name, None)


def shown_layers(link: Any) -> Iterator[Layer]:
    """What is drawn of an object now, the lowest first."""
    plan, shown = link.skin_calib, switched_on(link)
    kept = [layer for token in plan.inspect.tokens() for layer in _chosen(_kept.get(token, ()), shown)]
    yield from (layer for layer in kept if layer.what in HEATS)  # lines lie over colours
    yield from _chosen(previews.get(link.name) or _prepared.get(plan.result.key, ()), shown)
    for source in added.values():
        yield from _chosen(source.get(link.name, ()), shown)
    yield from (layer for layer in kept if layer.what not in HEATS)


def patches_of(link: Any) -> Sequence[Patch]:
    """The patches that are drawn of an object now, one for each of its skins; none before the first fit."""
    drawn = previews.get(link.name) or _prepared.get(link.skin_calib.result.key)
    return drawn.patches if isinstance(drawn, Layers) else ()


def switched_on(link: Any) -> set[str]:
    """Names of the layers that the author wants to see of an object."""
    plan = link.skin_calib
    labels = {"LABELS"} if plan.inspect.labels != "NONE" else set()
    felt = OF_FORCE if plan.inspect.heat == "FORCE" else set()
    return plan.layers | {plan.inspect.heat} | labels | felt


def _chosen(layers: Layers | Iterable[Layer], shown: set[str]) -> Iterator[Layer]:
    if isinstance(layers, Layers):
        return layers.shown(shown)
    return (layer for layer in layers if layer.what in shown or layer.what not in SWITCHED)


def _seen() -> Iterator[tuple[Any, list[Layer]]]:
    """Objects in this view, each with its layers."""
    context = bpy.context
    if not context.space_data.overlay.show_overlays:
        return
    for link in context.scene.objects:
        if link.type == "MESH" and link.skin_calib.show_overlay and link.visible_get(viewport=context.space_data):
            layers = list(shown_layers(link))
            if layers:
                yield link, layers


def _draw() -> None:
    """In the space of the scene."""
    context = bpy.context
    view, unit = context.region_data, Matrix.Scale(1 / metres_per_unit(context.scene), 4)
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_mask_set(False)  # the link hides lines behind it; lines do not hide each other
    try:
        for link, layers in _seen():
            with gpu.matrix.push_pop():
                gpu.matrix.load_matrix(_nearer(view) @ view.view_matrix @ link_frame(link) @ unit)
                _draw_layers(layers, link.skin_calib.inspect)
    finally:
        gpu.state.blend_set("NONE")
        gpu.state.depth_test_set("NONE")
        gpu.state.depth_mask_set(True)


def _write() -> None:
    """In pixels, over everything."""
    context = bpy.context
    unit, place = Matrix.Scale(1 / metres_per_unit(context.scene), 4), legend.Place(context)
    for link, layers in _seen():
        looks = link.skin_calib.inspect
        for layer in layers:
            if isinstance(layer, Labels):
                labels.write(link.name, layer, looks, link_frame(link) @ unit)
            if layer.legend:
                place.draw(layer.legend, link.skin_calib.link)


def _nearer(view: Any) -> Matrix:
    """Towards the eye: about it in perspective, which leaves the picture as it is; straight in a parallel view."""
    if view.window_matrix[3][3] == 0:
        return Matrix.Scale(1 - NEARER, 4)
    return Matrix.Translation((0, 0, NEARER * view.view_distance))


def _draw_layers(layers: list[Layer], looks: Any) -> None:
    size = (bpy.context.region.width, bpy.context.region.height)
    thickness = looks.line_width * bpy.context.preferences.system.pixel_size
    metre = metres_per_unit(bpy.context.scene)
    for layer in layers:
        if isinstance(layer, Labels) or not len(layer.points):
            continue
        gpu.state.depth_test_set("NONE" if layer.on_top else "LESS_EQUAL")
        if layer.colours is None:
            shader = _line_shader(layer, size, WIDTHS.get(layer.what, layer.width) * thickness)
        else:
            shader = gpu.shader.from_builtin("SMOOTH_COLOR")
        length = 0.0
        if layer.ways is not None:
            length = layer.length if looks.auto_length else looks.length * metre
        if layer.batch is None or layer.drawn_length != length:
            layer.batch, layer.drawn_length = _batch(layer, shader, length), length
        layer.batch.draw(shader)


def _line_shader(layer: Layer, size: tuple[int, int], width: float) -> Any:
    """What draws the lines of a layer, with its colour and width set."""
    is_plain = len(layer.points) > MANY and width <= THIN
    shader = gpu.shader.from_builtin("UNIFORM_COLOR" if is_plain else "POLYLINE_UNIFORM_COLOR")
    shader.uniform_float("color", COLOURS.get(layer.what) or layer.colour or (1.0, 1.0, 1.0, 1.0))
    if not is_plain:
        shader.uniform_float("viewportSize", size)
        shader.uniform_float("lineWidth", width)
    return shader


def _batch(layer: Layer, shader: Any, length: float) -> Any:
    if layer.colours is not None:
        arrays = {"pos": layer.points, "color": layer.colours}
        return batch_for_shader(shader, "TRIS", arrays, indices=layer.indices)
    points = layer.points if layer.ways is None else layer.points + length * layer.ways
    return batch_for_shader(shader, "LINES", {"pos": points})


def redraw() -> None:
    """Let every 3D view draw again."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def register() -> None:
    """Draw in every 3D view."""
    add = bpy.types.SpaceView3D.draw_handler_add
    _handles.append(add(_draw, (), "WINDOW", "POST_VIEW"))
    _handles.append(add(_write, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    """Stop drawing, and forget the arrays."""
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
    for kept in (_prepared, _kept, previews, added):
        kept.clear()
    labels.forget()
    legend.forget()
