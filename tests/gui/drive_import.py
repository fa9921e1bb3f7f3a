"""Drives imports into Blender's start scene: a link within the cube is shown alone and in full."""

from pathlib import Path

import bpy
from buttons import press
from sample import hover_view, is_in_full, undo

SAMPLES = Path(__file__).resolve().parents[2] / "sample_scenes"


def drive(gui):
    yield from gui.tab("Skin")
    yield from hover_view(gui)
    yield from imports(gui, "wrist")
    yield from undo(gui)
    assert "wrist" not in bpy.data.objects and is_seen(gui, "Cube"), "undo leaves an empty local view"
    yield from gui.shot("undone.png")
    yield from undo(gui, "shift")
    yield from gui.shot("redone.png")
    assert is_seen(gui, "wrist")
    yield from imports(gui, "sole")  # the file browser opens again, although the operator knows the last path
    yield from cuts_with_the_tool(gui)
    yield from shows_the_menus(gui)


def is_seen(gui, name):
    """Return whether an object is visible in the 3D view."""
    return bpy.data.objects[name].visible_get(viewport=gui.area().spaces.active)


def imports(gui, name):
    """The button opens the file browser; the link is the only object, and all of it is visible."""
    yield from press(gui, "skin_calib.import_mesh")
    yield from gui.choose_file(SAMPLES / f"{name}.ply")
    yield from gui.wait(lambda: name in bpy.data.objects, 20, "the link")
    yield 1.0
    yield from gui.redraw(3)
    yield from gui.shot(f"{name}.png", area=None)
    assert is_seen(gui, name) and not is_seen(gui, "Cube") and is_in_full(gui, name)


def cuts_with_the_tool(gui):
    """The tool adds a cut at a click on the link, in one step of undo; a click next to the link adds none."""
    with gui.context():
        bpy.ops.wm.tool_set_by_id(name="skin_calib.cut_tool")
    yield from gui.redraw(3)
    link = bpy.context.view_layer.objects.active.name
    cuts = bpy.data.objects[link].skin_calib.cover.cuts
    area, side = gui.area(), gui.region("UI").width
    for x, expected in ((0.5, 1), (0.15, 1)):
        yield from gui.click(area.x + x * (area.width - side), area.y + 0.45 * area.height)
        yield from gui.redraw(3)
        assert len(cuts) == expected, len(cuts)
    yield from gui.shot("tool.png", area=None)
    yield from undo(gui)
    assert not bpy.data.objects[link].skin_calib.cover.cuts
    with gui.context():
        bpy.ops.wm.tool_set_by_id(name="builtin.select_box")


def shows_the_menus(gui):
    """The menu Skin and its submenus are drawn; F3 finds an operator in them and calls it."""
    for name in ("skin", "open", "mesh", "cut", "grid", "surfaces", "skins", "presets", "inspect", "robot", "export"):
        with gui.context():
            bpy.ops.wm.call_menu("INVOKE_DEFAULT", name=f"SKIN_MT_{name}")
        yield 0.5
        yield from gui.shot(f"menu_{name}.png", area=None)
        yield from gui.key("ESC")
        yield from gui.redraw()
    yield from gui.search("Add Surface")
    yield from gui.redraw(3)
    assert bpy.context.view_layer.objects.active.skin_calib.other_surfaces
