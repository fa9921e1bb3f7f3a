"""Drives single taxels: one is read, disabled and given a channel by the panel; others are disabled by clicks."""

import bpy
from buttons import press
from drive_inspect import position_of, screenshot
from sample import link, ours, plan, red, run, undo


def drive(gui):
    yield from gui.tab("Skin")
    yield from run(gui, "fit")
    yield from gui.wait(lambda: plan().result.key, 60, "the fit")
    yield from gui.tab("Inspect")
    plan().layers = {"CELLS"}
    bpy.ops.ed.undo_push(message="Layers")
    yield from disables_by_the_panel(gui)
    yield from sets_a_channel(gui)
    yield from disables_by_clicks(gui)


def taxels():
    """Return the taxels that are drawn."""
    return ours("overlay.drawing").patches_of(link())[0].taxels


def placed(gui, count):
    """Wait for a complete result with this number of taxels."""
    done = lambda: plan().result.taxels == count and not plan().result.outdated  # noqa: E731
    yield from gui.wait(done, 60, f"{count} taxels")
    yield from gui.redraw(3)


def disables_by_the_panel(gui):
    """The taxel that was read gets a red cross; the same button enables it; Ctrl-Z and redo work."""
    count = plan().result.taxels
    yield from press(gui, "skin_calib.taxel(")
    yield from gui.click(*gui.at(position_of("wrist.2.7")))
    yield from gui.key("ESC")
    yield from screenshot(gui)
    before = red(gui)
    yield from press(gui, 'skin_calib.taxel_toggle(taxel="wrist')
    yield from placed(gui, count - 1)
    yield from screenshot(gui)
    yield from gui.shot("disabled.png")
    assert plan().inspect.taxel.disabled and "wrist.2.7" not in taxels().ids
    assert red(gui) > before + 30, (before, red(gui))
    yield from undo(gui)
    assert not plan().skins[0].taxels
    yield from undo(gui, "shift")
    assert [single.taxel for single in plan().skins[0].taxels] == ["2.7"]
    yield from run(gui, "fit")
    yield from placed(gui, count - 1)
    yield from press(gui, 'skin_calib.taxel_toggle(taxel="wrist')
    yield from placed(gui, count)
    assert not plan().skins[0].taxels and not plan().inspect.taxel.disabled


def sets_a_channel(gui):
    """The dialog takes the number by keys."""
    yield from press(gui, "skin_calib.taxel_channel")
    yield 0.5
    yield from gui.shot("channel.png")
    yield from answers(gui, "300")
    assert channel_of("2.7") == 300, list(plan().skins[0].taxels)
    yield from gui.wait(lambda: not plan().result.outdated, 60, "the fit")
    yield from gui.redraw(3)
    assert plan().inspect.taxel.channel == 300 and 300 in taxels().channels
    yield from screenshot(gui)
    yield from gui.shot("own_channel.png")


def channel_of(name):
    """Return the own channel of a taxel in the plan; None without one."""
    return next((t.channel for t in plan().skins[0].taxels if t.taxel == name and not t.auto_channel), None)


def answers(gui, number):
    """Type a number into the field of the dialog, which is open; Return ends the field, and again the dialog."""
    yield from gui.type(number)
    yield from gui.key("RET")
    yield 0.3
    yield from gui.key("RET")
    yield from gui.redraw(3)


def disables_by_clicks(gui):
    """Two clicks disable two taxels; Ctrl-Z enables the second again; Esc ends."""
    count = plan().result.taxels
    pixels = [gui.at(position_of(name)) for name in ("wrist.3.7", "wrist.4.6")]
    yield from press(gui, "skin_calib.taxel_toggle")
    for k, place in enumerate(pixels):
        yield from gui.click(*place)
        yield from placed(gui, count - k - 1)
    yield from screenshot(gui)
    yield from gui.shot("clicked.png")
    yield from undo(gui)
    yield from placed(gui, count - 1)
    yield from gui.click(*pixels[0])
    yield from placed(gui, count)
    yield from gui.key("ESC")
    yield from gui.redraw(2)
    assert not any(op.bl_idname == "SKIN_CALIB_OT_taxel_toggle" for op in bpy.context.window.modal_operators)
    assert channel_of("2.7") == 300
