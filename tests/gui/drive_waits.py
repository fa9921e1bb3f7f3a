"""Drives long computations: the window responds while a mesh is read, checked and fitted, and Esc stops each."""

import re
import sys
from contextlib import contextmanager
from pathlib import Path
from threading import Event

import bpy
from buttons import press
from sample import link, open_steps, ours, plan, undo

SAMPLES = Path(__file__).resolve().parents[2] / "sample_scenes"


def drive(gui):
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    yield from stops_and_ends(gui, "fit", starts("fit"), lambda: plan().result.key)
    yield from stops_and_ends(gui, "diagnose", starts("diagnose"), lambda: plan().diagnosis.key)
    yield from stops_and_ends(gui, "import_wait", reads, lambda: "edge" in bpy.data.objects)
    yield from undo(gui)
    assert "edge" not in bpy.data.objects and link().name


def starts(name):
    """Return a function that presses the button of an operator."""
    return lambda gui: press(gui, f"skin_calib.{name}")


def reads(gui):
    """Choose a mesh in the file browser."""
    yield from press(gui, "skin_calib.import_mesh")
    yield from gui.choose_file(SAMPLES / "edge.ply")


def stops_and_ends(gui, name, start, is_done):
    """Esc stops an operator and leaves the scene as it was; without Esc the view can be turned until it ends."""
    with long_computations() as end:
        yield from start(gui)
        yield from gui.wait(lambda: waits_for(name), 60, f"{name} in a thread")
        yield from gui.key("ESC")
        yield from gui.wait(lambda: not waits_for(name), 30, f"{name} to stop")
        assert not is_done()
        yield from start(gui)
        yield from gui.wait(lambda: waits_for(name), 60, f"{name} in a thread")
        before = gui.area().spaces.active.region_3d.view_matrix.copy()
        with gui.context():
            bpy.ops.view3d.view_orbit(type="ORBITLEFT")
        yield from gui.redraw()
        assert gui.area().spaces.active.region_3d.view_matrix != before
        yield from gui.shot(f"{name}.png")
        assert waits_for(name) and not is_done()
        if name != "import_wait":  # which works on a file and not on the link
            assert re.fullmatch(r"[A-Z][a-z]+ing, \d+ s\. Esc stops it", state()), state()
        end.set()
        yield from gui.wait(lambda: not waits_for(name), 300, f"the end of {name}")
    assert is_done() and "Esc" not in state()


def state():
    """Return the state of the link, as the first line of the tab and the header of the view have it."""
    (status,) = (module for name, module in sys.modules.items() if name.endswith(".panels.status"))
    return status.state_of(link())[0]


@contextmanager
def long_computations():
    """Computations in threads take until the event is set."""
    work, end = ours("live.background").Work, Event()
    compute = work._run

    def after_end(*given):
        end.wait()
        compute(*given)

    work._run = after_end
    try:
        yield end
    finally:
        work._run = compute
        end.set()


def waits_for(name):
    """Return whether an operator of this name waits for a computation."""
    return any(op.bl_idname == f"SKIN_CALIB_OT_{name}" for op in bpy.context.window.modal_operators)
