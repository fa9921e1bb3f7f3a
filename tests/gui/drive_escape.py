"""Drives Esc in each operator that waits for clicks."""

from drive_robot import running
from sample import hover_view, plan, run

# Operators that wait for clicks.
PICKING = ("cut_place", "axis_from_sections", "place", "taxel", "taxel_toggle")


def drive(gui):
    yield from gui.tab("Skin")
    yield from hover_view(gui)
    yield from escapes(gui)


def escapes(gui):
    """Esc ends each operator that waits for clicks, and changes nothing."""
    yield from run(gui, "fit")
    yield from gui.wait(lambda: plan().result.key and not plan().result.outdated, 60, "the fit")
    key = plan().result.key
    for name in PICKING:
        yield from run(gui, name)
        assert running(), name
        yield from hover_view(gui)
        yield from gui.key("ESC")
        yield from gui.redraw(2)
        assert not running(), name
        assert plan().result.key == key and not plan().result.outdated, name
