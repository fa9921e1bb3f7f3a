"""Drives the window as a new user would: from an empty scene and a mesh file to an exported calibration.

Its pictures are those of docs/tutorial/blender.md.
"""

import json
from pathlib import Path

import bpy
from buttons import find, press
from mathutils import Vector
from sample import hover_view, ours

ROOT = Path(__file__).resolve().parents[2]


def drive(gui):
    yield from gui.tab("Skin")
    with gui.context():  # the cube of Blender's start
        bpy.ops.object.select_all(action="SELECT")
        bpy.ops.object.delete()
    bpy.context.scene.unit_settings.length_unit = "MILLIMETERS"
    yield from imports(gui)
    yield from fits(gui)
    yield from adds_a_sheet(gui)
    yield from moves_it(gui)
    yield from looks_at_the_error(gui)
    yield from exports(gui)


def plan():
    """Return the plan of the imported link."""
    return bpy.context.view_layer.objects.active.skin_calib


def imports(gui):
    """A mesh file becomes a link with the name of the file."""
    yield from press(gui, "skin_calib.import_mesh")
    yield from gui.choose_file(ROOT / "sample_scenes" / "wrist.ply")
    yield from gui.wait(lambda: bpy.context.object, 20, "the link")
    with gui.context():
        bpy.ops.view3d.view_selected()
    view = gui.area().spaces.active.region_3d
    view.view_distance *= 1.25
    view.view_location += view.view_rotation @ Vector((0.12 * view.view_distance, 0, 0))  # clear of the side bar
    assert plan().link == "wrist"
    yield from press(gui, "skin_calib.diagnose")
    yield from gui.shot("1_link.png", area="VIEW_3D")


def fits(gui):
    """One button, with the default values."""
    yield from press(gui, "skin_calib.fit")
    yield from gui.wait(lambda: plan().result.key, 30, "the fit")
    assert plan().result.mean < 5e-5
    yield from press(gui, "skin_calib.live")
    yield from find(gui, "skin_calib.show_worst")  # scrolls to the errors
    yield from hover_view(gui)
    yield from gui.shot("2_fit.png", area="VIEW_3D")


def adds_a_sheet(gui):
    """It is placed in the middle; its columns are typed."""
    yield from press(gui, "skin_calib.skin_add(kind='sheet'")
    for name, value in (("columns", "12"), ("rows", "5")):
        yield from find(gui, f"skin_calib.skins[0].{name}")
        yield from gui.key("RET")
        yield from gui.key("A", "ctrl")
        yield from gui.type(value)
        yield from gui.key("RET")
    yield from gui.wait(lambda: plan().result.taxels == 60 and not plan().result.outdated, 30, "the sheet")
    yield from gui.shot("3_sheet.png", area="VIEW_3D")


def moves_it(gui):
    """Its handle moves it over the link."""
    x, y = gui.at(ours("handles.skin_handles").basis_of(bpy.context, ("origin", 0, 0)).translation)
    yield from gui.drag((x, y), (x + 40, y + 60), mods=())
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the sheet elsewhere")
    assert not plan().skins[0].centred
    yield from gui.shot("4_moved.png", area="VIEW_3D")


def looks_at_the_error(gui):
    """A heat map and its legend."""
    plan().inspect.heat = "ERROR"
    yield from find(gui, "skin_calib.taxel")  # scrolls to the panel Inspect
    yield from hover_view(gui)
    yield from gui.redraw(2)
    yield from gui.shot("5_error.png", area="VIEW_3D")
    r, g, b = gui.pixels("VIEW_3D")[-150:, :300].astype(int).transpose(2, 0, 1)
    assert ((r > 220) & (g > 200) & (b < 90)).sum() > 50, "the end of the colour bar is not in the corner of the view"


def exports(gui):
    """The file that a controller loads."""
    path = gui.out / "wrist.calibration.json"
    path.unlink(missing_ok=True)
    yield from press(gui, "skin_calib.export_calibration")
    yield from gui.choose_file(path)
    yield from gui.wait(path.exists, 30, "the exported file")
    yield from gui.shot("6_exported.png", area="VIEW_3D")
    assert len(json.loads(path.read_text())["patches"][0]["taxels"]["id"]) == 60
