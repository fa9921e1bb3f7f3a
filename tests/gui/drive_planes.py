"""Drives hand-placed planes: placed, dragged, tilted, one that misses the mesh, and undo of all steps."""

from math import pi, radians, sin

import bpy
from buttons import press
from mathutils import Vector
from sample import follow, hover_view, link, open_steps, ours, plan, state, undo

RING = 79  # [pixels] radius of a dial


def handle(family, i):
    """Return the position of a plane's handle in the world, which is the sample's frame."""
    planes = getattr(plan().grid, family)
    metre = ours("scene.units").metres_per_unit(bpy.context.scene)
    return Vector(planes[i].point) + Vector(state().sketch.arms[family.upper(), i]) / metre


def drive(gui):
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    yield from press(gui, "skin_calib.planes_place")
    yield from gui.wait(lambda: state().sketch, 20, "the sketch")
    yield from gui.redraw(3)
    yield from moves_a_plane(gui)
    yield from tilts_a_plane(gui)
    yield from follows_live(gui)
    yield from undoes_everything(gui)
    yield from works_with_the_tool(gui)


def moves_a_plane(gui):
    """Its section follows while the mouse button is down; Ctrl-Z restores this plane only."""
    was = [tuple(p.point) for p in plan().grid.u]
    x, y = gui.at(handle("u", 4))
    yield from gui.drag((x, y), (x, y + 15), mods=(), release=False)
    yield from gui.redraw(3)
    yield from gui.shot("dragged.png")
    yield from gui.release()
    yield from gui.redraw(3)
    now = [tuple(p.point) for p in plan().grid.u]
    assert [a == b for a, b in zip(was, now)] == [i != 4 for i in range(10)], (was, now)
    assert plan().grid.u_index == 4 and now[4][2] > was[4][2]
    yield from gui.shot("moved.png")
    yield from undo(gui)
    assert [tuple(p.point) for p in plan().grid.u] == was and plan().grid.kind == "planes"
    yield from undo(gui, "shift")
    assert [tuple(p.point) for p in plan().grid.u] == now


def tilts_a_plane(gui):
    """A dial of the selected plane turns it about an axis in it; Ctrl-Z turns it back."""
    was, point = tuple(plan().grid.u[4].normal), tuple(plan().grid.u[4].point)
    x, y = gui.at(Vector(point))
    down = x - RING * sin(pi / 4), y - RING * sin(pi / 4)
    yield from gui.move(*down)
    yield from gui.redraw(2)
    yield from gui.drag(down, (down[0] + 15, down[1] - 15), mods=(), release=False)
    yield from gui.redraw(3)
    yield from gui.shot("turned.png")
    yield from gui.release()
    yield from gui.redraw(3)
    turned = Vector(was).angle(plan().grid.u[4].normal)
    assert radians(2) < turned < radians(45), turned
    assert tuple(plan().grid.u[4].point) == point
    yield from undo(gui)
    assert tuple(plan().grid.u[4].normal) == was


def follows_live(gui):
    """With Live on the surface follows a plane under the mouse, and the result comes after the drag."""
    yield from follow(gui)
    yield from gui.wait(lambda: plan().result.key and not plan().result.outdated, 30, "the first result")
    before = plan().result.key
    ours("live.updates").FIT_DELAY = 60.0  # a software renderer rests between two moves
    x, y = gui.at(handle("u", 6))
    yield from gui.drag((x, y), (x, y + 15), mods=(), release=False)
    yield from gui.wait(lambda: state().layers, 20, "a preview under the drag")
    yield from gui.redraw()
    yield from gui.shot("followed.png")
    print("preview", state().report)
    yield from gui.release()
    ours("live.updates").FIT_DELAY = 0.4
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the result after the rest")
    assert plan().result.key != before


def undoes_everything(gui):
    """Ctrl-Z returns to the file as it was opened."""
    for _ in range(6):
        if plan().grid.kind == "tube":
            break
        yield from undo(gui)
    assert plan().grid.kind == "tube" and not len(plan().grid.u) and not plan().live
    yield from gui.redraw(3)
    yield from gui.shot("back.png")
    assert state().sketch is None


def works_with_the_tool(gui):
    """A click adds a plane across, Shift a plane along, Ctrl removes the nearest; handles work; Ctrl-Z undoes each."""
    with gui.context():
        bpy.ops.wm.tool_set_by_id(name="skin_calib.planes_tool")
    yield from hover_view(gui)
    yield from gui.redraw(2)
    start = len(plan().grid.u), len(plan().grid.v)
    assert plan().grid.kind == "tube" and start == (0, 0)
    box = [Vector(corner) for corner in link().bound_box]
    x, y = gui.at(link().matrix_world @ (sum(box, Vector()) / 8))
    yield from gui.click(x, y)
    yield from gui.wait(lambda: state().sketch, 20, "the sketch")
    yield from gui.redraw(3)
    counts = [(len(plan().grid.u), len(plan().grid.v))]
    assert plan().grid.kind == "planes" and counts[0][0] == 11, counts
    yield from gui.shot("tool_across.png")
    yield from gui.click(x + 20, y - 1.4 * RING, mods=("shift",))  # next to the rings, which take clicks
    yield from gui.redraw(3)
    counts.append((len(plan().grid.u), len(plan().grid.v)))
    yield from gui.shot("tool_along.png")
    yield from gui.drag(*(lambda at: (at, (at[0], at[1] + 12)))(gui.at(handle("u", 2))), mods=())
    yield from gui.redraw(3)
    assert plan().grid.u_index == 2
    yield from undo(gui)
    yield from gui.click(x - 30, y - 2.7 * RING, mods=("ctrl",))
    yield from gui.redraw(3)
    counts.append((len(plan().grid.u), len(plan().grid.v)))
    (n, m) = counts[0]
    assert counts[1] == (n, m + 1) and sum(counts[2]) == n + m, counts
    for expected in counts[1::-1]:
        yield from undo(gui)
        assert (len(plan().grid.u), len(plan().grid.v)) == expected
    yield from undo(gui)
    assert plan().grid.kind == "tube"
    with gui.context():
        bpy.ops.wm.tool_set_by_id(name="builtin.select_box")
