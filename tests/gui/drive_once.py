"""Drives what happens once: one fit at a time, one link of a name, a cut that is corrected after it was added."""

import json
from threading import Event

import bpy
from buttons import find, press
from sample import hover_view, link, open_steps, ours, plan, run


def drive(gui):
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    yield from fits_once_at_a_time(gui)
    yield from corrects_a_new_cut(gui)
    yield from warns_of_a_copy(gui)
    yield from warns_of_a_file_without_taxels(gui)


def reports():
    """Return what operators have reported: level and text."""
    return [(report.type, report.message) for report in bpy.context.window_manager.reports]


def corrects_a_new_cut(gui):
    """The redo panel has point and normal of the cut; a change there moves the same cut."""
    yield from press(gui, "skin_calib.cut_add")
    operator = bpy.context.window_manager.operators[-1]
    shown = [p.identifier for p in operator.properties.bl_rna.properties if not p.is_hidden]
    assert [name for name in shown if name != "rna_type"] == ["point", "normal"], shown
    yield from hover_view(gui)
    yield from gui.key("F9")
    yield 0.5
    yield from gui.shot("redo.png")
    yield from gui.key("ESC")
    operator = bpy.context.window_manager.operators[-1]
    operator.properties.point = (0, 0, 0.04)
    with gui.context():
        bpy.ops.ed.undo_redo()
    (cut,) = plan().cover.cuts
    assert abs(cut.point[2] - 0.04) < 1e-6, cut.point[:]
    plan().cover.cuts.clear()


def warns_of_a_copy(gui):
    """Shift-D copies the link name: the panel says so until one of them is renamed."""
    drawn = ours("scene.link_objects").namesakes
    yield from hover_view(gui)
    yield from gui.key("D", "shift")
    yield from gui.key("RET")
    yield from gui.redraw(2)
    copy = bpy.context.view_layer.objects.active
    assert drawn(copy, bpy.context.scene) == ["sample_wrist"] and drawn(link(), bpy.context.scene) == [copy.name]
    yield from find(gui, "skin_calib.link")
    yield from gui.shot("copy.png")
    copy.skin_calib.link = "other"
    assert not drawn(copy, bpy.context.scene)
    yield from gui.redraw(2)
    yield from gui.shot("renamed.png")
    with gui.context():
        bpy.ops.object.delete()
    bpy.context.view_layer.objects.active = link()
    yield from gui.redraw(2)


def warns_of_a_file_without_taxels(gui):
    """The export of a link without skins writes its surface, and says that there is no taxel."""
    path = gui.out / "bare.calibration.json"
    path.unlink(missing_ok=True)
    yield from run(gui, "skin_remove", index=0)
    yield from press(gui, "skin_calib.export_calibration")
    yield from gui.choose_file(path)
    yield from gui.wait(path.exists, 60, "the exported file")
    yield from gui.redraw(2)
    yield from gui.shot("exported.png")
    assert not any(patch["taxels"]["id"] for patch in json.loads(path.read_text())["patches"])
    assert any("has no taxels" in text for _, text in reports()), reports()


def fits_once_at_a_time(gui):
    """While a fit runs the button is grey, and so is the export; Live waits. The fit ends only after that was seen."""
    results, seen, begun = ours("scene.results"), Event(), []
    compute = results.fit

    def after_seen(*given):
        begun.append(given)
        seen.wait()
        return compute(*given)

    fit = yield from find(gui, "skin_calib.fit")
    results.fit = after_seen
    try:
        yield from gui.click(*fit)
        yield from gui.wait(fits, 60, "a fit in a thread")
        link().modifiers.new("finer", "SUBSURF").levels = 2
        plan().live = True
        with gui.context():
            assert not bpy.ops.skin_calib.fit.poll() and not bpy.ops.skin_calib.export_calibration.poll()
        for _ in range(3):
            yield from gui.click(*fit)
            yield from gui.redraw()
            assert fits() == 1, fits()
        yield 1.0  # longer than Live waits after a change
        assert len(begun) == 1, len(begun)
    finally:
        seen.set()
        results.fit = compute
    yield from gui.wait(lambda: not fits(), 300, "the fit")
    yield from gui.wait(lambda: plan().result.key and not plan().result.outdated, 300, "the result")
    with gui.context():
        assert bpy.ops.skin_calib.fit.poll() and bpy.ops.skin_calib.export_calibration.poll()
    plan().live = False
    link().modifiers.clear()
    yield from gui.redraw(2)


def fits():
    """Return how many fits run."""
    return sum(op.bl_idname == "SKIN_CALIB_OT_fit" for op in bpy.context.window.modal_operators)
