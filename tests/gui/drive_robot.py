"""Drives a whole robot: import, list of links, proposals of one link and of all, Esc in between.

The argument is the URDF of the robot.
"""

import bpy
from buttons import find, press
from sample import hover_view, is_in_full, undo

LINK, MIRROR = "left_knee_link", "right_knee_link"
ROW = 20  # pixels from one row of the list to the next, at a scale of one


def drive(gui):
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    yield from gui.tab("Skin")
    yield from hover_view(gui)
    yield from imports_the_robot(gui, gui.args[0])
    yield from selects_a_row(gui)
    yield from proposes_one(gui)
    yield from copies_to_the_mirror_link(gui)
    yield from keeps_a_place_free(gui)
    yield from stops_all(gui)


def active():
    """Return the active object, without a stored reference."""
    return bpy.context.view_layer.objects.active


def links():
    """Return the links, by name."""
    return {o.skin_calib.link: o for o in bpy.context.scene.objects if o.type == "MESH" and o.skin_calib.link}


def proposed():
    """Return the names of the links with a proposal."""
    return [name for name, link in links().items() if link.skin_calib.proposed]


def running():
    """Return whether an operator waits for a computation."""
    return any(op.bl_idname.startswith("SKIN_CALIB_OT_") for op in bpy.context.window.modal_operators)


def imports_the_robot(gui, urdf):
    """File > Import > Robot; the view shows all of it, and the list has its links."""
    yield from gui.search("Import Robot")
    yield from gui.wait(lambda: gui.area("FILE_BROWSER"), 10, "the file browser")
    yield from gui.choose_file(urdf)
    yield from gui.wait(lambda: "pelvis" in bpy.data.objects, 120, "the robot")
    yield from gui.redraw(3)
    yield from gui.shot("robot_imported.png", area=None)
    assert len(links()) > 30 and active().name == "pelvis"


def selects_a_row(gui):
    """A click on a row makes the link active, and the view shows it."""
    row = bpy.context.scene.objects.find(LINK)
    x, y = yield from find(gui, "skin_calib.row")
    scale = bpy.context.preferences.system.ui_scale
    for step in range(8):  # from one of the first rows on
        yield from gui.click(x - 30, y - round(step * ROW * scale))
        yield from gui.redraw(2)
        if active().name == LINK:
            break
    assert active().name == LINK and bpy.context.scene.skin_calib.row == row, active().name
    yield 1.0  # the view moves smoothly
    yield from gui.redraw(3)
    yield from gui.shot("robot_row.png", area=None)
    assert is_in_full(gui, active().name) and gui.area().spaces.active.region_3d.view_distance < 1.5


def proposes_one(gui):
    """The button Propose fills and fits the plan; the view can be turned while it works."""
    yield from press(gui, "skin_calib.propose")
    yield from gui.wait(running, 10, "the proposal in a thread")
    yield 1.0
    yield from gui.shot("robot_proposing.png", area=None)
    yield from gui.wait(lambda: not running(), 200, "the proposal")
    assert proposed() == [LINK], proposed()
    yield from undo(gui)
    assert not proposed()
    yield from undo(gui, "shift")
    assert proposed() == [LINK] and active().name == LINK
    yield from hover_view(gui)
    yield from gui.redraw(3)
    yield from gui.shot("robot_fitted.png", area=None)
    assert active().skin_calib.result.taxels == active().skin_calib.proposed


def copies_to_the_mirror_link(gui):
    """The button gives the right link the same boards, and fits them; undo and redo take both."""
    yield from press(gui, "skin_calib.copy_to_mirror")
    yield from gui.wait(lambda: not running() and links()[MIRROR].skin_calib.result.key, 120, "the copy")
    yield from gui.redraw(3)
    yield from gui.shot("robot_copied.png", area=None)
    plan, source = links()[MIRROR].skin_calib, active().skin_calib
    assert active().name == LINK and plan.result.taxels == source.result.taxels > 100
    yield from undo(gui)
    assert not links()[MIRROR].skin_calib.skins and active().skin_calib.result.key
    yield from find(gui, "skin_calib.export_calibration")
    yield from gui.shot("robot_export.png", area=None)


def keeps_a_place_free(gui):
    """The button adds a sphere at the 3D cursor; Propose waits until its file has it; undo takes it away."""
    link = active()
    bpy.context.scene.cursor.location = link.matrix_world @ link.data.vertices[0].co
    yield from press(gui, "skin_calib.keep_free")
    zone = bpy.data.objects[f"{LINK}_zone"]
    assert zone.parent == link.parent and active() == link
    yield from press(gui, "skin_calib.propose")
    yield from gui.redraw(3)
    yield from gui.shot("robot_zone.png", area=None)
    assert not running()
    yield from gui.key("ESC")  # of the pop-up with the reason
    yield from undo(gui)
    assert f"{LINK}_zone" not in bpy.data.objects and active().name == LINK


def stops_all(gui):
    """Propose All goes on with the other links; Esc keeps those that are finished, as one step of undo."""
    yield from press(gui, "skin_calib.propose_all")
    yield from gui.wait(lambda: len(proposed()) == 2, 400, "the next link")
    yield from gui.shot("robot_all.png", area=None)
    yield from hover_view(gui)
    yield from gui.key("ESC")
    yield from gui.wait(lambda: not running(), 10, "the end after Esc")
    kept = proposed()
    assert 2 <= len(kept) <= 3
    yield from gui.redraw(3)
    yield from gui.shot("robot_stopped.png", area=None)
    yield from undo(gui)
    assert proposed() == [LINK]
    yield from undo(gui, "shift")
    assert proposed() == kept
