# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw the layers of the fitted links over the 3D view, and over pictures of it."""

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any

import bpy
import gpu
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ...calibration.model import Patch
from ...common.arrays import Array
from ...pipeline import Calibrated
from ..scene import results, skins
from ..scene.link_meshes import link_frame
from ..scene.preferences import COLOURS, preferences
from ..scene.units import metres_per_unit
from ..session import session
from . import labels, legend
from .layers import Labels, Layer, Layers, dashed, layers_of

# Distance by which lines are drawn nearer to the eye, relative to their distance from it.
# Larger: lines behind thin parts are visible; smaller: the facets hide their own lines.
LINE_OFFSET = 0.004
WIDTHS = {"SECTIONS": 2.0, "LINES": 1.5, "NET": 1.0, "SURFACE": 1.0, "CELLS": 1.5, "NORMALS": 2.0}
# Ends of segments from which on a layer has lines of one pixel. Larger: without a graphics card the window gets slow.
MAX_WIDE_POINTS = 10000
# Line width [pixels] from which on wide lines are drawn nevertheless. Larger: wide lines of large layers stay thin.
MAX_PLAIN_WIDTH = 2.0
HEAT_MAPS = {"ERROR", "STRAIN", "TILT", "UNCERTAINTY", "FORCE"}
FORCE_LAYERS = {"CONTACTS", "NUMBERS", "COP", "POLYGONS"}  # drawn with the forces
SWITCHABLE = (
    HEAT_MAPS | FORCE_LAYERS | {name.upper() for name in COLOURS} | {"PLANES"}
)  # drawn only if they are switched on
MAX_CACHED_LAYERS = 64  # marks and comparisons; smaller: undo over many steps does not show them again

_handles: list[Any] = []
_cached: dict[str, tuple[Layer, ...]] = {}


@lru_cache(maxsize=results.KEPT)  # results compare by identity
def layers_for(result: Calibrated) -> Layers:
    """Return the layers of a result, which are computed once."""
    return layers_of(result)


def cache(token: str, layers: tuple[Layer, ...]) -> None:
    """Store layers under a token; a link whose properties contain the token shows them, also after undo."""
    _cached.pop(token, None)
    _cached[token] = layers
    while len(_cached) > MAX_CACHED_LAYERS:
        del _cached[next(iter(_cached))]


def shown_layers(link: Any) -> Iterator[Layer]:
    """Yield what is drawn of an object now, the lowest layer first."""
    plan, sketch, shown = link.skin_calib, session.of(link).sketch, switched_on(link)
    cached = [layer for token in plan.inspect.tokens() for layer in _chosen(_cached.get(token, ()), shown)]
    yield from (layer for layer in cached if layer.what in HEAT_MAPS)  # lines are drawn over colours
    drawn = layers_now(link)
    yield from drawn.shown(shown) if drawn else ()
    yield from _chosen(sketch.layers if sketch else (), shown)
    yield from (layer for layer in cached if layer.what not in HEAT_MAPS)


def is_of_last_fit(link: Any) -> bool:
    """Return whether what is drawn of an object is of its last fit, before a change of plan or mesh."""
    return link.skin_calib.result.outdated and session.of(link).layers is None


def layers_now(link: Any) -> Layers | None:
    """Return the layers of preview or fit that are drawn of an object now; None before the first fit."""
    result = results.find(link.skin_calib.result.key)
    return session.of(link).layers or (layers_for(result) if result else None)


def patches_of(link: Any) -> Sequence[Patch]:
    """Return the patches that are drawn of an object now, one for each of its skins; none without a fit of these."""
    drawn = layers_now(link)
    return drawn.patches if drawn and len(drawn.patches) == len(link.skin_calib.skins) else ()


def frame_of(skin: Any) -> tuple[Array, Array] | None:
    """Return the tangents of the surface that is drawn now at the origin of a skin; None without a surface there."""
    drawn = layers_now(skin.id_data)
    surfaces = drawn.surfaces if drawn else {}
    surface = surfaces.get(skin.surface) or next(iter(surfaces.values()), None)
    return surface and skins.frame_of(skin, surface, metres_per_unit(bpy.context.scene))


def switched_on(link: Any) -> set[str]:
    """Return the names of the layers that are switched on for an object."""
    plan = link.skin_calib
    labels = {"LABELS"} if plan.inspect.labels != "NONE" else set()
    force_layers = FORCE_LAYERS if plan.inspect.heat == "FORCE" else set()
    disabled = {"DISABLED"} if "CELLS" in plan.layers else set()
    return plan.layers | {plan.inspect.heat} | labels | force_layers | disabled


def _chosen(layers: Iterable[Layer], shown: set[str]) -> Iterator[Layer]:
    return (layer for layer in layers if layer.what in shown or layer.what not in SWITCHABLE)


def _visible_links() -> Iterator[tuple[Any, list[Layer]]]:
    """Yield the objects in this view, each with its layers."""
    context = bpy.context
    if not context.space_data.overlay.show_overlays:
        return
    for link in context.scene.objects:
        if link.type == "MESH" and link.skin_calib.show_overlay and link.visible_get(viewport=context.space_data):
            layers = list(shown_layers(link))
            if layers:
                yield link, layers


def draw(zoom: float = 1.0) -> None:
    """Draw lines and surfaces in the space of the scene, on ``zoom`` times as many pixels as the region is wide."""
    context = bpy.context
    view, unit = context.region_data, Matrix.Scale(1 / metres_per_unit(context.scene), 4)
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_mask_set(False)  # the link hides lines behind it; lines do not hide each other
    try:
        for link, layers in _visible_links():
            with gpu.matrix.push_pop():
                gpu.matrix.load_matrix(_offset(view) @ view.view_matrix @ link_frame(link) @ unit)
                _draw_layers(layers, link.skin_calib.inspect, zoom)
    finally:
        gpu.state.blend_set("NONE")
        gpu.state.depth_test_set("NONE")
        gpu.state.depth_mask_set(True)


def write(zoom: float = 1.0, is_picture: bool = False) -> None:
    """Draw labels and legends in pixels, over everything; those of a picture have all lines."""
    context = bpy.context
    unit, area = Matrix.Scale(1 / metres_per_unit(context.scene), 4), legend.LegendArea(context, zoom, is_picture)
    for link, layers in _visible_links():
        settings, name = link.skin_calib.inspect, link.skin_calib.link
        if is_of_last_fit(link):
            name += ": last fit, before the change"
        for layer in layers:
            if isinstance(layer, Labels):
                labels.write(layer, settings, link_frame(link) @ unit, zoom)
            if layer.legend:
                area.draw(layer.legend, name)
        area.draw_lines(list(_meanings(layers, is_picture)), name)


def _meanings(layers: list[Layer], with_all: bool) -> Iterator[legend.LineStyle]:
    """Yield the meaning of each style of lines; of those that a menu names only ``with_all``."""
    words = {name.upper(): label for name, (label, _) in COLOURS.items()} if with_all else {}
    for layer in layers:
        meaning = layer.words or words.get(layer.what, "")
        if meaning and len(layer.points):
            yield _colour(layer), WIDTHS.get(layer.what, layer.width), layer.dash > 0, meaning


def _offset(view: Any) -> Matrix:
    """Return the transform that moves lines towards the eye, without a change of the picture."""
    if view.window_matrix[3][3] == 0:
        return Matrix.Scale(1 - LINE_OFFSET, 4)
    return Matrix.Translation((0, 0, LINE_OFFSET * view.view_distance))


def _draw_layers(layers: list[Layer], settings: Any, zoom: float) -> None:
    size = (zoom * bpy.context.region.width, zoom * bpy.context.region.height)
    thickness = zoom * settings.line_width * preferences().line_width * bpy.context.preferences.system.pixel_size
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
        if layer.directions is not None:
            length = layer.length if settings.auto_length else settings.length * metre
        if layer.batch is None or layer.drawn_length != length:
            layer.batch, layer.drawn_length = _batch(layer, shader, length), length
        layer.batch.draw(shader)


def _line_shader(layer: Layer, size: tuple[float, float], width: float) -> Any:
    """Return the shader for the lines of a layer, with its colour and width."""
    is_plain = len(layer.points) > MAX_WIDE_POINTS and width <= MAX_PLAIN_WIDTH
    shader = gpu.shader.from_builtin("UNIFORM_COLOR" if is_plain else "POLYLINE_UNIFORM_COLOR")
    shader.uniform_float("color", _colour(layer))
    if not is_plain:
        shader.uniform_float("viewportSize", size)
        shader.uniform_float("lineWidth", width)
    return shader


def _colour(layer: Layer) -> Any:
    name = layer.what.lower()
    return tuple(getattr(preferences(), name)) if name in COLOURS else layer.colour or (1.0, 1.0, 1.0, 1.0)


def _batch(layer: Layer, shader: Any, length: float) -> Any:
    if layer.colours is not None:
        arrays = {"pos": layer.points, "color": layer.colours}
        return batch_for_shader(shader, "TRIS", arrays, indices=layer.indices)
    points = dashed(layer.points, layer.dash) if layer.dash else layer.points
    if layer.directions is not None:
        points = points + length * layer.directions
    return batch_for_shader(shader, "LINES", {"pos": points})


def redraw() -> None:
    """Make every 3D view draw again."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def register() -> None:
    """Draw in every 3D view."""
    add = bpy.types.SpaceView3D.draw_handler_add
    _handles.append(add(draw, (), "WINDOW", "POST_VIEW"))
    _handles.append(add(write, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    """Stop drawing, and remove all arrays."""
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
    layers_for.cache_clear()
    _cached.clear()
