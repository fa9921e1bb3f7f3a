"""Exported data are in metres in the link frame, for any pose of the object and its parent."""

import json
from math import radians

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.blender.conftest import ROOT
from tests.blender.test_registration import draw
from tests.examples import slow


@pytest.fixture
def made(bpy, link):
    """Return the link as an object that the author made, or that an older version imported: without an empty."""
    bpy.data.objects.remove(link.parent)
    link.skin_calib.imported_box = [0.0] * 6
    bpy.context.view_layer.update()
    return link


def frame_for(bpy, link, scale=(1, 1, 1), keep=False):
    """Give the link a parent somewhere in the world.

    With ``keep`` the object stays in place, as with Blender's Parent.
    """
    frame = bpy.data.objects.new("frame", None)
    bpy.context.scene.collection.objects.link(frame)
    frame.location, frame.rotation_euler, frame.scale = (0.3, -0.2, 0.9), (0.4, 1.1, -2.0), scale
    bpy.context.view_layer.update()
    link.parent = frame
    if keep:
        link.matrix_parent_inverse = frame.matrix_world.inverted()
    bpy.context.view_layer.update()
    return frame


def codes(data):
    """Return the codes of the warnings about the object."""
    return [
        w["code"] for w in json.loads(data)["warnings"] if w["code"] in ("moved-object", "scaled-object", "moved-mesh")
    ]


def without_warnings(data):
    """Return a calibration without the warnings, which can be of the scene."""
    return json.loads(data) | {"warnings": [], "checksum": ""}


def taxels(data):
    """Return positions and normals of the first patch."""
    table = json.loads(data)["patches"][0]["taxels"]
    return np.array(table["position"]), np.array(table["normal"])


@pytest.mark.parametrize("kind", ["link", "made"])
def test_pose_of_the_parent_does_not_matter_to_the_bit(bpy, request, kind, fit_scene):
    """The pose of the parent is that of the robot, and does not change the link."""
    link = request.getfixturevalue(kind)
    alone = fit_scene()
    frame = frame_for(bpy, link)
    assert fit_scene() == alone
    frame.location, frame.rotation_euler = (-1, 7, 0.1), (3, 2, 1)
    assert fit_scene() == alone


@pytest.mark.parametrize("kind", ["link", "made"])
def test_even_scale_of_the_parent_counts(bpy, request, kind, fit_scene):
    """A link in millimetres under a parent with the scale 0.001 has its displayed size."""
    link = request.getfixturevalue(kind)
    alone = taxels(fit_scene())
    frame_for(bpy, link, (0.001,) * 3)
    link.scale = (1000,) * 3
    for one, other in zip(alone, taxels(fit_scene())):
        assert_allclose(one, other, atol=1e-8)


@pytest.mark.parametrize("scale", [(-1, 1, 1), (-1, -1, -1), (1, 1, 2)])
def test_parent_that_is_no_frame_is_refused(bpy, link, scale):
    """A mirrored or stretched parent is not a rotation."""
    frame_for(bpy, link, scale)
    with pytest.raises(
        RuntimeError, match="frame, the parent of arm .* mirrored or has a scale that is not uniform. Apply its scale"
    ):
        bpy.ops.skin_calib.fit()


def test_parented_in_place_is_measured_from_the_parent(bpy, made, fit_scene):
    """Blender's Parent operator keeps the object in place: taxels change from world to parent axes, with a warning."""
    link, world = made, taxels(fit_scene())
    frame = frame_for(bpy, link, keep=True)
    to_link = np.array(frame.matrix_world.inverted())
    link.skin_calib.skins[0].direction = to_link[:3, :3] @ (0, 1, 0)
    data = fit_scene()
    assert codes(data) == ["moved-object"] and b"Apply > Parent Inverse" in data
    positions, normals = taxels(data)
    assert_allclose(positions, world[0] @ to_link[:3, :3].T + to_link[:3, 3], atol=1e-6)
    assert_allclose(normals, world[1] @ to_link[:3, :3].T, atol=1e-5)
    bpy.ops.object.parent_inverse_apply()
    bpy.ops.object.transform_apply()
    data = fit_scene()
    assert codes(data) == []
    assert_allclose(taxels(data)[0], positions, atol=1e-6)


def test_moved_and_turned_object_that_was_made_carries_its_taxels(bpy, made, fit_scene):
    """Without a parent the world is the link frame, and the pose of the object counts; its file has a warning."""
    link, before = made, taxels(fit_scene())
    link.location, link.rotation_euler = (0.1, -0.3, 0.02), (radians(20), radians(-35), radians(80))
    bpy.context.view_layer.update()
    placed = np.array(link.matrix_world)
    link.skin_calib.skins[0].direction = placed[:3, :3] @ (0, 1, 0)
    data = fit_scene()
    after, (warning,) = taxels(data), json.loads(data)["warnings"]
    assert warning["message"] == (
        "arm is moved by 316.9 mm and turned by 93.38 degrees from the origin of the world, its link frame. "
        "Its taxels move with it."
    )
    assert_allclose(after[0], before[0] @ placed[:3, :3].T + placed[:3, 3], atol=1e-6)
    assert_allclose(after[1], before[1] @ placed[:3, :3].T, atol=1e-5)


@pytest.mark.parametrize("scale", [(-1, 1, 1), slow((1, -1, 1)), slow((-1, -1, -1))])
def test_mirrored_object_keeps_outward_normals(bpy, made, fit_scene, fit_plainly, tmp_path, scale):
    """Normals of a mirrored mesh point outward, and its plan gives the same result without Blender."""
    link = made
    link.scale = scale
    middle = np.array([(link.matrix_basis @ v.co)[:] for v in link.data.vertices]).mean(axis=0)
    data = fit_scene()
    positions, normals = taxels(data)
    assert (np.einsum("ij,ij->i", positions - middle, normals) > 0.02).all()
    bpy.ops.skin_calib.export_plan(filepath=str(tmp_path / "mirrored.plan.json"))
    assert codes(data) == ["scaled-object"]
    assert without_warnings(fit_scene()) == without_warnings(fit_plainly(tmp_path / "mirrored.plan.json"))


@pytest.mark.parametrize("kind", ["link", "made"])
def test_placed_object_and_its_exported_plan_agree_to_the_bit(bpy, request, kind, fit_scene, fit_plainly, tmp_path):
    """The object is moved, turned, scaled and has a parent, in a scene of centimetres."""
    link = request.getfixturevalue(kind)
    bpy.context.scene.unit_settings.scale_length = 0.01
    frame_for(bpy, link, (2, 2, 2))
    link.location, link.rotation_euler, link.scale = (1.0, -3.0, 2.0), (0.3, 0.7, 0.2), (-49, 51, 50)
    link.skin_calib.grid.auto_margin = True
    link.skin_calib.skins[0].pitch = 0.85, 1.0
    bpy.ops.skin_calib.export_plan(filepath=str(tmp_path / "placed.plan.json"))
    data = fit_scene()
    assert codes(data) == ["moved-object", "scaled-object"]
    assert without_warnings(data) == without_warnings(fit_plainly(tmp_path / "placed.plan.json"))


def test_cut_starts_at_the_cursor(bpy, addon, link):
    """The cursor is in the world, the cut in the link frame."""
    frame = frame_for(bpy, link, (2, 2, 2))
    bpy.context.scene.cursor.location = (0.25, -0.1, 0.8)
    bpy.ops.skin_calib.cut_add()
    place, turn, _ = frame.matrix_world.decompose()
    point = turn @ link.skin_calib.cover.cuts[0].point + place
    assert_allclose(point, (0.25, -0.1, 0.8), atol=1e-6)


def test_modifiers_count(bpy, addon, link):
    """The mesh is the displayed one, with its modifiers, in object and in edit mode."""
    plain = addon.link_meshes.read_mesh(link, bpy.context)
    link.modifiers.new("finer", "SUBSURF").levels = 1
    assert len(addon.link_meshes.read_mesh(link, bpy.context).faces) == 6 * len(plain.faces)  # three quads of each
    link.modifiers.clear()
    bpy.ops.object.mode_set(mode="EDIT")
    assert addon.link_meshes.read_mesh(link, bpy.context).sha256 == plain.sha256


def test_link_switched_off_is_fitted_or_refused(bpy, link, fit_scene):
    """Blender does not evaluate modifiers of disabled objects.

    A link without any is fitted, one with some is refused.
    """
    seen = fit_scene()
    link.hide_viewport = True
    assert fit_scene() == seen
    link.modifiers.new("finer", "SUBSURF")
    refused = pytest.raises(RuntimeError, match="arm is disabled in the viewport, so its modifiers are not evaluated")
    with refused, bpy.context.temp_override(object=link):
        bpy.ops.skin_calib.fit()


IMPORTS = {
    "mesh": lambda bpy, path: bpy.ops.skin_calib.import_mesh("EXEC_DEFAULT", True, filepath=str(path / "arm.stl")),
    "plan": lambda bpy, path: bpy.ops.skin_calib.import_plan(
        "EXEC_DEFAULT", True, filepath=str(path / "arm.plan.json")
    ),
    "urdf": lambda bpy, path: bpy.ops.skin_calib.import_urdf(
        "EXEC_DEFAULT", True, filepath=str(path / "bot" / "urdf" / "bot.urdf"), link="lower"
    ),
}


@pytest.mark.parametrize("kind", IMPORTS)
def test_imported_link_has_an_empty_as_its_frame(bpy, addon, plan_file, urdf, tmp_path, kind):
    """The empty is at the origin of the world, the object at the empty; undo removes both."""
    plan_file()
    bpy.ops.ed.undo_push(message="start")
    assert IMPORTS[kind](bpy, tmp_path) == {"FINISHED"}
    link = bpy.context.object
    frame = link.parent
    assert frame.type == "EMPTY" and frame.name == f"{link.name}_frame" and not frame.skin_calib.link
    assert_allclose(frame.matrix_world, np.eye(4))
    assert link.users_collection == frame.users_collection and bpy.context.selected_objects == [link]
    assert addon.link_meshes.placement_warnings(link, 1.0) == ()
    bpy.ops.ed.undo()
    assert not bpy.data.objects


def test_moved_import_keeps_its_taxels_and_says_so(bpy, addon, link, fit_scene):
    """Its overlay moves with it; the state and the file say that its taxels do not; back in place, nothing is said."""
    assert bpy.ops.skin_calib.fit() == {"FINISHED"}
    before = fit_scene()
    link.location, link.rotation_euler = (0.15, 0, 0), (0, 0, radians(20))
    bpy.context.view_layer.update()
    assert_allclose(addon.link_meshes.link_frame(link), link.matrix_world, atol=1e-6)
    data = fit_scene()
    assert not link.skin_calib.result.outdated and without_warnings(data) == without_warnings(before)
    (warning,) = json.loads(data)["warnings"]
    words = (
        "arm is moved by 150 mm and turned by 20 degrees from arm_frame, its link frame. "
        "Its taxels do not move with it."
    )
    assert (warning["code"], warning["severity"], warning["message"]) == ("moved-object", "warning", words)
    assert words in " ".join(draw(bpy, "work"))
    bpy.ops.object.location_clear()
    bpy.ops.object.rotation_clear()
    assert fit_scene() == before and "moved" not in " ".join(draw(bpy, "work"))


def test_applied_move_moves_the_taxels_as_displayed(bpy, link, fit_scene):
    """Apply is how an author moves a mesh in its link frame."""
    before = taxels(fit_scene())[0]
    link.location = (0.15, 0, 0)
    bpy.ops.object.transform_apply()
    data = fit_scene()
    assert codes(data) == ["moved-mesh"]
    assert json.loads(data)["warnings"][0]["severity"] == "note"
    assert_allclose(taxels(data)[0], before + (0.15, 0, 0), atol=1e-7)


def test_edited_import_has_no_warning(bpy, addon, link):
    """A mesh without some of its faces is no smaller one, and not moved."""
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.bisect(plane_co=(0, 0, 0.05), plane_no=(0, 0, 1), clear_outer=True)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.update()
    assert link.dimensions.z < 0.04 and addon.link_meshes.placement_warnings(link, 1.0) == ()


@pytest.mark.parametrize(
    ("scale", "words"), [(1.3, "has the scale 1.3, which is no unit"), (0.01, ""), (-1, "mirrored")]
)
def test_scale_of_an_object_that_was_made_is_a_unit(addon, made, scale, words):
    """Its size at the start is not known: another scale has a warning."""
    made.scale = (scale,) * 3
    found = addon.link_meshes.placement_warnings(made, 1.0)
    assert [warning.code for warning in found] == ["scaled-object"] * bool(words)
    assert all(words in warning.message for warning in found)


def rescale(bpy, link, factor):
    link.scale = [factor * s for s in link.scale]


def scale_frame(bpy, link, factor):
    link.parent.scale = (factor,) * 3


def scale_to_delta(bpy, link, factor):
    rescale(bpy, link, factor)
    bpy.ops.object.transforms_to_deltas(mode="SCALE")


def scale_scene(bpy, link, factor):
    bpy.context.scene.unit_settings.scale_length = factor


def scale_applied(bpy, link, factor):
    rescale(bpy, link, factor)
    bpy.ops.object.transform_apply()


@pytest.mark.parametrize("act", [rescale, scale_frame, scale_to_delta, scale_scene, scale_applied])
@pytest.mark.parametrize("factor", [0.5, 10.0])
def test_other_size_than_at_the_import_has_a_warning(bpy, addon, link, act, factor):
    """By any act: of the object, its parent or the scene, and also after Apply."""
    act(bpy, link, factor)
    bpy.context.view_layer.update()
    metre = bpy.context.scene.unit_settings.scale_length
    side = np.ptp(addon.link_meshes.read_mesh(link, bpy.context).vertices, axis=0).max()
    assert side == pytest.approx(0.08 * factor, rel=1e-5)
    found = addon.link_meshes.placement_warnings(link, metre)
    assert [(w.code, w.message) for w in found] == [
        ("scaled-object", f"arm is {factor:g} times as large as it was at its import.")
    ]


@pytest.mark.parametrize("metre", [1.0, 0.001, 0.0254])
@pytest.mark.parametrize("unit", ["m", "cm", "mm", "in"])
def test_import_in_any_unit_has_no_warning(bpy, addon, plan_file, tmp_path, metre, unit):
    """In scenes of any unit, at once, after Apply, with another name, and after a move of the empty."""
    plan_file(numbers_in="mm")
    bpy.context.scene.unit_settings.scale_length = metre
    bpy.ops.skin_calib.import_mesh(filepath=str(tmp_path / "arm.stl"), unit=unit)
    link = bpy.context.object
    link.parent.location, link.parent.rotation_euler, link.name = (1, 2, 3), (1, 2, 3), "other"
    for apply in (False, True):
        if apply:
            bpy.ops.object.transform_apply()
        bpy.context.view_layer.update()
        assert addon.link_meshes.placement_warnings(link, metre) == ()


def test_scale_to_unit_is_no_resizing(bpy, addon, plan_file, tmp_path):
    """The button corrects the unit of the import."""
    plan_file(numbers_in="mm")
    bpy.ops.skin_calib.import_mesh(filepath=str(tmp_path / "arm.stl"), unit="m")
    bpy.ops.skin_calib.scale_to_unit(unit="mm")
    assert addon.link_meshes.placement_warnings(bpy.context.object, 1.0) == ()


def test_disabled_link_keeps_its_size_after_opening(bpy, addon, link, tmp_path):
    """Blender does not update the matrix of a disabled object: it is that of no object at all."""
    link.scale = (0.5,) * 3
    link.hide_viewport = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    link = bpy.data.objects["arm"]
    mesh = addon.link_meshes.read_mesh(link, bpy.context)
    assert np.ptp(mesh.vertices, axis=0).max() == pytest.approx(0.04, rel=1e-6)
    assert [warning.value for warning in addon.link_meshes.placement_warnings(link, 1.0)] == [pytest.approx(0.5)]


def test_scene_of_an_older_version_has_no_warning(bpy, addon):
    """It has no empty, and its object is at the origin."""
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "sample_scenes" / "wrist.blend"))
    (link,) = (thing for thing in bpy.data.objects if thing.skin_calib.link)
    assert link.parent is None and not addon.link_meshes.is_frame(link)
    assert addon.link_meshes.placement_warnings(link, bpy.context.scene.unit_settings.scale_length) == ()
