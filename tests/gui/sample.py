"""Common parts of the drivers of the window: the sample's plan, what is drawn of it, keys for the 3D view."""

import sys

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d

PINK = (255, 51, 204)  # of the mark of a place, drawn over everything
VERMILLION = (214, 94, 0)  # of normals


def ours(name):
    """Return the module of the extension with this name below ``blender``, for example "live.updates"."""
    return next(m for n, m in sys.modules.items() if n.startswith("bl_ext.") and n.endswith(f".blender.{name}"))


def link():
    """Return the sample, without a stored reference: undo makes references invalid."""
    return next(o for o in bpy.context.scene.objects if o.name.startswith("sample_"))


def state():
    """Return what the window knows of the active link."""
    return ours("session").session.of(link())


def plan():
    """Return the plan of the sample."""
    return link().skin_calib


def run(gui, name, **words):
    """Run the operator of a button, without a search for the button in a long sidebar."""
    with gui.context():
        getattr(bpy.ops.skin_calib, name)("INVOKE_DEFAULT", True, **words)
    yield from gui.redraw(2)


def follow(gui):
    """Switch Live on, in one undo step, as a click does."""
    plan().live = True
    bpy.ops.ed.undo_push(message="Live")
    yield from gui.redraw(2)


def count(gui, colour, difference):
    """Return how many pixels of the 3D view, without those under the sidebar, differ little from a colour."""
    width = gui.region("UI").x - gui.area().x
    return int((abs(gui.pixels("VIEW_3D")[:, :width, :3].astype(int) - colour).max(axis=2) < difference).sum())


def red(gui):
    """Return the number of pixels of normals."""
    return count(gui, VERMILLION, 15)  # the outline of a selected object differs by 23


def pink(gui):
    """Return the number of pixels of marks."""
    return count(gui, PINK, 40)


def hover_view(gui):
    """Move the mouse to a position where the 3D view gets the keys and nothing is highlighted."""
    region = gui.region()
    yield from gui.move(region.x + 120, region.y + 60)


def undo(gui, *mods):
    """Press Ctrl-Z; with "shift", redo."""
    yield from hover_view(gui)
    yield from gui.key("Z", "ctrl", *mods)
    yield from gui.redraw(3)


def open_steps(gui):
    """Open every step of the work in the sidebar; the first fit then closes none."""
    for link in bpy.data.objects:
        for item in link.skin_calib.steps.bl_rna.properties:
            if item.type == "BOOLEAN":
                setattr(link.skin_calib.steps, item.identifier, True)
    bpy.ops.ed.undo_push(message="Steps")
    yield from gui.redraw(2)


def is_in_full(gui, name):
    """Return whether all vertices of an object are in the view, to the left of the sidebar."""
    link, region = bpy.data.objects[name], gui.region()
    view = gui.area().spaces.active.region_3d
    at = [location_3d_to_region_2d(region, view, link.matrix_world @ v.co) for v in link.data.vertices]
    right = region.width - gui.region("UI").width
    spans = [max(p[k] for p in at) - min(p[k] for p in at) for k in range(2)]
    assert max(spans) > 0.3 * min(right, region.height), "the link is small in the view"
    return all(0 < p.x < right and 0 < p.y < region.height for p in at)
