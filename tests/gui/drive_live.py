"""Drives a plan with Live on: surface and skin change during a drag, after undo, and once enabled again."""

import addon_utils
import bpy
from buttons import find, press
from sample import open_steps, ours, plan, run, state, undo


def points_drawn():
    """Return the number of points of each layer of the preview."""
    return {layer.what: len(layer.points) for layer in state().layers}


def drive(gui):
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    yield from run(gui, "fit")
    yield from gui.wait(lambda: plan().result.key, 30, "the fit")
    yield from press(gui, "skin_calib.live")
    yield from gui.wait(lambda: plan().live and not plan().result.outdated, 30, "the first result")
    yield from follows_a_drag(gui)
    yield from follows_undo(gui)
    yield from follows_once_enabled_again(gui)


def follows_a_drag(gui):
    """The new surface is drawn while the mouse button is still down."""
    was, before = plan().grid.n, plan().result.key
    ours("live.updates").FIT_DELAY = 60.0  # a software renderer rests between two moves
    x, y = yield from find(gui, "skin_calib.grid.n")
    yield from gui.drag((x, y), (x + 30, y), mods=(), release=False)
    yield from gui.wait(lambda: state().layers, 20, "a preview under the drag")
    assert plan().grid.n != was and plan().result.key == before and plan().result.outdated
    yield from gui.redraw()
    yield from gui.shot("dragged.png")
    assert points_drawn()["CELLS"] == 120 * 8
    yield from gui.release()
    ours("live.updates").FIT_DELAY = 0.4
    yield from gui.wait(lambda: plan().result.key != before, 30, "the result after the rest")
    assert not plan().result.outdated and not state().layers
    yield from gui.shot("rested.png")


def follows_undo(gui):
    """Ctrl-Z restores the planes, and the surface follows."""
    now = plan().grid.n
    yield from undo(gui)
    assert plan().grid.n != now
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the result after undo")
    yield from gui.shot("undone.png")


def follows_once_enabled_again(gui):
    """The button Live is still pressed, and the skin is drawn and fitted again."""
    name = next(a.module for a in bpy.context.preferences.addons if a.module.endswith(".skin_calib"))
    addon_utils.disable(name)
    yield from gui.redraw()
    addon_utils.enable(name)
    assert plan().live
    yield from gui.wait(lambda: ours("scene.results").find(plan().result.key), 30, "the result after enabling")
    yield from gui.shot("enabled.png")
