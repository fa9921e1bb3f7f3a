"""Drives the legend in the view: its place, and its numbers."""

import blf
import bpy
from buttons import press
from sample import hover_view, open_steps, ours, plan


def drive(gui):
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    yield from press(gui, "skin_calib.fit")
    yield from gui.wait(lambda: plan().result.key, 60, "the fit")
    yield from draws_the_legend_in_the_view(gui)


def texts_of_the_legend(gui):
    """Draw, and return the texts of the legends: text, left, right and lower end [pixels of the region]."""
    area, found = ours("overlay.legend").LegendArea, []
    text = area._text

    def note(self, words, x, y):
        text(self, words, x, y)
        left = self.left + x * self.pixel
        found.append((words, left, left + blf.dimensions(0, words)[0], self.low + y * self.pixel))

    area._text = note
    yield from hover_view(gui)
    gui.area().tag_redraw()
    yield from gui.redraw()
    area._text = text
    return found[-5:]  # of the last draw: three numbers, title, link


def draws_the_legend_in_the_view(gui):
    """After a fit by the mouse the legend is in the view, and its numbers do not overlap, in metres, too."""
    plan().inspect.heat = "ERROR"
    units = bpy.context.scene.unit_settings
    for unit in ("METERS", "MILLIMETERS"):
        units.length_unit = unit
        texts = yield from texts_of_the_legend(gui)
        yield from gui.shot(f"legend_{unit.lower()}.png")
        assert len(texts) == 5, texts
        view, side = gui.region(), gui.region("UI")
        for words, left, right, low in texts:
            assert left >= 0 and view.x + right < side.x and 0 <= low < view.height / 2, (words, left, right, low)
        numbers = sorted(texts[:3], key=lambda text: text[1])
        assert all(a[2] + 4 <= b[1] for a, b in zip(numbers, numbers[1:])), numbers
