# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of the 3D view: the scene, what is drawn over it, and legends; without handles, panels and menus."""

from typing import Any

import gpu
import numpy as np
from mathutils import Matrix

from . import drawing

MAX_WIDTH = 8192  # [pixels] of a picture. Larger: graphics cards refuse it


def picture_of(context: Any, region: Any, width: int, is_transparent: bool) -> np.ndarray:
    """Return the view of a region as a picture of some width, from its lowest row up, shape (h, w, 4) of 0 to 255."""
    zoom, view = width / region.width, context.region_data
    height = round(zoom * region.height)
    canvas = gpu.types.GPUOffScreen(width, height)
    try:
        canvas.draw_view3d(
            context.scene,
            context.view_layer,
            context.space_data,
            region,
            view.view_matrix,
            view.window_matrix,
            do_color_management=True,
            draw_background=not is_transparent,
        )
        with (
            canvas.bind(),
            context.temp_override(region=region),
            gpu.matrix.push_pop(),
            gpu.matrix.push_pop_projection(),
        ):
            gpu.matrix.load_projection_matrix(view.window_matrix)
            drawing.draw(zoom)
            gpu.matrix.load_matrix(Matrix.Identity(4))
            gpu.matrix.load_projection_matrix(
                Matrix.Translation((-1, -1, 0)) @ Matrix.Diagonal((2 / width, 2 / height, -1, 1))
            )
            drawing.write(zoom, is_picture=True)
            pixels = gpu.state.active_framebuffer_get().read_color(0, 0, width, height, 4, 0, "UBYTE")
    finally:
        canvas.free()
    pixels.dimensions = width * height * 4
    picture = np.array(pixels, np.uint8).reshape(height, width, 4)
    if not is_transparent:
        picture[..., 3] = 255
        return picture
    alpha = np.maximum(picture[..., 3:], 1)  # the canvas has colours times alpha, a file has colours
    picture[..., :3] = np.minimum(picture[..., :3] * (255 / alpha), 255)
    return picture
