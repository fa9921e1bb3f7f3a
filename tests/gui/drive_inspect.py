"""Drives the Inspect panel: layers, heat maps with legends, labels; taxels that are clicked, compared, replayed."""

from pathlib import Path

import bpy
import numpy as np
from buttons import find, press
from mathutils import Vector
from sample import hover_view, link, open_steps, ours, plan, run, undo

ROOT = Path(__file__).resolve().parents[2]


def drive(gui):
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    yield from run(gui, "fit")
    yield from gui.wait(lambda: plan().result.key, 30, "the fit")
    yield from gui.tab("Inspect")
    yield from shows_heat_maps(gui)
    yield from saves_pictures(gui)
    yield from writes_labels(gui)
    yield from reads_taxels(gui)
    yield from compares(gui)
    yield from compares_with_touches(gui)
    yield from replays(gui)


def changed(gui, before):
    """Return the fraction of the view's pixels that have changed."""
    width = gui.region("UI").x - gui.area().x
    after = gui.pixels("VIEW_3D")[:, :width].astype(int)
    return float((abs(after - before[:, :width]).max(axis=2) > 25).mean())


def screenshot(gui):
    """Return the view while the mouse is elsewhere."""
    yield from hover_view(gui)
    yield from gui.redraw()
    return gui.pixels("VIEW_3D").astype(int)


def shows_heat_maps(gui):
    """Each fills the skin, with a legend."""
    plan().layers = {"CELLS"}
    before = yield from screenshot(gui)
    for heat in ("ERROR", "STRAIN", "TILT"):
        plan().inspect.heat = heat
        yield from screenshot(gui)
        yield from gui.shot(f"{heat.lower()}.png")
        assert changed(gui, before) > 0.05, heat


def saves_pictures(gui):
    """The file has the wanted width, the normals over the link, and a legend that names them; or no background."""
    plan().layers, plan().inspect.heat = {"CELLS", "NORMALS"}, "TILT"
    yield from press(gui, "skin_calib.save_picture")
    yield from gui.choose_file(gui.out / "chosen.png")
    yield from gui.wait((gui.out / "chosen.png").exists, 20, "the picture")
    for is_transparent in (False, True):
        path = gui.out / f"picture_{is_transparent}.png"
        with gui.context():
            bpy.ops.skin_calib.save_picture(filepath=str(path), width=1500, transparent=is_transparent)
        image = bpy.data.images.load(str(path))
        pixels = np.array(image.pixels).reshape(*image.size[::-1], 4)
        bpy.data.images.remove(image)
        assert pixels.shape[1] == 1500
        r, g, b, alpha = pixels.transpose(2, 0, 1)
        normals = (r > 0.7) & (g < 0.5) & (b < 0.2) & (alpha > 0.9)
        middle, legend = normals[300:, 300:-300], normals[:200, :600]
        assert middle.sum() > 500 and legend.sum() > 100, (middle.sum(), legend.sum())
        assert ((alpha == 0).mean() > 0.3) == is_transparent and (alpha == 1).mean() > 0.05


def writes_labels(gui):
    """Ids are written, then channels in larger letters."""
    plan().inspect.heat = "NONE"
    before = yield from screenshot(gui)
    plan().inspect.labels = "ID"
    yield from screenshot(gui)
    yield from gui.shot("ids.png")
    assert changed(gui, before) > 0.003
    plan().inspect.labels, plan().inspect.text_size = "CHANNEL", 16
    yield from screenshot(gui)
    yield from gui.shot("channels.png")
    plan().inspect.labels = "NONE"


def position_of(name):
    """Return the position of a taxel in the world."""
    taxels = ours("inspection.taxels").taxels_of(link())
    return link().matrix_world @ Vector(taxels.positions[taxels.rows[name]])


def reads_taxels(gui):
    """Two clicks, a miss, Esc: the last taxel stays; Ctrl-Z undoes each."""
    yield from press(gui, "skin_calib.taxel")
    for name in ("wrist.2.7", "wrist.4.6"):
        yield from gui.click(*gui.at(position_of(name)))
        assert plan().inspect.taxel.id == name, plan().inspect.taxel.id
    region = gui.region()
    yield from gui.click(region.x + 150, region.y + 300)
    assert plan().inspect.taxel.id == "wrist.4.6"
    yield from gui.key("ESC")
    yield from screenshot(gui)
    yield from gui.shot("taxel.png")
    yield from undo(gui)
    assert plan().inspect.taxel.id == "wrist.2.7"
    yield from undo(gui)
    assert not plan().inspect.taxel.id
    yield from gui.shot("unread.png")
    yield from undo(gui, "shift")
    yield from undo(gui, "shift")
    assert plan().inspect.taxel.id == "wrist.4.6"


def answer(gui, path):
    """Give a file to the open file browser."""
    yield from gui.wait(lambda: gui.area("FILE_BROWSER"), 10, "the file browser")
    yield from gui.choose_file(path)
    yield from gui.redraw(3)


def compares(gui):
    """Its own taxels, moved, are reported as another frame; Ctrl-Z removes lines and numbers."""
    path = gui.out / "moved.csv"
    bpy.ops.skin_calib.export_taxels(filepath=str(path), format="csv")
    header, *rows = path.read_text().splitlines()
    x = header.split(",").index("x")
    moved = [[*cells[:x], str(float(cells[x]) + 0.004), *cells[x + 1 :]] for cells in (row.split(",") for row in rows)]
    path.write_text("\n".join([header, *(",".join(cells) for cells in moved)]) + "\n")
    before = yield from screenshot(gui)
    yield from press(gui, "skin_calib.compare")
    yield from answer(gui, path)
    found = plan().inspect.comparison
    assert "120 taxels paired" in found.remarks and "mean 4.0000 mm" in found.remarks, found.remarks
    assert "Another frame?" in found.warnings[0].message, found.warnings[0].message
    yield from screenshot(gui)
    yield from gui.shot("compared.png")
    assert changed(gui, before) > 0.002
    yield from undo(gui)
    assert not plan().inspect.comparison.file
    yield from screenshot(gui)
    assert changed(gui, before) < 0.001


def compares_with_touches(gui):
    """For the example's touches, a shift and two swapped wires are reported; the sheet is moved, Ctrl-Z restores it."""
    before = yield from screenshot(gui)
    yield from press(gui, "skin_calib.touches")
    yield from answer(gui, ROOT / "examples" / "wrist_touches.csv")
    found = plan().inspect.touches
    assert "Shifted 2.32" in found.remarks and "wrist.5.1" in found.warnings[0].message, found.remarks
    yield from screenshot(gui)
    yield from gui.shot("touches.png")
    assert changed(gui, before) > 0.002
    yield from press(gui, "skin_calib.touches_move")
    assert not plan().skins[0].centred and plan().result.outdated
    yield from undo(gui)
    assert plan().skins[0].centred and not plan().result.outdated
    yield from run(gui, "touches_end")


def replays(gui):
    """The example's recording is opened, its slider dragged, played, and stopped by Ctrl-Z."""
    before = yield from screenshot(gui)
    yield from press(gui, "skin_calib.replay_open")
    yield from answer(gui, ROOT / "examples" / "wrist_recording.csv")
    assert plan().inspect.heat == "FORCE" and plan().inspect.replay.file
    yield from screenshot(gui)
    yield from gui.shot("opened_recording.png")
    assert changed(gui, before) > 0.05
    x, y = yield from find(gui, "skin_calib.inspect.replay.progress")
    yield from gui.drag((x - 30, y), (x + 10, y), mods=())
    assert plan().inspect.replay.frame > 5, plan().inspect.replay.frame
    yield from screenshot(gui)
    yield from gui.shot("dragged_recording.png")
    plan().inspect.replay.speed = 0.1
    frame = plan().inspect.replay.frame
    yield from press(gui, "skin_calib.replay_play")
    yield from gui.wait(lambda: plan().inspect.replay.frame > frame + 3, 30, "the next frames")
    assert ours("inspection.replay").is_playing(link())
    yield from gui.shot("playing.png")
    yield from undo(gui)
    assert not ours("inspection.replay").is_playing(link())
    yield from gui.shot("stopped.png")
