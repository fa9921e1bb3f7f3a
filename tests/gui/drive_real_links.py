"""Drives the tutorial of real links, from Blender's start: a limb with a cut, a sole with boards, or a robot.

The arguments are the part (``limb``, ``sole`` or ``robot``) and its file. The pictures are those of
docs/tutorial/real_links.md.
"""

import json
import os
import re
from pathlib import Path

import bpy
from buttons import find, open_line, open_tab, press
from drive_robot import active, links, proposed, running, selects_a_row
from mathutils import Vector
from sample import hover_view, ours

PAGE = Path(__file__).resolve().parents[2] / "docs" / "tutorial" / "real_links.md"


def drive(gui):
    part, path = gui.args
    yield from hover_view(gui)
    yield from open_tab(gui, "Skin")
    yield from {"limb": limb, "sole": sole, "robot": robot}[part](gui, path)


def states(words):
    """Check that the page has these words, whose numbers are those of the window."""
    assert words in " ".join(PAGE.read_text(encoding="utf-8").split()), f"the page does not state: {words}"


def plan():
    """Return the plan of the active link."""
    return active().skin_calib


def opens(gui, path):
    """The button Mesh opens the file; the link is active and has the name of the file."""
    yield from press(gui, "skin_calib.import_mesh")
    yield from gui.choose_file(path)
    yield from gui.wait(lambda: active() and active().skin_calib.mesh_file, 60, "the link")
    yield 1.0
    yield from gui.redraw(3)


def fits(gui, step):
    """The button Fit; its errors are as small as the page states."""
    yield from press(gui, "skin_calib.fit")
    yield from gui.wait(lambda: plan().result.key and not plan().result.outdated and not running(), 120, "the fit")
    yield from hover_view(gui)
    yield from gui.redraw(3)


def types(gui, name, value):
    """Type a value into a field of the sidebar."""
    yield from find(gui, name)
    yield from gui.key("RET")
    yield from gui.key("A", "ctrl")
    yield from gui.type(value)
    yield from gui.key("RET")
    yield from gui.redraw(2)


def fitted(gui, taxels):
    """Wait for the complete result of Live, or of the last click, with this number of taxels."""
    done = lambda: plan().result.taxels == taxels and not plan().result.outdated  # noqa: E731
    yield from gui.wait(done, 120, f"{taxels} taxels")
    yield from hover_view(gui)
    yield from gui.redraw(3)


def limb(gui, path):
    """Check Mesh, a cut by a click near the end, Fit, a sheet of 5 by 20 taxels."""
    yield from opens(gui, path)
    yield from press(gui, "skin_calib.diagnose")
    yield from gui.redraw(3)
    found = " ".join(finding.message for finding in plan().diagnosis.findings)
    assert "These settings fit" in found, found
    states(re.search(r"\d+ edges with more than two faces", found)[0])
    parts, hidden = re.search(r"(\d+) connected parts, (\d+) of them mostly within", found).groups()
    states(f"{parts} parts, of which {hidden} are mostly within")
    yield from gui.shot("1_limb.png", area="VIEW_3D")
    yield from open_line(gui, lambda: plan().steps, "cut")
    yield from press(gui, "skin_calib.cut_place")
    box = [Vector(corner) for corner in active().bound_box]
    low, high = min(c.z for c in box), max(c.z for c in box)
    near_end = active().matrix_world @ (sum(box, Vector()) / 8 + Vector((0, 0, -0.38 * (high - low))))
    yield from gui.click(*gui.at(near_end))  # which is behind a point of the wall farther up
    yield from gui.redraw(3)
    (cut,) = plan().cover.cuts
    assert cut.normal[2] > 0.9  # the longer part stays
    yield from hover_view(gui)
    yield from gui.shot("2_cut.png", area="VIEW_3D")
    yield from fits(gui, "fit")
    assert plan().result.mean < 1.2e-4, plan().result.mean
    yield from press(gui, "skin_calib.live")
    yield from press(gui, "skin_calib.skin_add(kind='sheet'")
    yield from types(gui, "skin_calib.skins[0].columns", "20")
    yield from types(gui, "skin_calib.skins[0].rows", "5")
    yield from fitted(gui, 100)
    assert not plan().result.warnings, [warning.message for warning in plan().result.warnings]
    gaps = ours("scene.results").find(plan().result.key).placed[0].closure.gaps * 1e3
    states(f"{200 + gaps.min():.0f} mm to {200 + gaps.max():.0f} mm long")
    yield from gui.shot("3_sheet.png", area="VIEW_3D")
    yield from exports(gui, 100)


def exports(gui, taxels):
    """The button Calibration writes the file."""
    path = gui.out / "link.calibration.json"
    path.unlink(missing_ok=True)
    yield from press(gui, "skin_calib.export_calibration")
    yield from gui.choose_file(path)
    yield from gui.wait(path.exists, 60, "the exported file")
    assert len(json.loads(path.read_text())["patches"][0]["taxels"]["id"]) == taxels


def sole(gui, path):
    """Kind Across, Fit, boards of 8 mm; one is removed by a click, another one disabled."""
    yield from opens(gui, path)
    yield from open_line(gui, lambda: plan().steps, "grid")
    yield from press(gui, "skin_calib.grid.kind")
    yield 0.5
    yield from gui.key("C")  # Across
    yield from gui.redraw(2)
    assert plan().grid.kind == "across", plan().grid.kind
    yield from fits(gui, "fit")
    assert plan().result.mean < 3e-4, plan().result.mean
    missed = re.search(r"([\d.]+)% of the sample rays", " ".join(w.message for w in plan().result.warnings))[1]
    states(f"{float(missed):.0f} % of the rays miss the mesh")
    yield from press(gui, "skin_calib.skin_add(kind='hexagons'")
    yield from fits(gui, "skin")
    count = plan().result.taxels
    states(f"{count} boards with sides of 8 mm")
    yield from hover_view(gui)
    yield from gui.key("NUMPAD_7", "ctrl")  # from below
    yield 1.0
    yield from gui.redraw(3)
    yield from gui.shot("4_boards.png", area="VIEW_3D")
    yield from press(gui, "skin_calib.boards_paint")
    taxels = ours("overlay.drawing").patches_of(active())[0].taxels
    metre = ours("scene.units").metres_per_unit(bpy.context.scene)
    outer = int(taxels.positions_link[:, 0].argmax())
    yield from gui.click(*gui.at(active().matrix_world @ (Vector(taxels.positions_link[outer]) / metre)))
    yield from fitted(gui, count - 1)
    yield from gui.key("ESC")
    yield from gui.redraw(3)
    yield from gui.shot("5_painted.png", area="VIEW_3D")
    yield from exports(gui, count - 1)


def robot(gui, path):
    """The button Robot, a row of the list, Propose, a changed plan, Fit All, Export Robot."""
    yield from press(gui, "skin_calib.import_robot")
    yield from gui.choose_file(path)
    yield from gui.wait(lambda: len(links()) > 30, 120, "the robot")
    yield from gui.redraw(3)
    yield from selects_a_row(gui)
    yield from press(gui, "skin_calib.propose")
    yield from gui.wait(lambda: proposed() == [active().name] and not running(), 400, "the proposal")
    assert plan().result.taxels == plan().proposed > 10
    yield from gui.redraw(3)
    yield from gui.shot("6_robot.png", area="VIEW_3D")
    last = len(plan().skins) - 1
    yield from press(gui, f"skin_calib.skin_remove(index={last}")
    assert plan().result.outdated and len(plan().skins) == last
    yield from press(gui, "skin_calib.fit_all")
    yield from gui.wait(lambda: not plan().result.outdated and not running(), 180, "Fit All")
    assert 0 < plan().result.taxels < plan().proposed
    folder = gui.out / "robot"
    folder.mkdir(exist_ok=True)
    (folder / "robot.json").unlink(missing_ok=True)
    yield from press(gui, "skin_calib.export_robot")
    yield from gui.wait(lambda: gui.area("FILE_BROWSER"), 10, "the file browser")
    yield from gui.redraw()
    gui.area("FILE_BROWSER").spaces.active.params.directory = os.fsencode(f"{folder}/")
    yield from gui.redraw()
    yield from gui.press("file.execute", "FILE_BROWSER", "EXECUTE")
    yield from gui.wait((folder / "robot.json").exists, 60, "the folder of the robot")
    assert json.loads((folder / "robot.json").read_text())["links"][0]["link"] == active().name
