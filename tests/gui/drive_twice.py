"""Drives what users do by mistake: the same file dropped twice, and Esc in each operator that waits for clicks."""

import bpy
from drive_import import SAMPLES, URDF, dropped
from drive_robot import active, running
from sample import hover_view, ours, plan, run

# Operators that wait for clicks.
PICKING = ("cut_place", "axis_from_sections", "place", "taxel", "taxel_toggle")


def drive(gui):
    yield from gui.tab("Skin")
    yield from hover_view(gui)
    yield from escapes(gui)
    yield from drops_twice(gui)


def drops_twice(gui):
    """The second copy of a mesh or a robot is another link, and the state says that both have the same name."""
    (gui.out / "edge.ply").write_bytes((SAMPLES / "edge.ply").read_bytes())
    (gui.out / "two.urdf").write_text(URDF)
    for path, key, name in ((gui.out / "edge.ply", "L", "edge"), (gui.out / "two.urdf", "I", "tube")):
        for wanted in (name, f"{name}.001"):
            yield from dropped(gui, path)
            yield 0.5
            yield from gui.key(key)
            yield from gui.wait(lambda wanted=wanted: wanted in bpy.data.objects, 20, f"the import of {wanted}")
            yield 1.0
            yield from gui.redraw(3)
        copies = [bpy.data.objects[name], bpy.data.objects[f"{name}.001"]]
        assert active() == copies[1], active().name
        assert list(ours("scene.link_objects").namesakes(copies[1], bpy.context.scene)) == [name]
        yield from gui.shot(f"twice_{name}.png")


def escapes(gui):
    """Esc ends each operator that waits for clicks, and changes nothing."""
    yield from run(gui, "fit")
    yield from gui.wait(lambda: plan().result.key and not plan().result.outdated, 60, "the fit")
    key = plan().result.key
    for name in PICKING:
        yield from run(gui, name)
        assert running(), name
        yield from hover_view(gui)
        yield from gui.key("ESC")
        yield from gui.redraw(2)
        assert not running(), name
        assert plan().result.key == key and not plan().result.outdated, name
