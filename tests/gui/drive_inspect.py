"""Drives the Inspect panel: layers, heat maps with their legends, labels, sizes."""

from sample import hover_view, plan


def drive(gui):
    yield from gui.tab("Skin")
    yield from gui.press("skin_calib.fit")
    yield from gui.wait(lambda: plan().result.key, 30, "the fit")
    yield from shows_layers(gui)
    yield from shows_heat_maps(gui)
    yield from writes_labels(gui)


def shows_layers(gui):
    plan().layers = {"SECTIONS", "LINES", "NET"}
    yield from gui.redraw()
    yield from hover_view(gui)
    yield from gui.shot("layers.png")


def shows_heat_maps(gui):
    plan().layers = {"CELLS"}
    for heat in ("ERROR", "STRAIN", "TILT"):
        plan().inspect.heat = heat
        yield from gui.redraw()
        yield from gui.shot(f"{heat.lower()}.png")


def writes_labels(gui):
    plan().inspect.heat = "NONE"
    plan().inspect.labels = "ID"
    yield from gui.redraw()
    yield from gui.shot("ids.png")
    plan().inspect.labels = "CHANNEL"
    plan().inspect.text_size = 16
    yield from gui.redraw()
    yield from gui.shot("channels.png")
