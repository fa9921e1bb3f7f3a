"""Drives the cover: cuts by click, in a list, flipped; faces that are removed in Edit Mode and restored."""

import bpy
from buttons import find, press
from mathutils import Vector
from sample import hover_view, link, open_steps, plan, run, undo

# The button that flips a cut is too narrow to be found: so many pixels left of the one that removes it.
FLIP = 20


def drive(gui):
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    yield from hover_view(gui)
    bpy.context.preferences.view.smooth_view = 0  # the view is there at once
    with gui.context():
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_selected()
    view = gui.area().spaces.active.region_3d
    view.view_distance *= 1.2
    view.view_location.x += 0.25 * view.view_distance  # clear of the side bar
    yield from gui.redraw()
    yield from cuts_by_click(gui)
    yield from lists_five(gui)
    yield from cuts_a_selection_away(gui)


def place(gui):
    """Press the narrow button at the end of Add Cut."""
    _, y = yield from find(gui, "skin_calib.cut_add")
    yield from gui.click(gui.region("UI").x + gui.region("UI").width - 45, y)
    yield from gui.redraw()


def cuts_by_click(gui):
    """A click on the link adds a cut there and keeps the larger part; Esc and a click next to it add none."""
    x, y = gui.at(Vector((0, -0.03, 0.08)))
    yield from place(gui)
    yield from gui.move(x, y)
    yield from gui.key("ESC")
    assert not plan().cover.cuts
    yield from place(gui)
    yield from gui.click(gui.region().x + 120, gui.region().y + 60)
    assert not plan().cover.cuts
    yield from gui.click(x, y)
    yield from gui.wait(lambda: len(plan().cover.cuts) == 1, 10, "the cut")
    cut = plan().cover.cuts[0]
    assert abs(cut.point[2] - 0.08) < 0.002 and tuple(cut.normal) == (0, 0, -1), (cut.point[:], cut.normal[:])
    yield 1.0
    yield from gui.redraw()
    yield from gui.shot("cut.png")
    yield from undo(gui)
    assert not plan().cover.cuts
    yield from undo(gui, "shift")
    assert len(plan().cover.cuts) == 1


def lists_five(gui):
    """Five cuts are readable; the numbers are those of the selected row."""
    yield from press(gui, "skin_calib.cut_add")
    for k in range(1, 4):
        bpy.context.scene.cursor.location = (0, 0, 0.005 + 0.005 * k)
        with gui.context():
            bpy.ops.skin_calib.cut_add()
    assert len(plan().cover.cuts) == 5 and plan().cover.cut_index == 4
    plan().cover.cuts[2].normal = (0.3, 0, 1)
    x, y = yield from find(gui, "skin_calib.cut_remove(index=1")
    yield from gui.click(x - 4 * FLIP, y)
    yield from gui.redraw()
    assert plan().cover.cut_index == 1, plan().cover.cut_index
    yield 1.0
    yield from gui.redraw()
    yield from gui.shot("five_cuts.png")
    while len(plan().cover.cuts) > 1:
        with gui.context():
            bpy.ops.skin_calib.cut_remove(index=0)
    yield from press(gui, "skin_calib.cut_remove")
    assert not plan().cover.cuts
    yield from undo(gui)
    assert plan().cover.cuts
    yield from undo(gui, "shift")
    assert not plan().cover.cuts


def cuts_a_selection_away(gui):
    """Faces are selected with a box, removed, and fitted without; each step is undone; at the end they are restored."""
    x, y = gui.at(Vector((0, -0.03, 0.05)))
    yield from hover_view(gui)
    yield from gui.key("TAB")
    yield from gui.wait(lambda: bpy.context.mode == "EDIT_MESH", 10, "Edit Mode")
    yield from gui.key("THREE")
    yield from gui.key("A", "alt")
    yield from gui.redraw()
    yield from gui.drag((x - 60, y - 60), (x + 60, y + 60), mods=())
    yield from gui.redraw()
    chosen = link().data.total_face_sel
    assert chosen > 20, chosen
    yield from gui.shot("chosen.png")
    yield from press(gui, "skin_calib.cut_away")
    yield from gui.wait(lambda: bpy.context.mode == "OBJECT", 10, "Object Mode")
    yield 1.0
    yield from hover_view(gui)
    yield from gui.redraw()
    yield from gui.shot("cut_away.png")
    assert faces() == len(link().data.polygons) - chosen
    yield from undo(gui)
    assert bpy.context.mode == "EDIT_MESH" and link().data.total_face_sel == chosen and not link().modifiers
    yield from gui.shot("cut_away_undone.png")
    yield from undo(gui, "shift")
    assert bpy.context.mode == "OBJECT" and faces() == len(link().data.polygons) - chosen
    yield from run(gui, "fit")
    yield from gui.wait(lambda: plan().result.key, 60, "the fit")
    key = plan().result.key
    yield from hover_view(gui)
    yield from gui.shot("fitted.png")
    yield from press(gui, "skin_calib.bring_back")
    yield from gui.redraw()
    assert faces() == len(link().data.polygons) and plan().result.outdated
    yield from undo(gui)
    assert faces() == len(link().data.polygons) - chosen and plan().result.key == key
    for _ in range(2):  # the fit, the cut
        yield from undo(gui)
    assert not link().modifiers and not bpy.data.node_groups


def faces():
    """Return the number of faces of the link in Blender."""
    evaluated = link().evaluated_get(bpy.context.evaluated_depsgraph_get())
    return len(evaluated.data.polygons)
