"""Drives the window from the opened sample to an exported calibration."""

import os
import subprocess
import sys
from pathlib import Path

import bpy
from buttons import press
from mathutils import Vector
from sample import hover_view, link, open_steps, plan, red, undo

ROOT = Path(__file__).resolve().parents[2]


def drive(gui):
    yield from opens_ready_to_fit(gui)
    yield from fits_and_undoes(gui)
    yield from exports(gui)
    yield from exports_taxels(gui)


def opens_ready_to_fit(gui):
    """The view shows the link, lengths are in millimetres, the sidebar is open."""
    assert bpy.context.object == link() and plan().link == "sample_wrist"
    assert bpy.context.scene.unit_settings.length_unit == "MILLIMETERS"
    assert gui.area().spaces.active.show_region_ui
    pixels = [gui.at(link().matrix_world @ Vector(corner)) for corner in link().bound_box]  # raises where out of view
    sidebar, view = gui.region("UI"), gui.region()
    assert max(x for x, _ in pixels) < sidebar.x, "the sidebar hides the link"
    height = max(y for _, y in pixels) - min(y for _, y in pixels)
    assert height > 0.5 * min(sidebar.x - view.x, view.height), "the link is small in the view"
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    yield from gui.shot("opened.png")


def fits_and_undoes(gui):
    """The overlay appears with the fit, disappears with Ctrl-Z, and returns with Ctrl-Shift-Z."""
    empty = red(gui)
    yield from press(gui, "skin_calib.fit")
    yield from gui.wait(lambda: plan().result.key, 30, "the fit")
    yield from hover_view(gui)
    yield from gui.shot("fitted.png")
    key, drawn = plan().result.key, red(gui)
    assert plan().result.taxels == 120 and plan().result.mean < 1e-4
    assert drawn > empty + 300, f"the overlay shows {drawn - empty} red pixels"
    yield from undo(gui)
    assert not plan().result.key and red(gui) == empty
    yield from gui.shot("undone.png")
    yield from undo(gui, "shift")
    assert plan().result.key == key and red(gui) == drawn


def exports(gui):
    """The file of the window is that of the command line with the same libraries, in every byte."""
    path = gui.out / "wrist.calibration.json"
    path.unlink(missing_ok=True)
    yield from press(gui, "skin_calib.export_calibration")
    yield from gui.wait(lambda: gui.area("FILE_BROWSER"), 10, "the file browser")
    yield from gui.shot("export.png")
    params = gui.area("FILE_BROWSER").spaces.active.params
    assert params.filename == "sample_wrist.calibration.json", params.filename
    yield from gui.choose_file(path)
    yield from gui.wait(path.exists, 30, "the exported file")
    plain = gui.out / "plain.calibration.json"
    words = ["-m", "skin_calib_addon", "fit", ROOT / "sample_scenes/wrist.plan.json", "-o", plain]
    python = f"python{sys.version_info.major}.{sys.version_info.minor}"
    own = Path(sys.modules["igl"].__file__).parents[1]  # of the extension: the distribution has no libigl
    subprocess.run(
        [python, *words], cwd=ROOT, check=True, capture_output=True, env=os.environ | {"PYTHONPATH": str(own)}
    )
    assert path.read_bytes() == plain.read_bytes()


def exports_taxels(gui):
    """The file browser proposes the name of the link and the extension of the format; the selected name is written."""
    path = gui.out / "wrist.xml"
    path.unlink(missing_ok=True)
    yield from press(gui, "skin_calib.export_taxels")
    yield from gui.wait(lambda: gui.area("FILE_BROWSER"), 10, "the file browser")
    browser = gui.area("FILE_BROWSER").spaces.active
    assert browser.params.filename == "sample_wrist_taxels.csv", browser.params.filename
    yield from gui.shot("export_taxels.png", area="FILE_BROWSER")
    browser.active_operator.format = "mjcf"
    yield from gui.choose_file(path)
    yield from gui.wait(path.exists, 30, "the exported taxels")
    assert path.read_text().count("<touch ") == 120
