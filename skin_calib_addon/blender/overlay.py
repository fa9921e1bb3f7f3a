# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the layers of the fitted links over the 3D view."""

from typing import Any

import bpy
import gpu
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ..pipeline import Calibrated
from . import results
from .layers import Layer, layers_of
from .scene import link_frame, metres_per_unit

# Lines are drawn nearer to the eye by this share of their distance, so that the facets they lie on do not hide them.
NEARER = 0.004
COLOURS = {"SURFACE": (0.35, 0.65, 1.0, 0.6), "CELLS": (1.0, 1.0, 1.0, 0.9), "NORMALS": (0.95, 0.2, 0.2, 1.0)}
COLOURS |= {
    "CUT": (1.0, 0.3, 0.9, 1.0),
    "U": (1.0, 0.65, 0.1, 1.0),
    "V": (0.3, 0.9, 0.4, 1.0),
    "MISSED": (1.0, 0.0, 0.0, 1.0),
}
WIDTHS = {"SURFACE": 1.0, "CELLS": 1.5, "NORMALS": 2.0, "CUT": 2.0, "U": 1.5, "V": 1.5, "MISSED": 2.0}

# Layers drawn in place of an object's result while its plan changes, by the object's name.
previews: dict[str, tuple[Layer, ...]] = {}
# Planes placed by hand and what they cut, drawn beside these.
sketches: dict[str, list[Layer]] = {}
_handle: Any = None
_prepared: dict[str, tuple[Layer, ...]] = {}


def prepare(key: str, result: Calibrated) -> None:
    """Make the arrays that the overlay draws for a result."""
    for old in [k for k in _prepared if results.find(k) is None]:
        del _prepared[old]
    if key not in _prepared:
        _prepared[key] = layers_of(result)


def _draw() -> None:
    context = bpy.context
    space, view = context.space_data, context.region_data
    if not space.overlay.show_overlays:
        return
    size = (context.region.width, context.region.height)
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(False)  # the link hides lines behind it; lines do not hide each other
    unit = Matrix.Scale(1 / metres_per_unit(context.scene), 4)
    try:
        for link in context.scene.objects:
            plan = link.skin_calib
            drawn = previews.get(link.name) or _prepared.get(plan.result.key, ())
            layers = [layer for layer in drawn if layer.what in plan.layers]
            layers += sketches.get(link.name, []) if "PLANES" in plan.layers else []
            if layers and plan.show_overlay and link.visible_get(viewport=space):
                _draw_layers(_nearer(view) @ view.view_matrix @ link_frame(link) @ unit, layers, size)
    finally:
        gpu.state.blend_set("NONE")
        gpu.state.depth_test_set("NONE")
        gpu.state.depth_mask_set(True)


def _nearer(view: Any) -> Matrix:
    """Towards the eye: about it in perspective, which leaves the picture as it is; straight in a parallel view."""
    if view.window_matrix[3][3] == 0:
        return Matrix.Scale(1 - NEARER, 4)
    return Matrix.Translation((0, 0, NEARER * view.view_distance))


def _draw_layers(to_eye: Matrix, layers: list[Layer], size: tuple[int, int]) -> None:
    with gpu.matrix.push_pop():
        gpu.matrix.load_matrix(to_eye)
        for layer in layers:
            if layer.colours is None:
                shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
                shader.uniform_float("viewportSize", size)
                shader.uniform_float("color", COLOURS[layer.what])
                shader.uniform_float("lineWidth", WIDTHS[layer.what])
                primitive, arrays = "LINES", {"pos": layer.points}
            else:
                shader = gpu.shader.from_builtin("SMOOTH_COLOR")
                primitive, arrays = "TRIS", {"pos": layer.points, "color": layer.colours}
            if layer.batch is None:
                layer.batch = batch_for_shader(shader, primitive, arrays)
            layer.batch.draw(shader)


def redraw() -> None:
    """Let every 3D view draw again."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def register() -> None:
    """Draw in every 3D view."""
    global _handle
    _handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW")


def unregister() -> None:
    """Stop drawing, and forget the arrays."""
    global _handle
    if _handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_handle, "WINDOW")
        _handle = None
    _prepared.clear()
    previews.clear()
    sketches.clear()
