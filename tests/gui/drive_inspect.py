"""Drives the Inspect panel: layers, heat maps with their legends, labels; taxels that are clicked on."""

import sys

from sample import hover_view, link, plan, undo


def ours(name):
    """A module of the extension."""
    return next(m for n, m in sys.modules.items() if n.startswith("bl_ext.") and n.endswith(f".blender.{name}"))


def drive(gui):
    yield from gui.tab("Skin")
    yield from gui.press("skin_calib.fit")
    yield from gui.wait(lambda: plan().result.key, 30, "the fit")
    yield from shows_layers(gui)
    yield from shows_heat_maps(gui)
    yield from writes_labels(gui)
    yield from reads_taxels(gui)


def changed(gui, before):
    """Share of the view's pixels that are not as before."""
    width = gui.region("UI").x - gui.area().x
    after = gui.pixels("VIEW_3D")[:, :width].astype(int)
    return float((abs(after - before[:, :width]).max(axis=2) > 25).mean())


def looks(gui):
    """The view when the mouse is out of the way."""
    yield from hover_view(gui)
    yield from gui.redraw(2)
    return gui.pixels("VIEW_3D").astype(int)


def shows_layers(gui):
    """Sections, lines and net come over the link."""
    plan().layers = set()
    empty = yield from looks(gui)
    plan().layers = {"SECTIONS", "LINES", "NET"}
    yield from looks(gui)
    yield from gui.shot("layers.png")
    assert changed(gui, empty) > 0.005


def shows_heat_maps(gui):
    """Each fills the skin, with a legend."""
    plan().layers = {"CELLS"}
    before = yield from looks(gui)
    for heat in ("ERROR", "STRAIN", "TILT"):
        plan().inspect.heat = heat
        yield from looks(gui)
        yield from gui.shot(f"{heat.lower()}.png")
        assert changed(gui, before) > 0.05, heat


def writes_labels(gui):
    """Ids, then channels in larger letters."""
    plan().inspect.heat = "NONE"
    before = yield from looks(gui)
    plan().inspect.labels = "ID"
    yield from looks(gui)
    yield from gui.shot("ids.png")
    assert changed(gui, before) > 0.003
    plan().inspect.labels, plan().inspect.text_size = "CHANNEL", 16
    yield from looks(gui)
    yield from gui.shot("channels.png")
    plan().inspect.labels = "NONE"


def place_of(name):
    """Where a taxel is in the world."""
    taxels = ours("taxels").taxels_of(link())
    return link().matrix_world @ ours("scene").Vector(taxels.positions[taxels.rows[name]])


def reads_taxels(gui):
    """Two clicks, a miss, Esc: the last one stays, in one step that Ctrl-Z takes back."""
    yield from gui.press("skin_calib.taxel")
    for name in ("wrist.2.7", "wrist.4.6"):
        yield from gui.click(*gui.at(place_of(name)))
        assert plan().inspect.taxel.id == name, plan().inspect.taxel.id
    region = gui.region()
    yield from gui.click(region.x + 150, region.y + 300)
    assert plan().inspect.taxel.id == "wrist.4.6"
    yield from gui.key("ESC")
    yield from looks(gui)
    yield from gui.shot("taxel.png")
    yield from undo(gui)
    assert not plan().inspect.taxel.id
    yield from gui.shot("unread.png")
    yield from undo(gui, "shift")
    assert plan().inspect.taxel.id == "wrist.4.6"
