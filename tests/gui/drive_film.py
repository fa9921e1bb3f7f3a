"""Drives the window through the film of the README: a link, its surface, a sheet that is dragged, a press on it.

Each picture of the 3D view has a number. `scripts/step_pictures.py` joins them, with words below.
"""

from itertools import count
from pathlib import Path

import bpy
from sample import follow, hover_view, open_steps, ours, plan, run

ROOT = Path(__file__).resolve().parents[2]
DRAG = [(4 * k, 7 * k) for k in range(1, 8)]  # of the sheet's handle [pixel]
PRESSES = range(4, 34, 3)  # frames of the recording


def drive(gui):
    numbers = count()

    def shot(part):
        yield from gui.redraw(2)
        yield from gui.shot(f"{next(numbers):02}_{part}.png", area="VIEW_3D")

    yield from open_steps(gui)
    space = gui.area().spaces.active
    space.show_region_ui = space.show_region_toolbar = space.show_gizmo_navigate = False
    space.overlay.show_cursor = space.overlay.show_text = False
    with gui.context():
        bpy.ops.view3d.view_axis(type="LEFT")
        bpy.ops.view3d.view_orbit(angle=0.3, type="ORBITUP")
        bpy.ops.view3d.view_orbit(angle=0.45, type="ORBITLEFT")
        bpy.ops.view3d.view_selected()
    yield from gui.redraw(3)
    plan().layers = set()
    yield from hover_view(gui)
    yield from shot("link")
    plan().layers = {"SURFACE"}
    yield from run(gui, "fit")
    yield from gui.wait(lambda: plan().result.key, 30, "the fit")
    yield from hover_view(gui)
    yield from shot("surface")
    plan().layers = {"CELLS", "NORMALS", "PLACES"}
    yield from follow(gui)
    ours("live.updates").FIT_DELAY = 60.0  # a software renderer rests between two moves
    x, y = gui.at(ours("handles.skin_handles").basis_of(bpy.context, ("origin", 0, 0)).translation)
    yield from shot("drag")
    yield from gui.drag((x, y), (x + DRAG[0][0], y + DRAG[0][1]), mods=(), release=False)
    for dx, dy in DRAG[1:]:
        yield from gui.move(x + dx, y + dy)
        yield 0.3
        yield from shot("drag")
    yield from gui.release()
    ours("live.updates").FIT_DELAY = 0.4
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the result after the drag")
    assert not plan().skins[0].centred
    plan().layers = {"CELLS"}
    for _ in range(6):
        with gui.context():
            bpy.ops.view3d.view_orbit(angle=0.53, type="ORBITRIGHT")
        yield from shot("drag")
    with gui.context():
        bpy.ops.skin_calib.replay_open(filepath=str(ROOT / "examples" / "wrist_recording.csv"))
    assert plan().inspect.heat == "FORCE"
    for frame in PRESSES:
        plan().inspect.replay.progress = 100 * frame / 59
        yield from hover_view(gui)
        yield from shot("press")
