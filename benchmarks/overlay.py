"""Time to draw 10 000 taxels: our own part of each redraw, without the renderer's.

    ../shared/blender/drive-gui --install . --blend sample_scenes/wrist.blend --timeout 900 benchmarks/overlay.py

Runs in a window. Times [ms] are for one redraw while the view turns, the minimum of several, for each set of layers:
``python`` is our draw handlers without calls of the graphics library; ``handlers`` is the same with these calls, which
the processor executes on a machine without a graphics card; ``window`` is the whole redraw of Blender's window, and
``bare`` is the same without our overlay. ``kB`` is the maximum that the handlers allocate while the view is at rest.
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
    """Return a module of the extension."""
    return next(m for n, m in sys.modules.items() if n.startswith("bl_ext.") and n.endswith(f".blender.{name}"))


def drive(gui):
    """Place the taxels, measure every case, print a table."""
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
    """Print one line of the table."""
    overlay = ours("overlay.drawing")
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
    """Return the seconds of a redraw of the window after a small turn of the view."""
    region.data.view_rotation = region.data.view_rotation @ TURN
    start = perf_counter()
    bpy.ops.wm.redraw_timer(type="DRAW_WIN", iterations=1)
    return perf_counter() - start


def handles(overlay, functions):
    """Replace the functions that are called when the view is drawn."""
    while overlay._handles:
        bpy.types.SpaceView3D.draw_handler_remove(overlay._handles.pop(), "WINDOW")
    for function, when in zip(functions, ("POST_VIEW", "POST_PIXEL")):
        overlay._handles.append(bpy.types.SpaceView3D.draw_handler_add(function, (), "WINDOW", when))


def without(overlay, work):
    """Call a function while nothing of ours is drawn."""
    handles(overlay, ())
    return work()


def timed(overlay, took):
    """Record the time of each handler."""

    def clocked(function):
        def call():
            start = perf_counter()
            function()
            took.append(perf_counter() - start)

        return call

    handles(overlay, (clocked(overlay._draw), clocked(overlay._write)))


def again(overlay):
    """Restore the handlers."""
    handles(overlay, (overlay._draw, overlay._write))


def allocated(overlay, region):
    """Return the maximum of bytes allocated in one redraw of a view at rest."""
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
    """Replace all calls of the graphics library by functions that do nothing."""
    for layer in overlay.shown_layers(link):
        layer.kept, layer.batch = layer.batch, NOTHING
    quiet = {name: (lambda *_: None) for name in ("draw", "position", "color", "enable", "disable", "shadow", "size")}
    for module in (ours("overlay.labels"), ours("overlay.legend")):
        module.blf = SimpleNamespace(**quiet, dimensions=lambda _, text: (7.0 * len(text), 9.0), SHADOW=4)


def loud(overlay, link):
    """Restore the calls of the graphics library."""
    import blf

    for layer in overlay.shown_layers(link):
        layer.batch = layer.kept
    for module in (ours("overlay.labels"), ours("overlay.legend")):
        module.blf = blf


def replayed(link):
    """Print the time of a frame of a recording before it is drawn."""
    replay, results = ours("inspection.replay"), ours("scene.results")
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
