# SPDX-License-Identifier: GPL-3.0-or-later
"""Error, surface, cells and normals of the fitted links over the 3D view, from arrays prepared once for each result."""

from dataclasses import dataclass
from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ..pipeline import Calibrated
from . import results
from .scene import link_frame, metres_per_unit

CURVE_POINTS = 96
NORMAL_LENGTH = 0.006  # [m]
# Lines are drawn nearer to the eye by this share of their distance, so that the facets they lie on do not hide them.
NEARER = 0.004
COLOURS = {"SURFACE": (0.35, 0.65, 1.0, 0.6), "CELLS": (1.0, 1.0, 1.0, 0.9), "NORMALS": (0.95, 0.2, 0.2, 1.0)}
WIDTHS = {"SURFACE": 1.0, "CELLS": 1.5, "NORMALS": 2.0}
# From no distance between surface and mesh to the largest one; grey where rays met no mesh.
SCALE = np.array(((0.27, 0.0, 0.33), (0.23, 0.32, 0.55), (0.13, 0.57, 0.55), (0.37, 0.79, 0.38), (0.99, 0.91, 0.15)))
UNKNOWN = (0.5, 0.5, 0.5)

# Layers drawn in place of an object's result while its plan changes, by the object's name.
previews: dict[str, tuple["Layer", ...]] = {}
_handle: Any = None
_prepared: dict[str, tuple["Layer", ...]] = {}


@dataclass(eq=False)
class Layer:
    """Segments of one colour, or triangles with a colour at each corner; the batch is made in the first draw call."""

    what: str
    points: np.ndarray  # (2 k, 3) or (3 k, 3) float32, in the link frame [m]
    colours: np.ndarray | None = None  # (3 k, 4) float32
    batch: Any = None


def prepare(key: str, result: Calibrated) -> None:
    """Make the arrays that the overlay draws for a result."""
    for old in [k for k in _prepared if results.find(k) is None]:
        del _prepared[old]
    if key not in _prepared:
        _prepared[key] = layers_of(result)


def layers_of(result: Any) -> tuple[Layer, ...]:
    """Everything that can be drawn of a result, or of what has a ``fit`` and a ``calibration`` with patches."""
    return (_error(result), _surface_lines(result), *_taxel_lines(result))


def _error(result: Any) -> Layer:
    """The surface, coloured by how far the mesh is from it along the rays of the fit."""
    fit, closed = result.fit, result.fit.lines.closed
    off = np.abs(fit.residuals)
    if closed:
        off = np.hstack((off, off[:, :1]))
    known, most = np.isfinite(off), np.nanmax(off, initial=0.0) or 1.0
    place = np.where(known, off, 0.0) / most * (len(SCALE) - 1)
    colour = np.stack([np.interp(place, np.arange(len(SCALE)), channel) for channel in SCALE.T], axis=2)
    colour = np.dstack((np.where(known[..., None], colour, UNKNOWN), np.ones_like(off)))
    grid = fit.surface.grid_points(np.linspace(0, 1, off.shape[0]), np.linspace(0, 1, off.shape[1]))
    return Layer("ERROR", _triangles(grid), _triangles(colour))


def _triangles(grid: np.ndarray) -> np.ndarray:
    """Corners of two triangles for each cell of a lattice (n, m, c), shape (6 (n - 1) (m - 1), c)."""
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    return np.ascontiguousarray(np.stack((a, b, c, a, c, d), axis=2).reshape(-1, grid.shape[2]), np.float32)


def _segments(polylines: np.ndarray) -> np.ndarray:
    """Ends of the segments of polylines (k, p, 3), shape (2 k (p - 1), 3), in the order in which the GPU reads them."""
    ends = np.stack((polylines[:, :-1], polylines[:, 1:]), axis=2).reshape(-1, 3)
    return np.ascontiguousarray(ends, np.float32)


def _surface_lines(result: Any) -> Layer:
    """Curves of constant u and v."""
    surface = result.fit.surface
    fine = np.linspace(0, 1, CURVE_POINTS + 1)
    n, m = result.fit.lines.origins.shape[:2]
    around = surface.grid_points(np.linspace(0, 1, n), fine)
    along = surface.grid_points(fine, np.linspace(0, 1, m + 1)).transpose(1, 0, 2)
    return Layer("SURFACE", np.concatenate((_segments(around), _segments(along))))


def _taxel_lines(result: Any) -> tuple[Layer, ...]:
    """Outlines of the cells, and their normals."""
    layers = []
    for patch in result.calibration.patches:
        t = patch.taxels
        outline = np.concatenate((t.corners_link, t.corners_link[:, :1]), axis=1)
        sticks = np.stack((t.positions_link, t.positions_link + NORMAL_LENGTH * t.normals_link), axis=1)
        layers.append(Layer("CELLS", _segments(outline)))
        layers.append(Layer("NORMALS", _segments(sticks)))
    return tuple(layers)


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
