"""Drives links into the window: a mesh in millimetres with a hole and an inner part, its check, a robot's link."""

from pathlib import Path

import bpy
import numpy as np
import trimesh
from buttons import press
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
