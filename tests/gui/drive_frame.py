"""Drives an import whose object is then moved: the drawing goes along, state and file say so, Ctrl-Z ends it."""

import json
from pathlib import Path

import bpy
from buttons import press
from sample import hover_view, red, run, undo

SAMPLES = Path(__file__).resolve().parents[2] / "sample_scenes"
WORDS = "wrist is moved by 60 mm from wrist_frame, its link frame. Its taxels do not move with it."


def drive(gui):
    yield from gui.tab("Skin")
    yield from press(gui, "skin_calib.import_mesh")
    yield from gui.choose_file(SAMPLES / "wrist.ply")
    yield from gui.wait(lambda: "wrist" in bpy.data.objects, 20, "the link")
    yield from run(gui, "skin_add", kind="sheet")
    yield from press(gui, "skin_calib.fit")
    yield from gui.wait(lambda: plan().result.taxels, 30, "the fit")
    before = yield from exported(gui, "before")
    yield from gui.shot("before.png", area=None)
    drawn = red(gui)
    yield from hover_view(gui)
    for key in ("G", "X"):
        yield from gui.key(key)
    yield from gui.type("0.06")
    yield from gui.key("RET")
    yield from gui.redraw(3)
    assert bpy.data.objects["wrist"].location.x > 0.05 and not plan().result.outdated
    yield from gui.shot("moved.png", area=None)
    assert red(gui) > 0.5 * drawn > 50, "the normals are not drawn at the object"
    after = yield from exported(gui, "moved")
    assert after["patches"] == before["patches"]
    assert [w["message"] for w in after["warnings"] if w["code"] == "moved-object"] == [WORDS]
    yield from undo(gui)
    assert bpy.data.objects["wrist"].location.x == 0 and plan().result.taxels
    yield from gui.shot("undone.png", area=None)
    assert (yield from exported(gui, "undone")) == before


def plan():
    """Return the plan of the imported link."""
    return bpy.data.objects["wrist"].skin_calib


def exported(gui, name):
    """Export the calibration, and return it."""
    path = gui.out / f"{name}.calibration.json"
    with gui.context():
        bpy.ops.skin_calib.export_calibration(filepath=str(path))
    yield from gui.redraw(2)
    return json.loads(path.read_text())
