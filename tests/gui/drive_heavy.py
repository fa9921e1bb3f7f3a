"""Drives a mesh of a million facets: the window responds while it is read, checked and fitted; Esc stops each.

It takes minutes and a fast machine, so it is not in the suite: start it by hand with
``drive-gui --install . --blend sample_scenes/wrist.blend --size 1000x1100 --out FOLDER tests/gui/drive_heavy.py``.
"""

import os
from time import perf_counter

import bpy
import numpy as np
from buttons import press
from sample import link, open_steps, ours, plan


def drive(gui):
    path = gui.out / "large.ply"
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    link().modifiers.new("finer", "SUBSURF").levels = 3
    yield from gui.redraw(2)
    yield from fits(gui)
    write(path)
    yield from checks(gui)
    yield from imports(gui, path)


def running(name):
    """Return whether an operator of this name waits for a computation."""
    return any(op.bl_idname == f"SKIN_CALIB_OT_{name}" for op in bpy.context.window.modal_operators)


def stops(gui, name):
    """Esc ends an operator that waits."""
    yield from gui.wait(lambda: running(name), 60, f"{name} in a thread")
    yield from gui.key("ESC")
    yield from gui.wait(lambda: not running(name), 30, f"{name} to stop")


def fits(gui):
    """Esc stops the fit; without Esc the view can be turned until it ends."""
    yield from press(gui, "skin_calib.fit")
    yield from stops(gui, "fit")
    assert not plan().result.key
    yield from press(gui, "skin_calib.fit")
    yield from gui.wait(lambda: running("fit"), 60, "a fit in a thread")
    with gui.context():
        bpy.ops.view3d.view_orbit(type="ORBITLEFT")  # the window still answers
    yield from gui.redraw()
    yield from gui.shot("running.png")
    assert running("fit")
    yield from gui.wait(lambda: plan().result.key, 300, "the fit")
    assert plan().result.max < 2e-4
    yield from gui.shot("fitted.png")


def checks(gui):
    """The check of the mesh is stopped by Esc; without Esc it ends, and nothing blocks the window."""
    yield from press(gui, "skin_calib.diagnose")
    yield from stops(gui, "diagnose")
    assert not plan().diagnosis.key
    yield from press(gui, "skin_calib.diagnose")
    yield from ends(gui, "the check", lambda: plan().diagnosis.key)
    assert link().name not in ours("live.diagnoses").unverified


def imports(gui, path):
    """A large file is read in a thread; the link is there when it is read, and one undo removes it."""
    yield from press(gui, "skin_calib.import_mesh")
    yield from answers(gui, path)
    yield from stops(gui, "import_wait")
    assert "large" not in bpy.data.objects
    yield from press(gui, "skin_calib.import_mesh")
    yield from answers(gui, path)
    yield from ends(gui, "the import", lambda: "large" in bpy.data.objects)
    assert len(bpy.data.objects["large"].data.polygons) > 6e5
    yield from gui.redraw(2)
    yield from gui.shot("imported.png")
    with gui.context():
        bpy.ops.ed.undo()
    assert "large" not in bpy.data.objects and link().name


def answers(gui, path):
    """Choose a file in the browser, and return while it is read: to draw the view again can take as long."""
    yield from gui.wait(lambda: any(a.type == "FILE_BROWSER" for a in gui.window.screen.areas), 30, "the file browser")
    yield from gui.redraw()
    params = gui.area("FILE_BROWSER").spaces.active.params
    params.directory, params.filename = os.fsencode(f"{path.parent}/"), path.name
    yield from gui.redraw()
    x, y = yield from gui.find("file.execute", "FILE_BROWSER", "EXECUTE")
    yield from gui.click(x, y)


def write(path):
    """Write the finer mesh of the link to a file."""
    facets = ours("scene.link_meshes").read_facets(link(), bpy.context)
    corners = np.zeros(len(facets.faces), [("count", "u1"), ("corners", "<i4", 3)])
    corners["count"], corners["corners"] = 3, facets.faces
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(facets.vertices)}\nproperty float x\n"
        f"property float y\nproperty float z\nelement face {len(facets.faces)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + facets.vertices.astype("<f4").tobytes() + corners.tobytes())


def ends(gui, what, done):
    """Wait until something is done, and print the longest time without an iteration of the window."""
    gaps, start = [], perf_counter()
    while not done():
        assert perf_counter() - start < 300, f"waited in vain for {what}"
        last = perf_counter()
        yield 0.02
        gaps.append(perf_counter() - last)
    print(f"longest freeze of {what}: {max(gaps):.2f} s of {sum(gaps):.1f} s")
