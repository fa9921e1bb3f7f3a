"""Drives links into the window: a mesh in millimetres with a hole and an inner part, its check, a robot's link."""

from pathlib import Path

import bpy
import numpy as np
import trimesh
from buttons import find, press
from sample import hover_view, open_steps, undo

ROBOT = """<robot name="bot">{}</robot>"""
LINK = """<link name="{0}"><visual><origin xyz="0 0 0.1" rpy="0 0 0"/><geometry>
<mesh filename="package://bot/ugly.ply" scale="0.001 0.001 0.001"/></geometry></visual></link>"""


def drive(gui):
    path = gui.out / "bot" / "ugly.ply"
    path.parent.mkdir(exist_ok=True)
    ugly().export(path)
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    yield from hover_view(gui)
    yield from imports_the_mesh(gui, path)
    yield from checks_it(gui)
    yield from keeps_all_parts(gui)
    yield from shows_its_holes(gui)
    yield from notices_a_wrong_unit(gui)
    yield from imports_a_link_of_a_robot(gui, path.with_name("bot.urdf"))


def ugly():
    """Return a tube of 70 mm with a hole in its wall and a box inside, in millimetres."""
    tube = trimesh.creation.cylinder(radius=35, height=100, sections=96).subdivide().subdivide().subdivide()
    centres = tube.triangles_center
    lids = np.abs(np.abs(centres[:, 2]) - 50) < 1e-6
    hole = np.linalg.norm(centres - (35, 0, 10), axis=1) < 9
    tube.update_faces(~lids & ~hole)
    return trimesh.util.concatenate([tube, trimesh.creation.box((30, 20, 40))])


def active():
    """Return the active object, without a stored reference."""
    return bpy.context.view_layer.objects.active


def imports_the_mesh(gui, path):
    """File > Import and the panel have the entry; the sidebar of the file browser asks for the unit."""
    yield from press(gui, "skin_calib.import_mesh")
    yield from gui.wait(lambda: gui.area("FILE_BROWSER"), 10, "the file browser")
    assert gui.area("FILE_BROWSER").spaces.active.active_operator.unit == "auto"
    yield from gui.shot("import_mesh.png", area="FILE_BROWSER")
    yield from gui.choose_file(path)
    yield from gui.wait(lambda: active().name == "ugly", 20, "the link")
    assert active().skin_calib.link == "ugly" and 0.09 < max(active().dimensions) < 0.11
    yield from open_steps(gui)
    with gui.context():
        bpy.ops.view3d.view_selected()
    yield from gui.redraw()
    yield from gui.shot("imported.png")


def checks_it(gui):
    """Parts, holes and edges are reported until the mesh changes."""
    yield from press(gui, "skin_calib.diagnose")
    yield from gui.wait(lambda: active().skin_calib.diagnosis.key, 20, "the check")
    yield from hover_view(gui)
    yield from gui.redraw()
    yield from gui.shot("checked.png")
    found = active().skin_calib.diagnosis
    assert found.inner == 1 and found.edges > 100 and any(f.severity == "warning" for f in found.findings)
    yield from undo(gui)
    assert not active().skin_calib.diagnosis.key
    yield from undo(gui, "shift")
    assert active().skin_calib.diagnosis.key


def keeps_all_parts(gui):
    """One click keeps the inner part too; another click, or undo, keeps the outer shell only."""
    side = gui.region("UI")
    shells = []
    for fraction in (0.8, 0.41, 0.8):  # within All, Outer, All of the rows of both steps, Mesh and Cut
        _, y = yield from find(gui, "skin_calib.cover.shell")  # the note about the changed plan moves it
        yield from gui.click(side.x + fraction * side.width, y)
        yield from gui.redraw()
        shells.append(active().skin_calib.cover.shell)
    yield from undo(gui)
    shells.append(active().skin_calib.cover.shell)
    assert shells == ["all", "outer", "all", "outer"], shells


def shows_its_holes(gui):
    """The edges of holes are selected in Edit Mode; Ctrl-Z returns to Object Mode, and the check is valid."""
    yield from press(gui, "skin_calib.show_defects")
    yield from gui.wait(lambda: bpy.context.mode == "EDIT_MESH", 10, "Edit Mode")
    yield from gui.redraw(3)
    yield from gui.shot("holes.png")
    assert active().data.total_edge_sel == active().skin_calib.diagnosis.edges
    yield 1.0
    yield from undo(gui)
    assert bpy.context.mode == "OBJECT", bpy.context.mode
    yield 1.0
    yield from gui.redraw(3)
    yield from gui.shot("holes_undone.png")


def notices_a_wrong_unit(gui):
    """An object that is a thousand times too large is scaled with one click, and restored with one undo."""
    active().scale = [1000 * s for s in active().scale]
    bpy.ops.ed.undo_push(message="wrong unit")
    yield 1.0
    yield from gui.redraw(3)
    yield from gui.shot("wrong_unit.png")
    yield from press(gui, "skin_calib.scale_to_unit")
    yield from gui.redraw(3)
    assert 0.09 < max(active().dimensions) < 0.11
    yield 1.0
    yield from gui.redraw(3)
    yield from gui.shot("right_unit.png")
    yield from undo(gui)
    assert max(active().dimensions) > 90
    yield from undo(gui)
    assert 0.09 < max(active().dimensions) < 0.11


def imports_a_link_of_a_robot(gui, path):
    """First the file, then the link in a list with search; undo removes it."""
    path.write_text(ROBOT.format("".join(LINK.format(name) for name in ("l_forearm", "l_upper_leg", "r_upper_leg"))))
    yield from press(gui, "skin_calib.import_urdf")
    yield from gui.wait(lambda: gui.area("FILE_BROWSER"), 10, "the file browser")
    yield from gui.shot("import_urdf.png", area="FILE_BROWSER")
    yield from gui.choose_file(path)
    yield 1.0
    yield from gui.shot("choose_link.png", area=None)
    yield from gui.type("l_up")
    yield 0.5
    yield from gui.shot("choose_link_typed.png", area=None)
    yield from gui.key("RET")
    yield from gui.wait(lambda: active().name == "l_upper_leg", 20, "the link")
    heights = [v.co.z for v in active().data.vertices]
    assert abs(max(heights) - 0.15) < 1e-6 and tuple(active().scale) == (1, 1, 1)
    yield from undo(gui)
    assert "l_upper_leg" not in bpy.data.objects
    assert Path(path).exists()
