"""Drives the window as a new user would: from Blender's start, the zip and a mesh file to an exported calibration.

The argument is the zip. The pictures are those of docs/tutorial/blender.md. It counts the clicks, and the seconds from
the zip to the calibration, which contain the search for buttons.
"""

import json
from pathlib import Path
from time import perf_counter

import bpy
from buttons import open_line, open_tab, press
from sample import hover_view, ours, pink

ROOT = Path(__file__).resolve().parents[2]
MODULE = "bl_ext.user_default.skin_calib"
PAGE = ROOT / "docs" / "tutorial" / "blender.md"
MAX_CLICKS = 25


def drive(gui):
    gui.clicks, start = [], perf_counter()
    count_clicks(gui)
    yield from installs(gui, *gui.args)
    yield from imports(gui)
    yield from fits(gui)
    yield from adds_a_sheet(gui)
    yield from moves_it(gui)
    yield from looks_at_the_error(gui)
    yield from exports(gui)
    number = len(gui.clicks)
    print(f"{number} clicks, {perf_counter() - start:.0f} s from the zip to the exported calibration: {gui.clicks}")
    assert number <= MAX_CLICKS
    assert f"{number} clicks" in PAGE.read_text(encoding="utf-8"), f"the page does not state {number} clicks"


def count_clicks(gui):
    """Note each click and drag; a file that is chosen is one, and the button of its browser another."""

    def counted(act):
        def perform(*words, **options):
            gui.clicks.append(act.__name__)
            yield from act(*words, **options)

        return perform

    for name in ("click", "drag", "choose_file"):
        setattr(gui, name, counted(getattr(gui, name)))


def one_click(gui, what, act):
    """Perform what a user does by one click, and the driver by none, or by trying out places."""
    gui.clicks.append(what)
    yield from act


def plan():
    """Return the plan of the imported link."""
    return bpy.context.view_layer.objects.active.skin_calib


def installs(gui, archive):
    """The zip, which a user drops into the view, and the dialogue; N and a click show the tab."""
    gui.clicks += ["drop of the zip", "dialogue"]
    with gui.context():
        bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)
    yield from gui.wait(lambda: MODULE in bpy.context.preferences.addons, 30, "the extension")
    yield from hover_view(gui)
    yield from one_click(gui, "tab", open_tab(gui, "Skin"))


def imports(gui):
    """A mesh file becomes a link with the name of the file."""
    yield from press(gui, "skin_calib.import_mesh")
    yield from gui.choose_file(ROOT / "sample_scenes" / "wrist.ply")
    yield from gui.wait(lambda: "wrist" in bpy.data.objects, 20, "the link")
    yield from gui.redraw(2)
    assert plan().link == "wrist"
    yield from press(gui, "skin_calib.diagnose")
    yield from gui.shot("1_link.png", area="VIEW_3D")


def fits(gui):
    """One button, with the default values."""
    yield from press(gui, "skin_calib.fit")
    yield from gui.wait(lambda: plan().result.key, 30, "the fit")
    assert plan().result.mean < 5e-5
    yield from press(gui, "skin_calib.live")
    steps = plan().steps
    assert steps.skin and not (steps.link or steps.mesh or steps.grid or steps.fit)  # the next step is open
    yield from hover_view(gui)
    yield from gui.shot("2_fit.png", area="VIEW_3D")


def adds_a_sheet(gui):
    """It is placed in the middle; its columns are typed."""
    yield from press(gui, "skin_calib.skin_add(kind='sheet'")
    for name, value in (("columns", "12"), ("rows", "5")):
        yield from press(gui, f"skin_calib.skins[0].{name}")
        yield from gui.key("A", "ctrl")
        yield from gui.type(value)
        yield from gui.key("RET")
    yield from gui.wait(lambda: plan().result.taxels == 60 and not plan().result.outdated, 30, "the sheet")
    yield from gui.shot("3_sheet.png", area="VIEW_3D")


def moves_it(gui):
    """Its handle moves it over the link."""
    x, y = gui.at(ours("handles.skin_handles").basis_of(bpy.context, ("origin", 0, 0)).translation)
    yield from gui.drag((x, y), (x + 40, y + 40), mods=())
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the sheet elsewhere")
    assert not plan().skins[0].centred
    yield from gui.shot("4_moved.png", area="VIEW_3D")


def looks_at_the_error(gui):
    """A heat map and its legend; in the tab Skin, the mark of the maximum deviation."""
    yield from one_click(gui, "tab", open_tab(gui, "Inspect"))
    yield from press(gui, "skin_calib.inspect.heat")
    yield 0.5
    yield from one_click(gui, "entry of a menu", gui.key("E"))  # Error
    yield from gui.redraw(2)
    assert plan().inspect.heat == "ERROR"
    yield from hover_view(gui)
    yield from gui.redraw(2)
    yield from gui.shot("5_error.png", area="VIEW_3D")
    r, g, b = gui.pixels("VIEW_3D")[-150:, :300].astype(int).transpose(2, 0, 1)
    assert ((r > 220) & (g > 200) & (b < 90)).sum() > 50, "the end of the colour bar is not in the corner of the view"
    yield from one_click(gui, "tab", open_tab(gui, "Skin"))
    yield from one_click(gui, "line of a step", open_line(gui, lambda: plan().steps, "fit"))
    yield from press(gui, "skin_calib.show_worst")
    yield from hover_view(gui)
    yield from gui.redraw(2)
    assert pink(gui) > 50, "the maximum deviation is not marked"


def exports(gui):
    """The file that a controller loads."""
    path = gui.out / "wrist.calibration.json"
    path.unlink(missing_ok=True)
    yield from press(gui, "skin_calib.export_calibration")
    yield from gui.choose_file(path)
    yield from gui.wait(path.exists, 30, "the exported file")
    yield from gui.shot("6_exported.png", area="VIEW_3D")
    assert len(json.loads(path.read_text())["patches"][0]["taxels"]["id"]) == 60
