"""Drives the touches of a session: arrows and ellipses, a list that jumps, and the refined plan."""

from pathlib import Path

import bpy
from buttons import find, press
from drive_inspect import answer, changed, screenshot
from sample import open_steps, pink, plan, run, undo

ROOT = Path(__file__).resolve().parents[2]


def drive(gui):
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    yield from run(gui, "fit")
    yield from gui.wait(lambda: plan().result.key, 30, "the fit")
    yield from gui.tab("Inspect")
    plan().layers = {"CELLS"}
    yield from shows_the_session(gui)
    yield from jumps_to_touches(gui)
    yield from refines(gui)


def shows_the_session(gui):
    """Presses have arrows, the skin has ellipses, and the verdict about the channels is among the lines."""
    before = yield from screenshot(gui)
    yield from press(gui, "skin_calib.touches")
    yield from answer(gui, ROOT / "examples" / "wrist_session.csv")
    found = plan().inspect.touches
    assert len(found.places) == 20 and found.chosen == -1, len(found.places)
    assert "Channels in the planned order" in found.remarks and " next: the largest" in found.remarks, found.remarks
    yield from screenshot(gui)
    yield from gui.shot("session.png")
    assert changed(gui, before) > 0.005


def jumps_to_touches(gui):
    """A click on a row of the list marks the touch and moves the view; Ctrl-Z takes both lists back."""
    before = pink(gui)
    x, y = yield from find(gui, "skin_calib.touches_move")
    view = gui.area().spaces.active.region_3d.view_matrix.copy()
    row = 22 * bpy.context.preferences.system.ui_scale
    yield from gui.click(x, y + 4 * row)
    found = plan().inspect.touches
    assert found.chosen >= 0, "no row of the list was under the mouse"
    yield from screenshot(gui)
    yield from gui.shot("jumped.png")
    assert pink(gui) > before + 100, (before, pink(gui))
    assert gui.area().spaces.active.region_3d.view_matrix != view
    cursor = bpy.context.scene.cursor.location.copy()
    yield from gui.click(x, y + 3 * row)
    assert bpy.context.scene.cursor.location != cursor
    yield from screenshot(gui)
    yield from gui.shot("next_row.png")


def refines(gui):
    """One step moves the skin and keeps the registration; one Ctrl-Z takes it back; a new fit has it."""
    yield from press(gui, "skin_calib.touches_move")
    assert plan().skins[0].touches and plan().result.outdated
    yield from undo(gui)
    assert not plan().skins[0].touches and plan().skins[0].centred and not plan().result.outdated
    yield from undo(gui, "shift")
    yield from run(gui, "fit")
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the fit")
    assert plan().skins[0].touches
    yield from gui.tab("Skin")
    yield from find(gui, "skin_calib.registration_remove")
    yield from gui.shot("registered.png")
