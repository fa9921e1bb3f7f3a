"""Drives skins by their handles: the origin of a sheet moves over the link, its direction turns; boards are painted."""

import bpy
from mathutils import Vector
from sample import follow, open_steps, ours, plan, run, state, undo


def basis(what, skin=0, index=0):
    """Return the transform of a handle in the world."""
    return ours("handles.skin_handles").basis_of(bpy.context, (what, skin, index))


def drive(gui):
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    with gui.context():
        bpy.ops.view3d.view_axis(type="LEFT")
    yield from gui.redraw(3)
    yield from run(gui, "fit")
    yield from gui.wait(lambda: plan().result.key, 30, "the fit")
    yield from follow(gui)
    yield from gui.redraw(3)
    yield from gui.shot("handles.png")
    yield from slides_the_origin(gui)
    yield from turns_the_direction(gui)
    yield from cancels_with_escape(gui)


def skin():
    """Return the sheet of the sample."""
    return plan().skins[0]


def slides_the_origin(gui):
    """The box follows the mouse over the link, the sheet follows the box; Ctrl-Z restores both."""
    start = gui.at(basis("origin").translation)
    goal = start[0] - 40, start[1] + 15
    ours("live.updates").FIT_DELAY = 60.0  # a software renderer rests between two moves
    yield from gui.drag(start, goal, mods=(), release=False)
    yield from gui.wait(lambda: state().layers, 20, "a preview under the drag")
    yield from gui.redraw(3)
    yield from gui.shot("slid.png")
    yield from gui.release()
    ours("live.updates").FIT_DELAY = 0.4
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the result after the rest")
    yield from gui.redraw(3)
    x, y = gui.at(basis("origin").translation)
    assert abs(x - goal[0]) < 4 and abs(y - goal[1]) < 4, ((x, y), goal)
    assert not skin().centred and skin().origin.length > 0
    yield from undo(gui)
    assert skin().centred
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the result after undo")
    yield from undo(gui, "shift")
    assert not skin().centred
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the result after redo")


def turns_the_direction(gui):
    """The tip of the arrow follows the mouse."""
    was = Vector(skin().direction)
    skin().trim = True  # turned, it runs off the link
    yield from gui.redraw(3)
    x, y = ahead(gui, 0.8)
    goal = x, y + 10
    yield from gui.drag((x, y), goal, mods=())
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the result after the turn")
    yield from gui.redraw(3)
    yield from gui.shot("turned.png")
    assert was.angle(skin().direction) > 0.05
    yield from undo(gui)
    assert (Vector(skin().direction) - was).length == 0
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the result after undo")


def ahead(gui, fraction):
    """Return the pixel of the window on the arrow, at a fraction of its length of 75 pixels."""
    place = basis("direction")
    foot, tip = Vector(gui.at(place.translation)), Vector(gui.at(place.translation + 0.001 * place.to_3x3().col[2]))
    scale = bpy.context.preferences.view.gizmo_size * bpy.context.preferences.system.ui_scale
    return tuple(foot + fraction * scale * (tip - foot).normalized())


def cancels_with_escape(gui):
    """Esc during a drag restores the origin."""
    was = tuple(skin().origin)
    start = gui.at(basis("origin").translation)
    yield from gui.drag(start, (start[0] - 20, start[1] + 8), mods=(), release=False)
    yield from gui.redraw(2)
    assert tuple(skin().origin) != was
    yield from gui.key("ESC")
    yield from gui.release()
    yield from gui.redraw(2)
    assert tuple(skin().origin) == was
