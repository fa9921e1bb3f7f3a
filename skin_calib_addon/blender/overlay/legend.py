# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw legends in the corner of a 3D view: colour bars of heat maps, and what lines mean."""

from typing import Any

import blf
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ..scene.units import written
from .scales import STOPS, Legend

# Sizes in pixels of a screen with standard density. Larger: larger legends.
BAR_SIZE = (150, 12)
LINE_HEIGHT = 16
MARGIN = 14  # to the edges of the region
TEXT_SIZE = 11
TEXT_COLOUR = (1.0, 1.0, 1.0, 1.0)
BACKGROUND = (0.05, 0.05, 0.05, 0.85)
TICKS = 3  # numbers under a colour bar. Larger: wider bars
TICK_GAP = 8  # between two numbers
SAMPLE = ((0, 24), (0, 9, 15, 24))  # ends of a line in a legend, and of a dashed one

LineStyle = tuple[tuple[float, ...], float, bool, str]  # colour, width [pixels], whether it is dashed, meaning


class LegendArea:
    """Position of the legends in a region.

    A row at the lower left corner, next to the tools and above the redo panel.
    """

    def __init__(self, context: Any, zoom: float, is_picture: bool):
        self.units = context.scene.unit_settings
        self.pixel = zoom * context.preferences.system.ui_scale
        self.size = (zoom * context.region.width, zoom * context.region.height)
        right, top = (0.0, 0.0) if is_picture else _covered(context)
        self.left, self.low = MARGIN * self.pixel + right, MARGIN * self.pixel + top

    def draw(self, legend: Legend, link: str) -> None:
        """Draw a legend, and move to the right of it."""
        height = 3 * LINE_HEIGHT + BAR_SIZE[1] + (LINE_HEIGHT if legend.note else 0)
        numbers, unit = written(np.linspace(legend.minimum, legend.maximum, TICKS).tolist(), legend.kind, self.units)
        if legend.exceeded:
            numbers[-1] = f"≥ {numbers[-1]}"
        has_scale = legend.maximum > 0
        words = [link, f"{legend.title} [{unit}]" if unit else legend.title]
        bar = max(BAR_SIZE[0], TICKS * max(map(self._width, numbers)) + (TICKS - 1) * TICK_GAP)
        width = max(bar, *(self._width(word) for word in (*words, legend.note)))
        self._fill((-6, -6), (width + 12, height + 8), "shade")
        y = LINE_HEIGHT if legend.note else 0
        if legend.note:
            self._text(legend.note, 0, 0)
        if has_scale:
            self._fill((0, y + LINE_HEIGHT), (bar, BAR_SIZE[1]), legend.signed)
            for k, number in enumerate(numbers):
                self._text(number, k / (TICKS - 1) * (bar - self._width(number)), y)
        else:
            self._text("all zero" if not legend.note else "no values", 0, y)
        for k, word in enumerate(reversed(words)):
            self._text(word, 0, y + LINE_HEIGHT + BAR_SIZE[1] + 5 + k * LINE_HEIGHT)
        self.left += (width + 24) * self.pixel

    def draw_lines(self, styles: list[LineStyle], link: str) -> None:
        """Draw samples of lines with their meanings, each once, and move to the right of them."""
        rows = {words: style for *style, words in styles}
        if not rows:
            return
        indent = SAMPLE[0][-1] + TICK_GAP
        width = max(self._width(link), indent + max(map(self._width, rows)))
        self._fill((-6, -6), (width + 12, (len(rows) + 1) * LINE_HEIGHT + 8), "shade")
        for k, (words, (colour, thickness, is_dashed)) in enumerate(reversed(rows.items())):
            y = k * LINE_HEIGHT
            points = [(self.left + x * self.pixel, self.low + (y + 4) * self.pixel, 0) for x in SAMPLE[is_dashed]]
            shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
            shader.uniform_float("color", (*colour[:3], 1.0))
            shader.uniform_float("viewportSize", self.size)
            shader.uniform_float("lineWidth", thickness * self.pixel)
            batch_for_shader(shader, "LINES", {"pos": np.array(points, np.float32)}).draw(shader)
            self._text(words, indent, y)
        self._text(link, 0, len(rows) * LINE_HEIGHT)
        self.left += (width + 24) * self.pixel

    def _width(self, text: str) -> float:
        """Return the width of a text on a screen with standard density [pixel]."""
        blf.size(0, TEXT_SIZE * self.pixel)
        return blf.dimensions(0, text)[0] / self.pixel

    def _text(self, text: str, x: float, y: float) -> None:
        blf.size(0, TEXT_SIZE * self.pixel)
        blf.color(0, *TEXT_COLOUR)
        blf.position(0, self.left + x * self.pixel, self.low + y * self.pixel, 0)
        blf.draw(0, text)

    def _fill(self, corner: tuple[float, float], size: tuple[float, float], what: Any) -> None:
        shader = gpu.shader.from_builtin("SMOOTH_COLOR")
        gpu.state.blend_set("ALPHA")
        with gpu.matrix.push_pop():
            x, y = self.left + corner[0] * self.pixel, self.low + corner[1] * self.pixel
            gpu.matrix.multiply_matrix(Matrix.Translation((x, y, 0)))
            gpu.matrix.multiply_matrix(Matrix.Diagonal((size[0] * self.pixel, size[1] * self.pixel, 1, 1)))
            _strip(shader, what).draw(shader)
        gpu.state.blend_set("NONE")


def _strip(shader: Any, what: Any) -> Any:
    """Return a unit square in the colours of a scale, or in the background colour."""
    x = np.repeat(np.linspace(0, 1, STOPS), 2)
    points = np.column_stack((x, np.tile((0.0, 1.0), STOPS), 0 * x)).astype(np.float32)
    if what == "shade":
        colours = np.tile(np.array(BACKGROUND, np.float32), (len(points), 1))
    else:
        colours = np.repeat(
            Legend("", "FRACTION", 1.0, what).colours(np.linspace(-1.0 if what else 0.0, 1, STOPS)), 2, axis=0
        )
    return batch_for_shader(shader, "TRI_STRIP", {"pos": points, "color": colours})


def _covered(context: Any) -> tuple[float, float]:
    """Return the width that the tools cover at the left, and the height of the panel of the last operator below.

    A hidden region keeps its size, and a position outside of the view.
    """
    if not context.preferences.system.use_region_overlap:
        return 0.0, 0.0
    view = context.region
    open_ = [r for r in context.area.regions if r.width > 1 and r.height > 1 and r.x < view.x + view.width / 2]
    right = max((r.x + r.width - view.x for r in open_ if r.type == "TOOLS"), default=0)
    top = max((r.y + r.height - view.y for r in open_ if r.type == "HUD"), default=0)
    return max(float(right), 0.0), max(float(top), 0.0)
