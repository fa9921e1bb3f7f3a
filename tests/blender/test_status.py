"""The status of a link: what is missing, why a fit is refused, the worst warning, and the button that mends it."""

import re
import sys

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from skin_calib_addon.common import errors
from tests.blender.conftest import modules
from tests.blender.test_registration import draw
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
    assert re.match(r"Mean 0\.\d{4} mm, 6 taxels on 5 of \d{3} cm² \(\d%\)", " ".join(draw(bpy, "status")))
    bpy.ops.skin_calib.skin_add(kind="sheet")
    skin = link.skin_calib.skins[1]
    skin.rows, skin.columns, skin.pitch = 2, 3, (0.0085, 0.01)
    bpy.ops.skin_calib.fit()  # their areas are no sum
    assert re.match(r"Mean 0\.\d{4} mm, 12 taxels, which overlap", " ".join(draw(bpy, "status")))


@pytest.mark.parametrize("change", [slow("mesh"), "plan"])
def test_refused_proposal_is_shown_until_a_change(bpy, link, updates, change):
    """Another mesh or plan removes the refusal; until then the warnings of the last fit are below it."""
    link.skin_calib.skins.clear()
    bpy.ops.skin_calib.fit()
    record = link.skin_calib.result.warnings.add()
    record.severity, record.message = "warning", "A warning of the fit"
    bpy.context.scene.skin_calib.skin = "hexagons:300mm"
    with pytest.raises(RuntimeError, match="No skin fits"):
        bpy.ops.skin_calib.propose()
    shown = " ".join(draw(bpy, "status"))
    assert shown.index("No skin fits") < shown.index("A warning of the fit")
    if change == "mesh":
        link.scale *= 0.9
        bpy.context.view_layer.update()
        updates.tick()
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
