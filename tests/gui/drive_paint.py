"""Drives boards on the sample sole by clicks: one is removed, one added, the lattice moves; Ctrl-Z undoes all of it."""

import bpy
from buttons import press
from mathutils import Vector
from sample import follow, hover_view, link, open_steps, ours, plan, run, undo


def drive(gui):
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    yield from run(gui, "skin_remove", index=0)
    yield from run(gui, "skin_add", kind="hexagons")
    yield from run(gui, "fit")
    yield from gui.wait(lambda: plan().result.key, 60, "the fit")
    with gui.context():
        bpy.ops.view3d.view_axis(type="BOTTOM")
    gui.area().spaces.active.region_3d.view_location += Vector((0.05, 0, 0))  # clear of the side bar
    yield from gui.redraw(3)
    yield from paints(gui)
    yield from slides(gui)


def boards():
    """Return the drawn boards."""
    return ours("overlay.drawing").patches_of(link())[0].taxels


def placed(gui, count):
    """Wait for a result with this number of boards."""
    done = lambda: plan().result.taxels == count and not plan().result.outdated  # noqa: E731
    yield from gui.wait(done, 60, f"{count} boards")
    yield from gui.redraw(3)


def at(gui, point):
    """Return the pixel of the window of a point in the link frame, which is the world."""
    return gui.at(Vector(point) / ours("scene.units").metres_per_unit(bpy.context.scene))


def paints(gui):
    """The skin follows each click, and Live stays off; Ctrl-Z undoes one click, while painting and afterwards."""
    before = boards()
    count = len(before.ids)
    inner = int(abs(before.positions_link[:, :2] - before.positions_link[:, :2].mean(axis=0)).sum(axis=1).argmin())
    pixels = [at(gui, before.positions_link[row % count]) for row in (inner, inner + 3)]
    yield from press(gui, "skin_calib.boards_paint")
    yield from gui.wait(is_painting, 10, "the brush")
    yield from gui.click(*pixels[0])
    yield from placed(gui, count - 1)
    yield from gui.shot("out.png")
    yield from undo(gui)
    yield from placed(gui, count)
    assert is_painting() and plan().skins[0].choice == "fill"
    yield from undo(gui, "shift")
    yield from placed(gui, count - 1)
    yield from gui.click(*pixels[0])
    yield from placed(gui, count)
    yield from gui.click(*pixels[1])
    yield from hover_view(gui)
    yield from gui.key("ESC")
    yield from gui.redraw(2)
    assert not is_painting() and not plan().live
    yield from placed(gui, count - 1)  # also the last click, although Live is off
    for left in (count, count - 1):
        yield from undo(gui)
        assert plan().skins[0].choice == "listed" and len(plan().skins[0].cells.split()) == left
    yield from undo(gui)
    assert plan().skins[0].choice == "fill" and not plan().live


def is_painting():
    """Return whether the operator waits for clicks."""
    return any(op.bl_idname == "SKIN_CALIB_OT_boards_paint" for op in bpy.context.window.modal_operators)


def slides(gui):
    """The box at the root moves the complete lattice."""
    yield from follow(gui)
    yield from gui.wait(lambda: not plan().result.outdated and plan().result.key, 60, "the result")
    yield from gui.redraw(3)
    place = ours("handles.skin_handles").basis_of(bpy.context, ("origin", 0, 0)).translation
    x, y = gui.at(place)
    yield from gui.click(x, y)
    yield from gui.redraw(3)
    assert plan().skins[0].choice == "fill"  # a mere click moves nothing
    yield from gui.drag((x, y), (x + 20, y), mods=())
    yield from gui.wait(lambda: not plan().result.outdated, 60, "the boards elsewhere")
    yield from gui.redraw(3)
    yield from gui.shot("slid.png")
    assert plan().skins[0].choice == "all" and (Vector(plan().skins[0].origin) - place).length > 0.002
    yield from undo(gui)
    assert plan().skins[0].choice == "fill"
