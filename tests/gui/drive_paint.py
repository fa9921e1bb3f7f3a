"""Drives boards on the sample sole by clicks: one is removed, one added, the lattice moves; Ctrl-Z undoes all of it."""

import bpy
from buttons import press
from mathutils import Vector
from sample import follow, hover_view, link, ours, plan, run, undo


def drive(gui):
    yield from gui.tab("Skin")
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
    return gui.at(Vector(point) / ours("scene.scene").metres_per_unit(bpy.context.scene))


def paints(gui):
    """Live is on, because it shows the effect of a click."""
    before = boards()
    count = len(before.ids)
    inner = int(abs(before.positions_link[:, :2] - before.positions_link[:, :2].mean(axis=0)).sum(axis=1).argmin())
    yield from press(gui, "skin_calib.boards_paint")
    yield from gui.wait(lambda: plan().live, 10, "the brush")
    yield from gui.click(*at(gui, before.positions_link[inner]))
    yield from placed(gui, count - 1)
    yield from gui.shot("out.png")
    yield from gui.click(*at(gui, before.positions_link[inner]))
    yield from placed(gui, count)
    yield from gui.click(*at(gui, before.positions_link[(inner + 3) % count]))
    yield from placed(gui, count - 1)
    yield from hover_view(gui)
    yield from gui.key("RET")
    yield from gui.redraw(2)
    assert plan().skins[0].choice == "listed"
    yield from undo(gui)
    assert plan().skins[0].choice == "fill" and not plan().live


def slides(gui):
    """The ball at the root moves the complete lattice."""
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
