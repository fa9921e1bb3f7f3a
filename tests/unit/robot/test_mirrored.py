"""Links that are like others: bodies with known reflections, and both sides of real robots."""

import numpy as np

from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.mesh.triangle_mesh import weld
from skin_calib_addon.robot.kinematics import link_poses
from skin_calib_addon.robot.mirrored import find_twins, symmetry
from skin_calib_addon.robot.urdf import Joint, Robot
from tests.shapes import box, cylinder, subdivided, together, wrist


def moved(mesh, transform):
    """The mesh after a motion or a reflection."""
    return weld(mesh.vertices @ transform[:3, :3].T + transform[:3, 3], mesh.faces)


def model(*joints):
    """A robot without mesh files."""
    names = ["base", *(joint.child for joint in joints)]
    return Robot("robot.urdf", dict.fromkeys(names, ()), "robot", {joint.name: joint for joint in joints})


TURNED = (0.4, -0.3, 1.1)  # roll, pitch, yaw of the right side, which is not that of the left side
SIDES = model(
    Joint("l", "revolute", "base", "left", (0.05, 0.2, 0.1)),
    Joint("r", "revolute", "base", "right", (0.05, -0.2, 0.1), TURNED),
    Joint("n", "fixed", "base", "nose", (0.1, 0.0, 0.0)),
)
ACROSS = np.diag((1.0, -1.0, 1.0, 1.0))


def right_of(left):
    """The mesh of the right link that mirrors the left one, and the reflection between their frames."""
    poses = link_poses(SIDES)
    transform = np.linalg.inv(poses["right"]) @ ACROSS @ poses["left"]
    return moved(left, transform), transform


def test_a_mirrored_link_is_found_with_other_faces():
    """Four times as many faces, in a link frame of its own; the transform takes each vertex to its image."""
    right, transform = right_of(wrist())
    twins = find_twins(SIDES, {"left": wrist(), "right": subdivided(right), "nose": cylinder(0.01, 0.02)})
    assert list(twins) == ["right"] and twins["right"].link == "left"
    assert twins["right"].is_mirrored
    np.testing.assert_allclose(twins["right"].transform, transform, atol=1e-12)
    image = wrist().vertices @ transform[:3, :3].T + transform[:3, 3]
    assert closest(subdivided(right), image)[0].max() < 1e-9


def test_a_link_that_differs_has_no_twin():
    """The same size, but not a mirror image: the left wrist in the right frame; or with a pin of 10 mm."""
    right, transform = right_of(wrist())
    for other in (
        moved(wrist(), transform @ ACROSS),
        together(right, moved(box((0.04, 0, 0.05), (0.06, 0.01, 0.06)), transform)),
    ):
        assert find_twins(SIDES, {"left": wrist(), "right": other}) == {}


def test_equal_links_are_found_where_none_is_mirrored():
    """Three equal wheels: the right one mirrors the left one, the nose equals it."""
    wheel = cylinder(0.02, 0.01)
    right, _ = right_of(wheel)
    twins = find_twins(SIDES, {"left": wheel, "right": right, "nose": subdivided(wheel)})
    assert {name: (twin.link, twin.is_mirrored) for name, twin in twins.items()} == {
        "right": ("left", True),
        "nose": ("left", False),
    }
    np.testing.assert_array_equal(twins["nose"].transform, np.eye(4))


def test_a_mirrored_link_may_have_fewer_faces_but_an_equal_one_must_be_equal():
    """Chords of a third of the faces are 0.1 to 0.2 mm off; so is a wheel with a radius 0.2 mm larger."""
    fine, coarse = cylinder(0.03, 0.05, around=96), cylinder(0.03, 0.05, around=28)
    twins = find_twins(SIDES, {"left": fine, "right": right_of(coarse)[0]})
    assert list(twins) == ["right"]
    assert find_twins(SIDES, {"left": fine, "nose": cylinder(0.0302, 0.05)}) == {}
    assert list(find_twins(SIDES, {"left": fine, "nose": fine})) == ["nose"]


def test_plane_of_symmetry_is_that_of_most_links():
    """Across x, y or z, and off the root; a robot without partners has the plane y = 0."""
    side = np.array([(0, 0.1, 0), (0.02, 0.2, 0.3), (0.1, 0.3, -0.2)])
    middle = np.array([(0.0, 0, 0), (0.05, 0, 0.2)])
    for axis in range(3):
        links = np.roll(np.concatenate((middle, side, side * (1, -1, 1))), axis - 1, axis=1)
        links[:, axis] += 0.03
        image = links @ symmetry(links)[:3, :3].T + symmetry(links)[:3, 3]
        np.testing.assert_allclose(image[:, axis], 0.06 - links[:, axis], atol=1e-15)
        np.testing.assert_array_equal(np.delete(image, axis, 1), np.delete(links, axis, 1))
    np.testing.assert_array_equal(symmetry(side), ACROSS)


def test_partners_are_5_mm_from_the_mirror_image():
    """Links that are 4 mm off have a plane of symmetry across x; 6 mm off they do not."""
    side = np.array([(0.1, 0.1, 0), (0.2, 0.02, 0.3)])
    for shift, across in ((4e-3, 0), (6e-3, 1)):
        links = np.concatenate((side, side * (-1, 1, 1) + (0, shift, 0)))
        assert symmetry(links)[across, across] == -1
