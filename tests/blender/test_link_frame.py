"""Exported data are in metres in the link frame, for any pose of the object and its parent."""

import json
from math import radians

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.examples import slow


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


def taxels(data):
    """Return positions and normals of the first patch."""
    table = json.loads(data)["patches"][0]["taxels"]
    return np.array(table["position"]), np.array(table["normal"])


def test_pose_of_the_parent_does_not_matter_to_the_bit(bpy, link, fit_scene):
    """The pose of the parent is that of the robot, and does not change the link."""
    alone = fit_scene()
    frame = frame_for(bpy, link)
    assert fit_scene() == alone
    frame.location, frame.rotation_euler = (-1, 7, 0.1), (3, 2, 1)
    assert fit_scene() == alone


def test_even_scale_of_the_parent_counts(bpy, link, fit_scene):
    """A link in millimetres under a parent with the scale 0.001 has its displayed size."""
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


def test_parented_in_place_is_measured_from_the_parent(bpy, link, fit_scene):
    """Blender's Parent operator keeps the object in place: taxels change from world to parent axes."""
    world = taxels(fit_scene())
    frame = frame_for(bpy, link, keep=True)
    to_link = np.array(frame.matrix_world.inverted())
    link.skin_calib.skins[0].direction = to_link[:3, :3] @ (0, 1, 0)
    positions, normals = taxels(fit_scene())
    assert_allclose(positions, world[0] @ to_link[:3, :3].T + to_link[:3, 3], atol=1e-6)
    assert_allclose(normals, world[1] @ to_link[:3, :3].T, atol=1e-5)


def test_moved_and_turned_object_carries_its_taxels(bpy, link, fit_scene):
    """Without a parent the world is the link frame, and the pose of the object counts."""
    before = taxels(fit_scene())
    link.location, link.rotation_euler = (0.1, -0.3, 0.02), (radians(20), radians(-35), radians(80))
    bpy.context.view_layer.update()
    placed = np.array(link.matrix_world)
    link.skin_calib.skins[0].direction = placed[:3, :3] @ (0, 1, 0)
    after = taxels(fit_scene())
    assert_allclose(after[0], before[0] @ placed[:3, :3].T + placed[:3, 3], atol=1e-6)
    assert_allclose(after[1], before[1] @ placed[:3, :3].T, atol=1e-5)


@pytest.mark.parametrize("scale", [(-1, 1, 1), slow((1, -1, 1)), slow((-1, -1, -1))])
def test_mirrored_object_keeps_outward_normals(bpy, link, fit_scene, fit_plainly, tmp_path, scale):
    """Normals of a mirrored mesh point outward, and its plan gives the same result without Blender."""
    link.scale = scale
    middle = np.array([(link.matrix_basis @ v.co)[:] for v in link.data.vertices]).mean(axis=0)
    data = fit_scene()
    positions, normals = taxels(data)
    assert (np.einsum("ij,ij->i", positions - middle, normals) > 0.02).all()
    bpy.ops.skin_calib.export_plan(filepath=str(tmp_path / "mirrored.plan.json"))
    assert fit_scene() == fit_plainly(tmp_path / "mirrored.plan.json")


def test_placed_object_and_its_exported_plan_agree_to_the_bit(bpy, link, fit_scene, fit_plainly, tmp_path):
    """The object is moved, turned, scaled and has a parent, in a scene of centimetres."""
    bpy.context.scene.unit_settings.scale_length = 0.01
    frame_for(bpy, link, (2, 2, 2))
    link.location, link.rotation_euler, link.scale = (1.0, -3.0, 2.0), (0.3, 0.7, 0.2), (-49, 51, 50)
    link.skin_calib.grid.auto_margin = True
    link.skin_calib.skins[0].pitch = 0.85, 1.0
    bpy.ops.skin_calib.export_plan(filepath=str(tmp_path / "placed.plan.json"))
    assert fit_scene() == fit_plainly(tmp_path / "placed.plan.json")


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
