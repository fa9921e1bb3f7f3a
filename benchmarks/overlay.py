"""What drawing 10 000 taxels costs: our own time for each redraw, apart from the renderer's.

    ../shared/blender/drive-gui --install . --blend sample_scenes/wrist.blend --timeout 900 benchmarks/overlay.py

Runs in a window. For each set of layers, in milliseconds for a redraw while the view turns, the best of several:
``python`` is our draw handlers with nothing handed to the graphics library; ``handlers`` the same with that, which on a
machine without a graphics card is mostly a processor that draws lines; ``window`` the whole redraw of Blender's window
and ``bare`` the same without our overlay. ``kB`` is what the handlers allocate at most while the view stands still.
"""

import sys
import tracemalloc
from time import perf_counter
from types import SimpleNamespace

import bpy
import numpy as np
from mathutils import Quaternion

ROWS, COLUMNS, PITCH = 100, 100, (0.0008, 0.0022)  # [m]
TURNS = 12
TURN = Quaternion((0, 0, 1), 0.05)
CASES = {
    "cells": ({"CELLS"}, "NONE", "NONE"),
    "cells, normals, surface": ({"CELLS", "NORMALS", "SURFACE"}, "NONE", "NONE"),
    "heat map of strain": (set(), "STRAIN", "NONE"),
    "ids": (set(), "NONE", "ID"),
    "everything": ({"SECTIONS", "LINES", "NET", "SURFACE", "CELLS", "NORMALS"}, "TILT", "CHANNEL"),
}


def ours(name):
    """A module of the extension."""
    return next(m for n, m in sys.modules.items() if n.startswith("bl_ext.") and n.endswith(f".blender.{name}"))


def drive(gui):
    """Lay the taxels, measure every case, print a table."""
    link = bpy.context.object
    plan = link.skin_calib
    for count in ((6, 20), (ROWS, COLUMNS)):
        plan.skins[0].rows, plan.skins[0].columns = count
        if count != (6, 20):
            plan.skins[0].pitch = PITCH
        bpy.ops.skin_calib.fit()
        yield from gui.redraw(2)
        print(f"\n{plan.result.taxels} taxels{'':24} python  handlers    window      bare        kB")
        for name, (layers, heat, labels) in CASES.items():
            plan.layers, plan.inspect.heat, plan.inspect.labels = layers, heat, labels
            yield from gui.redraw(2)
            yield from measure(gui, name, link)
        replayed(link)
        yield


def measure(gui, name, link):
    """One line of the table."""
    overlay = ours("overlay")
    region = next(r for r in gui.area().regions if r.type == "WINDOW")
    took = []
    with gui.context():
        bare = without(overlay, lambda: min(turned(region) for _ in range(TURNS)))
        timed(overlay, took)
        whole = min(turned(region) for _ in range(TURNS))
        handlers = min(sum(pair) for pair in zip(took[::2], took[1::2]))
        peak = allocated(overlay, region)
        took.clear()
        silent(overlay, link)
        for _ in range(TURNS):
            turned(region)
        python = min(sum(pair) for pair in zip(took[::2], took[1::2]))
        loud(overlay, link)
        again(overlay)
    print(
        f"{name:32} {1e3 * python:9.3f} {1e3 * handlers:9.3f} {1e3 * whole:9.1f} {1e3 * bare:9.1f} {peak / 1024:9.1f}"
    )
    yield from gui.redraw()


def turned(region):
    """Seconds for a redraw of the window after the view has turned a little."""
    region.data.view_rotation = region.data.view_rotation @ TURN
    start = perf_counter()
    bpy.ops.wm.redraw_timer(type="DRAW_WIN", iterations=1)
    return perf_counter() - start


def handles(overlay, functions):
    """Have other functions called when the view is drawn."""
    while overlay._handles:
        bpy.types.SpaceView3D.draw_handler_remove(overlay._handles.pop(), "WINDOW")
    for function, when in zip(functions, ("POST_VIEW", "POST_PIXEL")):
        overlay._handles.append(bpy.types.SpaceView3D.draw_handler_add(function, (), "WINDOW", when))


def without(overlay, work):
    """Do something while nothing of ours is drawn."""
    handles(overlay, ())
    return work()


def timed(overlay, took):
    """Write down how long each handler takes."""

    def clocked(function):
        def call():
            start = perf_counter()
            function()
            took.append(perf_counter() - start)

        return call

    handles(overlay, (clocked(overlay._draw), clocked(overlay._write)))


def again(overlay):
    """The handlers as they are."""
    handles(overlay, (overlay._draw, overlay._write))


def allocated(overlay, region):
    """Most bytes that are allocated in one redraw of a view that stands still."""
    tracemalloc.start()
    bpy.ops.wm.redraw_timer(type="DRAW_WIN", iterations=1)
    tracemalloc.reset_peak()
    before = tracemalloc.get_traced_memory()[0]
    bpy.ops.wm.redraw_timer(type="DRAW_WIN", iterations=1)
    peak = tracemalloc.get_traced_memory()[1] - before
    tracemalloc.stop()
    return peak


NOTHING = SimpleNamespace(draw=lambda *_: None)


def silent(overlay, link):
    """Hand nothing to the graphics library: batches that draw nothing, letters that are not set."""
    for layer in overlay.shown_layers(link):
        layer.kept, layer.batch = layer.batch, NOTHING
    quiet = {name: (lambda *_: None) for name in ("draw", "position", "color", "enable", "disable", "shadow", "size")}
    for module in (ours("labels"), ours("legend")):
        module.blf = SimpleNamespace(**quiet, dimensions=lambda _, text: (7.0 * len(text), 9.0), SHADOW=4)


def loud(overlay, link):
    """Undo that."""
    import blf

    for layer in overlay.shown_layers(link):
        layer.batch = layer.kept
    for module in (ours("labels"), ours("legend")):
        module.blf = blf


def replayed(link):
    """What a frame of a recording costs before it is drawn."""
    replay, results = ours("replay"), ours("results")
    calibration = results.find(link.skin_calib.result.key).calibration
    count = link.skin_calib.result.taxels
    pressed = np.maximum(0, 50 - np.abs(np.arange(count) - np.arange(20)[:, None] * count / 20))
    shown = replay.Replay(calibration, ((0.01 * k, row) for k, row in enumerate(pressed)), "press")
    took = []
    for k in range(len(shown)):
        start = perf_counter()
        frame = shown.frame(k)
        felt = perf_counter()
        replay._forces(shown, frame)
        replay.replay_lines(shown.taxels, frame)
        took.append((felt - start, perf_counter() - felt))
    felt, made = np.min(took, axis=0) * 1e3
    print(f"a frame of a recording: {felt:.2f} ms in the runtime, {made:.2f} ms to arrays")
