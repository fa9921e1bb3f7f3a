"""What the drivers of the window share: the sample's plan, what is drawn of it, keys for the 3D view."""

import sys

import bpy


def ours(name):
    """The module of the extension with this name below ``blender``, such as "live.live"."""
    return next(m for n, m in sys.modules.items() if n.startswith("bl_ext.") and n.endswith(f".blender.{name}"))


def link():
    """The sample, looked up anew: undo leaves old references dead."""
    return next(o for o in bpy.context.scene.objects if o.name.startswith("sample_"))


def plan():
    """Its plan."""
    return link().skin_calib


def run(gui, name, **words):
    """What a button does, without the search for it in a long side bar, which takes longer than all else."""
    with gui.context():
        getattr(bpy.ops.skin_calib, name)("INVOKE_DEFAULT", True, **words)
    yield from gui.redraw(2)


def follow(gui):
    """Switch Live on, in a step of undo as a click does."""
    plan().live = True
    bpy.ops.ed.undo_push(message="Live")
    yield from gui.redraw(2)


def red(gui):
    """How many pixels of the 3D view are red, as the normals of taxels are; what shines through the sidebar is not."""
    width = gui.region("UI").x - gui.area().x
    r, g, b = gui.pixels("VIEW_3D")[:, :width].astype(int).transpose(2, 0, 1)
    return int(((r > 180) & (g < 90) & (b < 90)).sum())


def hover_view(gui):
    """Put the mouse where keys go to the 3D view and nothing is highlighted."""
    region = gui.region()
    yield from gui.move(region.x + 120, region.y + 60)


def undo(gui, *mods):
    """Ctrl-Z; with "shift", redo."""
    yield from hover_view(gui)
    yield from gui.key("Z", "ctrl", *mods)
    yield from gui.redraw(3)
