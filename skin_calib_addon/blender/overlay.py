# SPDX-License-Identifier: GPL-3.0-or-later
"""Surface, cells and normals of the fitted links over the 3D view, from arrays prepared once for each result."""

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
SURFACE, CELLS, NORMALS = (0.35, 0.65, 1.0, 0.6), (1.0, 1.0, 1.0, 0.9), (0.95, 0.2, 0.2, 1.0)

_handle: Any = None
_prepared: dict[str, tuple["Lines", ...]] = {}


@dataclass(eq=False)
class Lines:
    """Segments of one colour in the link frame [m]; the batch is made in the first draw call."""

    points: np.ndarray  # (2 k, 3) float32
    colour: tuple[float, float, float, float]
    width: float
    batch: Any = None


def prepare(key: str, result: Calibrated) -> None:
    """Make the arrays that the overlay draws for a result."""
    for old in [k for k in _prepared if results.find(k) is None]:
        del _prepared[old]
    if key not in _prepared:
        _prepared[key] = (_surface_lines(result), *_taxel_lines(result))


def _segments(polylines: np.ndarray) -> np.ndarray:
    """Ends of the segments of polylines (k, p, 3), shape (2 k (p - 1), 3), in the order in which the GPU reads them."""
    ends = np.stack((polylines[:, :-1], polylines[:, 1:]), axis=2).reshape(-1, 3)
    return np.ascontiguousarray(ends, np.float32)


def _surface_lines(result: Calibrated) -> Lines:
    """Curves of constant u and v."""
    surface = result.fit.surface
    fine = np.linspace(0, 1, CURVE_POINTS + 1)
    n, m = result.fit.lines.origins.shape[:2]
    around = surface.grid_points(np.linspace(0, 1, n), fine)
    along = surface.grid_points(fine, np.linspace(0, 1, m + 1)).transpose(1, 0, 2)
    return Lines(np.concatenate((_segments(around), _segments(along))), SURFACE, 1.0)


def _taxel_lines(result: Calibrated) -> tuple[Lines, ...]:
    """Outlines of the cells, and their normals."""
    lines = []
    for patch in result.calibration.patches:
        t = patch.taxels
        outline = np.concatenate((t.corners_link, t.corners_link[:, :1]), axis=1)
        sticks = np.stack((t.positions_link, t.positions_link + NORMAL_LENGTH * t.normals_link), axis=1)
        lines.append(Lines(_segments(outline), CELLS, 1.5))
        lines.append(Lines(_segments(sticks), NORMALS, 2.0))
    return tuple(lines)


def _draw() -> None:
    context = bpy.context
    space, view = context.space_data, context.region_data
    if not space.overlay.show_overlays:
        return
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    shader.uniform_float("viewportSize", (context.region.width, context.region.height))
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(False)  # the link hides lines behind it; lines do not hide each other
    unit = Matrix.Scale(1 / metres_per_unit(context.scene), 4)
    try:
        for link in context.scene.objects:
            lines = _prepared.get(link.skin_calib.result.key, ())
            if lines and link.skin_calib.show_overlay and link.visible_get(viewport=space):
                _draw_lines(shader, _nearer(view) @ view.view_matrix @ link_frame(link) @ unit, lines)
    finally:
        gpu.state.blend_set("NONE")
        gpu.state.depth_test_set("NONE")
        gpu.state.depth_mask_set(True)


def _nearer(view: Any) -> Matrix:
    """Towards the eye: about it in perspective, which leaves the picture as it is; straight in a parallel view."""
    if view.window_matrix[3][3] == 0:
        return Matrix.Scale(1 - NEARER, 4)
    return Matrix.Translation((0, 0, NEARER * view.view_distance))


def _draw_lines(shader: Any, to_eye: Matrix, lines: tuple[Lines, ...]) -> None:
    with gpu.matrix.push_pop():
        gpu.matrix.load_matrix(to_eye)
        for part in lines:
            if part.batch is None:
                part.batch = batch_for_shader(shader, "LINES", {"pos": part.points})
            shader.uniform_float("color", part.colour)
            shader.uniform_float("lineWidth", part.width)
            part.batch.draw(shader)


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
