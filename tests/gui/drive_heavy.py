"""Drives a fit of a mesh of a million facets: the window responds, Esc stops the fit, and without Esc it ends."""

import bpy
from buttons import press
from sample import link, plan


def drive(gui):
    yield from gui.tab("Skin")
    link().modifiers.new("finer", "SUBSURF").levels = 3
    yield from gui.redraw(2)
    yield from press(gui, "skin_calib.fit")
    yield from gui.wait(running, 30, "a fit in a thread")
    yield from gui.key("ESC")
    yield from gui.wait(lambda: not running(), 10, "the fit to stop")
    assert not plan().result.key
    yield from press(gui, "skin_calib.fit")
    yield from gui.wait(running, 30, "a fit in a thread")
    with gui.context():
        bpy.ops.view3d.view_orbit(type="ORBITLEFT")  # the window still answers
    yield from gui.redraw()
    yield from gui.shot("running.png")
    assert running()
    yield from gui.wait(lambda: plan().result.key, 120, "the fit")
    assert plan().result.max < 2e-4
    yield from gui.shot("fitted.png")


def running():
    """Return whether a fit is running in a thread."""
    return any(op.bl_idname == "SKIN_CALIB_OT_fit" for op in bpy.context.window.modal_operators)
