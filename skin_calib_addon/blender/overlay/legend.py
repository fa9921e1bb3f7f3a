# SPDX-License-Identifier: GPL-3.0-or-later
"""The colour bar in the corner of a 3D view: what the colours of a heat map stand for."""

from typing import Any

import blf
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ..scene.units import written
from .scales import STOPS, Legend

# In pixels of a screen with usual density.
BAR, LINE, EDGE, LETTERS = (150, 12), 16, 14, 11
INK, SHADE = (1.0, 1.0, 1.0, 1.0), (0.05, 0.05, 0.05, 0.6)
TICKS = 3
_batches: dict[Any, Any] = {}


class Place:
    """Where in a region legends go: beside each other in its lower left corner, clear of tools and redo panel."""

    def __init__(self, context: Any):
        self.context = context
        self.pixel = context.preferences.system.ui_scale
        right, top = _covered(context)
        self.left, self.low = EDGE * self.pixel + right, EDGE * self.pixel + top

    def draw(self, legend: Legend, link: str) -> None:
        """Draw a legend, and go on to its right."""
        height = 3 * LINE + BAR[1] + (LINE if legend.note else 0)
        numbers, unit = written(np.linspace(legend.least, legend.most, TICKS).tolist(), legend.kind, _units(self))
        has_scale = legend.most > 0
        words = [link, f"{legend.title} [{unit}]" if unit else legend.title]
        width = max(BAR[0], *(_width(word, self.pixel) / self.pixel for word in (*words, legend.note)))
        self._fill((-6, -6), (width + 12, height + 8), "shade")
        y = LINE if legend.note else 0
        if legend.note:
            self._say(legend.note, 0, 0)
        if has_scale:
            self._fill((0, y + LINE), BAR, legend.signed)
            for k, number in enumerate(numbers):
                share = k / (TICKS - 1)
                self._say(number, share * (BAR[0] - _width(number, self.pixel) / self.pixel), y)
        else:
            self._say("all zero" if not legend.note else "nothing is known", 0, y)
        for k, word in enumerate(reversed(words)):
            self._say(word, 0, y + LINE + BAR[1] + 5 + k * LINE)
        self.left += (width + 24) * self.pixel

    def _say(self, text: str, x: float, y: float) -> None:
        blf.size(0, LETTERS * self.pixel)
        blf.color(0, *INK)
        blf.position(0, self.left + x * self.pixel, self.low + y * self.pixel, 0)
        blf.draw(0, text)

    def _fill(self, corner: tuple[float, float], size: tuple[float, float], what: Any) -> None:
        shader = gpu.shader.from_builtin("SMOOTH_COLOR")
        if what not in _batches:
            _batches[what] = _strip(shader, what)
        gpu.state.blend_set("ALPHA")
        with gpu.matrix.push_pop():
            x, y = self.left + corner[0] * self.pixel, self.low + corner[1] * self.pixel
            gpu.matrix.multiply_matrix(Matrix.Translation((x, y, 0)))
            gpu.matrix.multiply_matrix(Matrix.Diagonal((size[0] * self.pixel, size[1] * self.pixel, 1, 1)))
            _batches[what].draw(shader)
        gpu.state.blend_set("NONE")


def _strip(shader: Any, what: Any) -> Any:
    """A square from 0 to 1 in the colours of a scale, or all in shade."""
    x = np.repeat(np.linspace(0, 1, STOPS), 2)
    points = np.column_stack((x, np.tile((0.0, 1.0), STOPS), 0 * x)).astype(np.float32)
    if what == "shade":
        colours = np.tile(np.array(SHADE, np.float32), (len(points), 1))
    else:
        colours = np.repeat(
            Legend("", "SHARE", 1.0, what).colours(np.linspace(-1.0 if what else 0.0, 1, STOPS)), 2, axis=0
        )
    return batch_for_shader(shader, "TRI_STRIP", {"pos": points, "color": colours})


def _width(text: str, pixel: float) -> float:
    blf.size(0, LETTERS * pixel)
    return blf.dimensions(0, text)[0]


def _units(place: Place) -> Any:
    return place.context.scene.unit_settings


def _covered(context: Any) -> tuple[float, float]:
    """How far the tools cover a view from its left edge, and the panel of the last operator from its lower one."""
    if not context.preferences.system.use_region_overlap:
        return 0.0, 0.0
    view = context.region
    open_ = [r for r in context.area.regions if r.width > 1 and r.height > 1 and r.x < view.x + view.width / 2]
    right = max((r.x + r.width - view.x for r in open_ if r.type == "TOOLS"), default=0)
    top = max((r.y + r.height - view.y for r in open_ if r.type == "HUD"), default=0)
    return float(right), float(top)


def forget() -> None:
    """Let go of what was drawn with."""
    _batches.clear()
