"""Drives a taxel file into the window: selected in the file browser, refused in a wrong frame, placed by one click."""

import bpy
import numpy as np
from buttons import press
from mathutils import Vector
from sample import follow, hover_view, open_steps, ours, plan, red, run, undo

TURN, SHIFT = np.array([[0, -1, 0], [0.6, 0, -0.8], [0.8, 0, 0.6]]), np.array([0.25, -0.125, 0.5])


def drive(gui):
    path = gui.out / "worn.csv"
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    with gui.context():
        bpy.ops.view3d.view_axis(type="LEFT")
    yield from run(gui, "fit")
    yield from gui.wait(lambda: plan().result.key, 30, "the fit")
    write(path)
    yield from chooses_the_file(gui, path)
    yield from follow(gui)
    yield from finds_the_frame(gui)
    yield from goes_back(gui)


def write(path):
    """Write the taxels of the fitted sheet in another frame, as a table of another program."""
    (patch,) = ours("scene.results").find(plan().result.key).calibration.patches
    places = (patch.taxels.positions_link - SHIFT) @ TURN
    rows = [f"t{k},{x:.9f},{y:.9f},{z:.9f}" for k, (x, y, z) in enumerate(places)]
    path.write_text("\n".join(["id,x,y,z", *rows]) + "\n")


def chooses_the_file(gui, path):
    """The sheet is removed, the button opens the file browser, and the file becomes a skin with its name."""
    yield from run(gui, "skin_remove", index=0)
    yield from gui.redraw(2)
    yield from press(gui, "skin_calib.skin_import")
    yield from gui.wait(lambda: gui.area("FILE_BROWSER"), 10, "the file browser")
    assert gui.area("FILE_BROWSER").spaces.active.active_operator.format == "auto"
    yield from gui.shot("browser.png", area="FILE_BROWSER")
    yield from gui.choose_file(path)
    yield from gui.wait(lambda: len(plan().skins) == 1, 20, "the skin")
    (skin,) = plan().skins
    assert (skin.name, skin.kind) == ("worn", "imported") and skin.file.endswith("worn.csv"), skin.file
    yield from hover_view(gui)
    yield from gui.redraw(3)
    yield from gui.shot("chosen.png")


def finds_the_frame(gui):
    """After one click they are at the positions of the sheet; the result has their number."""
    yield from press(gui, "skin_calib.frame_find")
    yield from gui.wait(lambda: not plan().result.outdated and plan().result.taxels == 120, 60, "the result")
    (skin,) = plan().skins
    assert skin.framed and np.abs(np.reshape(skin.rotation, (3, 3)) - TURN).max() < 0.1
    assert (Vector(skin.translation) - Vector(SHIFT)).length < 0.02
    yield from hover_view(gui)
    yield from gui.redraw(3)
    assert red(gui) > 200, red(gui)
    yield from gui.shot("found.png")


def goes_back(gui):
    """Ctrl-Z undoes the frame, the file and the removal of the sheet, one by one."""
    for _ in range(12):
        if plan().skins and plan().skins[0].kind == "sheet":
            break
        yield from undo(gui)
    assert plan().skins[0].kind == "sheet"
    yield from gui.redraw(3)
    yield from gui.shot("back.png")
