"""Drives the width of the sidebar: both tabs, with everything open and all results of Inspect, wide and narrow.

Texts that the panels draw must fit. Those of lists are cut off: below the list the selected row is in full.
"""

from pathlib import Path

import bpy
from sample import hover_view, open_steps, plan, run
from texts import Texts

ROOT = Path(__file__).resolve().parents[2]
WIDTHS = 500, 250, 170  # of the sidebar [pixel]
NAME = "jvrc1_left_shoulder_pitch"  # of a link; names of proposed skins begin with it


def drive(gui):
    yield from gui.tab("Skin")
    yield from run(gui, "fit")
    yield from gui.wait(lambda: plan().result.key, 60, "the fit")
    yield from open_steps(gui)
    yield from fills_inspect(gui)
    texts = Texts()
    for width in WIDTHS:
        here = gui.region("UI")
        edge = here.x, here.y + here.height / 2
        yield from gui.drag(edge, (here.x + here.width - width, edge[1]), mods=())
        yield from gui.redraw(3)
        assert abs(gui.region("UI").width - width) < 5
        texts.clear()
        for tab in ("Inspect", "Skin"):
            yield from gui.tab(tab)
            yield from pages(gui, f"{tab.lower()}_{width}")
        assert len(texts.drawn) > 60 and not texts.cut, texts.cut
    yield from shows_long_names(gui, texts)


def shows_long_names(gui, texts):
    """The names of several skins are there in full, opened and closed, in the narrowest sidebar."""
    plan().skins[0].name = f"{NAME}_1"
    with gui.context():
        bpy.ops.skin_calib.skin_add(kind="hexagons")
    plan().skins[1].name, plan().skins[0].opened = f"{NAME}_2", False
    texts.clear()
    yield from pages(gui, "names")
    drawn = "".join(texts.drawn)
    assert not texts.cut, texts.cut
    for skin in plan().skins:
        assert skin.name in drawn, f"{skin.name} is cut off"


def fills_inspect(gui):
    """A taxel, a disabled one, a comparison with a file and with touches, and a recording."""
    path = gui.out / "own.csv"
    with gui.context():
        bpy.ops.skin_calib.export_taxels(filepath=str(path), format="csv")
        bpy.ops.skin_calib.compare(filepath=str(path))
        bpy.ops.skin_calib.touches(filepath=str(ROOT / "examples" / "wrist_touches.csv"))
        bpy.ops.skin_calib.replay_open(filepath=str(ROOT / "examples" / "wrist_recording.csv"))
        bpy.ops.skin_calib.taxel(taxel="wrist.2.7")
    plan().inspect.auto_length = False
    yield from gui.redraw(3)


def pages(gui, name):
    """Take a screenshot of each page of the tab."""
    here, place, k = gui.region("UI"), None, 0
    yield from gui.move(here.x + here.width / 2, here.y + here.height / 2)
    yield from gui.key("HOME")
    while k < 6:
        yield from hover_view(gui)
        yield from gui.redraw(2)
        yield from gui.shot(f"{name}_{k}.png", area="VIEW_3D")
        before, place, k = place, tuple(here.view2d.region_to_view(0, 0)), k + 1
        if before == place:
            break
        yield from gui.move(here.x + here.width / 2, here.y + here.height / 2)
        yield from gui.key("PAGE_DOWN")
        yield from gui.redraw(2)
