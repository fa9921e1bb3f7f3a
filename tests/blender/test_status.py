"""The status of a link: what is missing, why a fit is refused, the worst warning, and the button that mends it."""

import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from skin_calib_addon.common import errors
from tests.blender.conftest import modules
from tests.blender.test_registration import Layout, draw
from tests.examples import slow
from tests.unit.test_docs import TROUBLES


@pytest.fixture
def advice(extension):
    """Return the module with the actions."""
    return modules(extension, "live.advice").advice


def refused(bpy):
    """Press Fit, which is refused."""
    with pytest.raises(RuntimeError):
        bpy.ops.skin_calib.fit()


def press(bpy, advice, link, index=0):
    """Press the first button that is offered for a warning."""
    warning = advice.warning_at(link, index)
    action, properties = next(advice.offered(warning, link.skin_calib, 1.0))
    module, name = action.operator.split(".")
    assert getattr(getattr(bpy.ops, module), name)(**properties) == {"FINISHED"}
    return action.text


def test_every_action_is_that_of_a_code(advice):
    """The table has codes of warnings about fits, skins, meshes and touches, and errors of a fit."""
    text = TROUBLES.read_text("utf-8")
    codes = set(re.findall(r"^\| `([a-z-]+)`", text, re.MULTILINE))
    assert all(code in codes or hasattr(errors, code) for code in advice.ACTIONS)


def test_every_action_is_an_operator(bpy, advice):
    """Blender has the operators of the table."""
    for actions in advice.ACTIONS.values():
        for action in actions:
            module, name = action.operator.split(".")
            assert getattr(getattr(bpy.ops, module), name).get_rna_type().description


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7])
def test_long_list_of_warnings_is_folded_to_a_line(bpy, link, count):
    """Up to three warnings have a list and the selected one in full. More are one line with its buttons; it opens."""
    bpy.ops.skin_calib.fit()
    for k in range(count):
        record = link.skin_calib.result.warnings.add()
        record.code, record.severity, record.message = "off-mesh", "warning", f"Warning number {k}"
        record.has_point = True
    link.skin_calib.result.warning_index = count - 1
    in_full = f"Warning number {count - 1}"
    shown = draw(bpy, "status")
    assert ("warning_index" in shown) == (1 < count <= 3)
    assert (in_full in shown) == (count <= 3) and "Show" in shown
    link.skin_calib.steps.warnings = True
    shown = draw(bpy, "status")
    assert ("warning_index" in shown) == (count > 1) and in_full in shown and "Show" in shown


def test_refused_fit_leaves_its_reason_until_a_change(bpy, link, updates):
    """The reason is in the status after Fit; an edit of the plan removes it."""
    link.skin_calib.grid.margin = 0.05
    refused(bpy)
    shown = draw(bpy, "status")
    assert shown[0] == "The fit is refused" and "50 mm" in " ".join(shown)
    assert "Widen the Margin" not in shown  # the margin is what is wrong
    link.skin_calib.grid.margin = 0.004
    while updates.tick() == updates.POLL_INTERVAL:
        pass
    assert draw(bpy, "status")[0] == "Not fitted: press Propose or Fit"
    bpy.ops.skin_calib.fit()
    assert re.match(r"Mean 0\.\d{4} mm, 6 taxels", draw(bpy, "status")[0])


def test_refusal_stays_while_plan_and_mesh_are_the_same(bpy, link, updates):
    """Undo of something else keeps it. Undo of a change of plan or mesh removes it, and redo brings it back."""

    def state():
        while updates.tick() == updates.POLL_INTERVAL:
            pass
        return draw(bpy, "status")[0]

    bpy.ops.ed.undo_push(message="start")
    for change in ("plan", "mesh"):
        bpy.context.object.skin_calib.skins[0].rows = 14
        if change == "mesh":
            bpy.context.object.scale *= 0.9
        bpy.ops.ed.undo_push(message=change)
        refused(bpy)
        bpy.context.object.skin_calib.inspect.text_size += 1
        bpy.ops.ed.undo_push(message="text")
        bpy.ops.ed.undo()
        assert state() == "The fit is refused", change
        bpy.ops.ed.undo()
        assert state() != "The fit is refused", change
        bpy.ops.ed.redo()
        assert state() == "The fit is refused", change


@pytest.mark.parametrize("change", [slow("fit"), "mesh", slow("skin"), "plan"])
def test_refused_proposal_is_shown_until_a_change(bpy, link, updates, change):
    """A fit, another mesh, skin or plan removes the refusal; until then the warnings of the last fit are below it."""
    link.skin_calib.skins.clear()
    bpy.ops.skin_calib.fit()
    record = link.skin_calib.result.warnings.add()
    record.severity, record.message = "warning", "A warning of the fit"
    bpy.context.scene.skin_calib.skin = "hexagons:300mm"
    with pytest.raises(RuntimeError, match="No skin fits"):
        bpy.ops.skin_calib.propose()
    shown = " ".join(draw(bpy, "status"))
    assert shown.index("No skin fits") < shown.index("A warning of the fit")
    if change == "fit":
        bpy.ops.skin_calib.fit()
    elif change == "mesh":
        link.scale *= 0.9
        bpy.context.view_layer.update()
        updates.tick()
    elif change == "skin":
        bpy.context.scene.skin_calib.skin = "hexagons:8mm"
    else:
        link.skin_calib.grid.n += 1
    assert "No skin fits" not in " ".join(draw(bpy, "status"))


def test_overlapping_sheet_loses_the_columns_that_overlap(bpy, link, advice):
    """A sheet longer than the circumference is refused; the button removes as many columns as makes it close."""
    skin = link.skin_calib.skins[0]
    skin.columns = 26
    refused(bpy)
    warning = advice.warning_at(link, advice.REFUSAL)
    assert warning.code == "overlap" and warning.where.point is not None and "Show" in draw(bpy, "status")
    assert press(bpy, advice, link, advice.REFUSAL) == "Fewer Cells"
    assert 18 <= skin.columns < 26 and bpy.ops.skin_calib.fit() == {"FINISHED"}
    assert "overlap" not in {w.code for w in link.skin_calib.result.warnings}


def test_sheet_beyond_the_edge_is_trimmed(bpy, link, advice):
    """The refusal has the place of the first cell outside; the button trims the sheet."""
    link.skin_calib.skins[0].rows = 14
    refused(bpy)
    warning = advice.warning_at(link, advice.REFUSAL)
    assert warning.code == "OutsideSurface" and warning.where.skin == "band"
    assert warning.where.point[2] < 0.03 or warning.where.point[2] > 0.09  # at an end of the link, in metres
    assert press(bpy, advice, link, advice.REFUSAL) == "Trim the Sheet"
    assert bpy.ops.skin_calib.fit() == {"FINISHED"} and link.skin_calib.result.taxels > 6


def test_open_section_offers_a_sector(bpy, link, advice):
    """Half a tube has no closed section: the refusal has the place of the gap, and the button makes it a sector."""
    cut = link.skin_calib.cover.cuts.add()
    cut.point, cut.normal = (0.005, 0, 0.06), (1, 0, 0)
    refused(bpy)
    assert advice.warning_at(link, advice.REFUSAL).where.point is not None
    assert "Do What It Advises" in draw(bpy, "status")
    assert bpy.ops.skin_calib.take_advice(index=advice.REFUSAL) == {"FINISHED"}
    assert link.skin_calib.grid.kind == "sector" and bpy.ops.skin_calib.fit() == {"FINISHED"}


def test_advice_that_does_not_help_changes_nothing_and_is_followed_by_the_next(bpy, link, advice):
    """Half a tube on the other side of the first sector: neither a sector nor a margin mends it, so a proposal does."""
    cut = link.skin_calib.cover.cuts.add()
    cut.point, cut.normal = (-0.005, 0, 0.06), (-1, 0, 0)
    refused(bpy)
    margin = link.skin_calib.grid.margin
    for text in ("Use a Sector", "Widen the Margin"):
        offers = advice.offered(advice.warning_at(link, advice.REFUSAL), link.skin_calib, 1.0)
        assert next(offers)[0].text == text and "Do What It Advises" in draw(bpy, "status")
        assert any("press Propose" in shown for shown in draw(bpy, "status"))
        assert bpy.ops.skin_calib.take_advice(index=advice.REFUSAL) == {"CANCELLED"}
        assert link.skin_calib.grid.kind == "tube" and link.skin_calib.grid.margin == margin
    (action, _), *others = advice.offered(advice.warning_at(link, advice.REFUSAL), link.skin_calib, 1.0)
    assert action.text == "Propose" and not others
    assert not any("press Propose" in text for text in draw(bpy, "status"))
    link.skin_calib.grid.n += 1
    refused(bpy)  # what was tried on another plan may help now
    assert next(advice.offered(advice.warning_at(link, advice.REFUSAL), link.skin_calib, 1.0))[0].text == "Use a Sector"


def test_show_marks_the_place_of_a_warning_over_everything(bpy, link, advice, extension):
    """Show puts a cross there, in millimetres of the scene, too; again it removes it; the next fit removes it."""
    drawing = modules(extension, "overlay.drawing").drawing
    bpy.context.scene.unit_settings.scale_length = 1.0
    bpy.ops.skin_calib.fit()
    record = link.skin_calib.result.warnings.add()
    record.code, record.severity, record.has_point, record.point = "off-mesh", "warning", True, (0.04, 0.01, 0.06)
    bpy.ops.skin_calib.show_warning(index=0)
    (mark,) = [layer for layer in drawing.shown_layers(link) if layer.what == "PLACE"]
    assert mark.on_top
    assert_allclose(mark.points.mean(axis=0), (0.04, 0.01, 0.06), atol=1e-6)
    assert_allclose(bpy.context.scene.cursor.location, (0.04, 0.01, 0.06), atol=1e-6)
    bpy.ops.skin_calib.show_warning(index=0)
    assert not any(layer.what == "PLACE" for layer in drawing.shown_layers(link))
    bpy.ops.skin_calib.show_warning(index=0)
    bpy.ops.skin_calib.cut_add(**advice.CUT.properties(advice.warning_at(link, 0), link.skin_calib, 1.0))
    assert_allclose(link.skin_calib.cover.cuts[0].point, (0.04, 0.01, 0.06), atol=1e-6)
    bpy.ops.skin_calib.fit()
    assert not any(layer.what == "PLACE" for layer in drawing.shown_layers(link))


def test_mark_goes_with_its_warning(bpy, link, updates, extension):
    """That of a refusal after a change of the plan; that of a fit after a refusal, also when this one has ended."""
    drawing = modules(extension, "overlay.drawing").drawing

    def is_marked():
        return any(layer.what == "PLACE" for layer in drawing.shown_layers(link))

    def change(rows):
        link.skin_calib.skins[0].rows = rows
        while updates.tick() == updates.POLL_INTERVAL:
            pass

    bpy.ops.skin_calib.fit()
    record = link.skin_calib.result.warnings.add()
    record.code, record.severity, record.has_point, record.point = "off-mesh", "warning", True, (0.04, 0.01, 0.06)
    bpy.ops.skin_calib.show_warning(index=0)
    change(14)
    assert is_marked()  # the warning is still listed, as one of the last fit
    refused(bpy)
    assert not is_marked()
    bpy.ops.skin_calib.show_warning(index=-1)
    assert is_marked()
    refused(bpy)
    assert not is_marked()
    bpy.ops.skin_calib.show_warning(index=-1)
    change(2)
    assert not is_marked()


def icons_of(bpy, extension, warning):
    """Return the icons that are drawn for a warning."""
    icons = []

    class Icons(Layout):
        def label(self, text, icon="NONE"):
            icons.append(icon)

        def _part(self, **_):
            return self

        column = _part

    sys.modules[f"{extension}.panels.base"].show_warning(Icons(bpy, []), warning)
    return icons


def test_refusal_has_the_icon_of_an_error(bpy, extension, advice):
    """As in the state above it; a warning has the triangle."""
    icons = [icons_of(bpy, extension, advice.Warning("code", s, "text"))[0] for s in ("error", "warning", "note")]
    assert icons == ["CANCEL", "ERROR", "CHECKMARK"]


def test_row_of_a_long_warning_ends_with_an_ellipsis(bpy, extension):
    """Blender would cut the middle, where the figure is. Names of surfaces, which are long, are left out."""
    shown, listed = [], sys.modules[f"{extension}.panels.status"].SKIN_UL_warnings
    long, short = "The surface is 5.2 mm off the mesh at (14.0, -28.8, 67.0) mm.", "Short."
    for message, surface in ((long, ""), (short, ""), (f"Surfaces 'left', 'right': {long}", "left")):
        record = SimpleNamespace(message=message, severity="warning", surface=surface)
        listed.draw_item(None, None, Layout(bpy, shown), None, record, 0, None, "", 0)
    assert shown[0].startswith("The surface is 5.2 mm") and shown[0].endswith("…")
    assert shown[1:] == [short, shown[0]]


def test_check_and_state_give_each_text_once(bpy, link, extension):
    """A refusal, the first warning of a fit, and what is wrong with the mesh and the first warning of the fit."""
    diagnoses = modules(extension, "live.diagnoses").diagnoses
    link.skin_calib.grid.margin = 0.05
    bpy.ops.skin_calib.diagnose()
    assert " ".join(draw(bpy, "work")).count("A margin of 50 mm") == 1
    refused(bpy)
    shown = " ".join(draw(bpy, "work"))
    assert shown.count("A margin of 50 mm") == 1 and "Fit is refused: see the reason above" in shown
    link.skin_calib.grid.margin = 0.004
    link.skin_calib.skins[0].columns, link.skin_calib.skins[0].overlap = 24, True
    bpy.ops.skin_calib.diagnose()
    assert " ".join(draw(bpy, "work")).count("overlaps itself") == 1
    bpy.ops.skin_calib.fit()
    shown = " ".join(draw(bpy, "work"))
    assert shown.count("overlaps itself") == 1 and "These settings fit" in shown
    fit = diagnoses.Warning("fit", "warning", "These settings fit: mean error 1 mm, 1 warning. A vertex.")
    parts, vertex = (diagnoses.Warning(c, "warning", t) for c, t in (("parts", "2 parts"), ("outlier", "A vertex.")))
    assert diagnoses.not_repeated((vertex, parts, fit)) == [parts, fit]


@pytest.mark.parametrize("kind", ["tube", "auto"])
def test_thin_sheet_offers_the_face_of_its_message(bpy, advice, tmp_path, kind):
    """The refusal has a place on that side; the button puts the planes across it, and the fit succeeds."""
    trimesh.creation.box((0.05, 0.002, 0.09)).subdivide().export(tmp_path / "sensor.ply")
    bpy.ops.skin_calib.import_mesh(filepath=str(tmp_path / "sensor.ply"), unit="m")
    link = bpy.context.object
    link.skin_calib.grid.kind = kind
    refused(bpy)
    warning = advice.warning_at(link, advice.REFUSAL)
    assert "thin sheet" in warning.message and "Show" in draw(bpy, "status")
    assert press(bpy, advice, link, advice.REFUSAL) == "Use Across"
    grid = link.skin_calib.grid
    assert (grid.region if kind == "auto" else grid.kind) == "across"
    assert_allclose(np.abs(grid.normal), (0, 1, 0))
    assert_allclose(warning.where.point[1], 0.001 * grid.normal[1], atol=1e-6)
    assert bpy.ops.skin_calib.fit() == {"FINISHED"}


SEEN, OPPOSITE, ABOVE = (0.04, 0.01, 0.06), (-0.034, 0.01, 0.06), (0.004, 0.01, 0.1005)  # on the link [m], from +x


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
@pytest.mark.parametrize("place", [SEEN, OPPOSITE, ABOVE])
def test_show_turns_the_view_to_hidden_places_only(bpy, link, kind, place):
    """The view shows a hidden place from outside and upright, at the same distance.

    The link lies in a cube, which local view hides, as in Blender's start scene.
    """
    bpy.ops.skin_calib.fit()
    record = link.skin_calib.result.warnings.add()
    record.code, record.severity, record.has_point, record.point = "off-mesh", "warning", True, place
    bpy.ops.mesh.primitive_cube_add(size=1000)
    link.select_set(True)
    bpy.context.active_object.select_set(False)
    bpy.context.view_layer.objects.active = link
    area = next(area for area in bpy.context.window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    view = area.spaces.active.region_3d
    with bpy.context.temp_override(area=area, region=region):
        bpy.ops.view3d.localview(frame_selected=False)
        view.view_perspective, view.view_distance = kind, 200.0
        view.view_rotation = type(view.view_location)((1, 0, 0.3)).to_track_quat("Z", "Y")
        before = view.view_rotation.copy()
        bpy.ops.skin_calib.show_warning(index=0)
    right, up, ahead = (view.view_rotation @ type(view.view_location)(axis) for axis in np.eye(3))
    assert_allclose(view.view_location, bpy.context.scene.cursor.location, atol=1e-3)
    assert view.view_distance == 200.0 and abs(right.z) < 1e-5 and up.z >= -1e-5
    if place == OPPOSITE:
        assert ahead.x < -0.95
    else:
        assert view.view_rotation == before


def test_first_fit_closes_the_steps_before_the_skin_once(bpy, link):
    """Link, mesh, grid and fit close and the skin opens; what the author opens afterwards stays open."""
    steps = link.skin_calib.steps
    assert steps.link and steps.grid and not steps.skin
    bpy.ops.skin_calib.fit()
    assert not (steps.link or steps.mesh or steps.cut or steps.grid or steps.fit) and steps.skin and steps.export
    steps.grid, steps.skin = True, False
    link.skin_calib.grid.n = 6
    bpy.ops.skin_calib.fit()
    assert steps.grid and not steps.skin


def test_copy_of_a_link_is_named_in_the_status(bpy, link):
    """Also after the fit, which closes the step with the name; not after one is renamed."""
    bpy.ops.skin_calib.fit()
    copy = link.copy()
    bpy.context.collection.objects.link(copy)
    assert draw(bpy, "status")[0] == f"{copy.name} has the same link name"
    copy.skin_calib.link = "other"
    assert draw(bpy, "status")[0].startswith("Mean")


def test_closed_steps_have_a_warning_sign_for_their_warnings(bpy, link, extension):
    """No tick where the surface, the check or a skin has a warning; the check says nothing after a change."""
    work = sys.modules[f"{extension}.panels.work"].SKIN_PT_work
    mesh, fit, skin = (next(s for s in work.steps if s.label == label) for label in ("Mesh", "Fit", "Skin"))
    plan = link.skin_calib
    bpy.ops.skin_calib.diagnose()
    bpy.ops.skin_calib.fit()
    assert mesh.figure(plan) == "checked" and not any(step.has_warnings(plan) for step in (mesh, fit, skin))
    for named in ("", "band"):
        record = plan.result.warnings.add()
        record.severity, record.skin = "warning", named
    finding = plan.diagnosis.findings.add()
    finding.severity = "warning"
    assert mesh.figure(plan) == "1 warning" and all(step.has_warnings(plan) for step in (mesh, fit, skin))
    plan.grid.n += 1
    assert mesh.figure(plan) == "" and not fit.is_done(plan)


def test_worst_warning_comes_first(bpy, link, extension):
    """Records are sorted by severity, in their order otherwise."""
    written = modules(extension, "scene.warnings").warnings
    records = link.skin_calib.result.warnings
    written.write_warnings(
        records, [written.Warning(f"c{k}", s, "") for k, s in enumerate(("note", "warning", "error"))]
    )
    assert [record.severity for record in records] == ["error", "warning", "note"]


def test_tab_of_several_links_is_drawn_whole(bpy, link, plan_file):
    """With two links the list is above the steps of the active one, open and closed, also if none is active."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file("hand")))
    shown = draw(bpy, "work")
    assert shown.index("Propose All") < shown.index("Check Mesh") < shown.index("Export Skin Calibration")
    assert draw(bpy, "work", is_open=False) == ["Not fitted: press Propose or Fit", "Propose", "Fit", "live"]
    bpy.context.view_layer.objects.active = None
    assert "Propose All" in draw(bpy, "work") and "Import Robot" in draw(bpy, "work")


def test_closed_list_of_links_counts_current_fits(bpy, link, plan_file):
    """A link that has changed after its fit does not count, as in the list."""
    bpy.ops.skin_calib.fit()
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file("hand")))
    step = bpy.types.SKIN_PT_work.robot
    assert step.figure(None) == "1 of 2 fitted"
    link.skin_calib.grid.n += 1
    assert step.figure(None) == "0 of 2 fitted" and not step.is_done(None)


def test_long_figure_leaves_space_for_its_label(bpy, link, monkeypatch):
    """The end of a long link name is left out next to the label of the closed step; a short one is there in full."""
    monkeypatch.setattr(Layout, "panel_prop", lambda self, *_: (self, None))
    step = next(step for step in bpy.types.SKIN_PT_work.steps if step.label == "Link")
    for name in ("arm", "left_shoulder_pitch_upper_arm_cover_link"):
        link.skin_calib.link = name
        layout = Layout(bpy, [])
        step.draw(layout, link.skin_calib)
        label, figure = layout.shown
        assert label == "Link" and len(f"{label} {figure}") <= 34
        assert figure == name if name == "arm" else figure[-1] == "…" and name.startswith(figure[:-1])


def test_hidden_link_says_so(bpy, link):
    """Its surface and the marks of Show are hidden, too: without a word the view was empty."""
    assert not any("hidden in this view" in words for words in draw(bpy, "status"))
    link.hide_set(True)
    assert "The link is hidden in this view, with its surface and its marks" in " ".join(draw(bpy, "status"))


def test_link_of_another_file_says_so(bpy, link, tmp_path):
    """It cannot be fitted; the state asked to press the buttons that are not available."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "link.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(str(tmp_path / "link.blend"), link=True) as (_, wanted):
        wanted.objects = ["arm"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    bpy.context.view_layer.objects.active = wanted.objects[0]
    shown = " ".join(draw(bpy, "status"))
    assert "This link belongs to another file" in shown and "press Propose" not in shown


@pytest.mark.parametrize("wrong", ["single", "group", "direction", "cells"])
def test_refused_skin_does_not_advise_a_proposal(bpy, link, wrong):
    """It would replace the plan, and the surface is right: the name of the skin is at the refusal."""
    (skin,) = link.skin_calib.skins
    if wrong == "single":
        skin.taxels.add().taxel = "0.9"
    elif wrong == "direction":
        skin.direction = (0, 0, 0)
    else:
        skin.kind, skin.choice = "hexagons", "listed"
        skin.cells, skin.zone_group = ("0,0", "missing") if wrong == "group" else ("x", "")
    refused(bpy)
    assert not any("press Propose" in shown for shown in draw(bpy, "status"))
    link.skin_calib.skins.clear()
    link.skin_calib.cover.cuts.add().normal = (0, 0, 0)
    refused(bpy)
    assert any("press Propose" in shown for shown in draw(bpy, "status"))
