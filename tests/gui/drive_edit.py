"""Drives edits of the plan: refused ones, lists, typed numbers, a moved frame."""

import bpy
from buttons import find, press
from sample import hover_view, link, open_steps, plan, red, run, undo


def drive(gui):
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    yield from hover_view(gui)
    yield from gui.redraw()
    bare = red(gui)
    yield from run(gui, "fit")
    yield from gui.wait(lambda: plan().result.key, 30, "the fit")
    yield from hides_the_overlay(gui, bare)
    yield from says_what_is_wrong(gui)
    yield from edits_lists(gui)
    yield from types_a_number(gui)
    yield from follows_the_parent(gui, bare)


def hides_the_overlay(gui, bare):
    """The switch of the overlay works, and Ctrl-Z switches it back."""
    yield from hover_view(gui)
    yield from gui.redraw()
    drawn = red(gui)
    plan().show_overlay = False
    bpy.ops.ed.undo_push(message="Overlay")
    yield from hover_view(gui)
    yield from gui.redraw()
    assert abs(red(gui) - bare) < 0.1 * (drawn - bare), (bare, drawn, red(gui))
    yield from undo(gui)
    assert red(gui) == drawn


def says_what_is_wrong(gui):
    """An impossible plan is refused with a message; the last result stays."""
    key = plan().result.key
    plan().grid.n = 2
    yield from press(gui, "skin_calib.fit")
    yield from gui.redraw()
    yield from gui.shot("refused.png")
    assert plan().result.key == key and plan().result.outdated
    yield from gui.key("ESC")  # the message is a pop-up
    plan().grid.n = 10


def edits_lists(gui):
    """Sheets and cuts are added and removed, each in one undo step."""
    yield from press(gui, "skin_calib.skin_add(kind='sheet'")
    assert [s.name for s in plan().skins] == ["wrist", "skin"] and plan().skins[1].auto_channel
    yield from press(gui, "skin_calib.cut_add")
    assert len(plan().cover.cuts) == 1
    yield from gui.shot("lists.png")
    yield from press(gui, "skin_calib.cut_remove")
    assert len(plan().cover.cuts) == 0
    yield from press(gui, "skin_calib.skin_remove(index=1")
    assert [s.name for s in plan().skins] == ["wrist"]
    yield from undo(gui)
    assert len(plan().skins) == 2
    yield from undo(gui)
    assert len(plan().cover.cuts) == 1
    yield from undo(gui, "shift")
    yield from undo(gui, "shift")
    assert (len(plan().skins), len(plan().cover.cuts)) == (1, 0)


def types_a_number(gui):
    """A typed number makes the result outdated; a second fit updates it."""
    yield from find(gui, "skin_calib.grid.n")
    yield from gui.key("RET")
    yield from gui.key("A", "ctrl")
    yield from gui.type("12")
    yield from gui.key("RET")
    yield from gui.redraw()
    assert plan().grid.n == 12 and plan().result.outdated
    yield from run(gui, "fit")
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the second fit")
    assert plan().result.control_points == 240
    yield from undo(gui)
    yield from undo(gui)
    assert plan().grid.n == 10


def follows_the_parent(gui, bare):
    """The parent of a link is moved and turned: the overlay follows, the calibration does not change."""
    yield from run(gui, "fit")
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the fit")
    yield from hover_view(gui)
    yield from gui.redraw()
    key, drawn = plan().result.key, red(gui)
    frame = bpy.data.objects.new("frame", None)
    bpy.context.scene.collection.objects.link(frame)
    link().parent = frame
    frame.location, frame.rotation_euler = (0.01, 0.01, -0.01), (0.3, 0.2, 0.5)
    yield from gui.redraw(3)
    yield from gui.shot("moved.png")
    assert red(gui) - bare > 0.5 * (drawn - bare)
    plan().result.outdated = True
    yield from run(gui, "fit")
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the fit of the moved link")
    assert plan().result.key == key
