"""Combine two feet, and several links, in a body."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from skin_calib_addon.common.errors import UnknownLink
from skin_calib_addon.runtime import Body, Plane
from skin_calib_addon.runtime.poses import checked_pose, pose_from_mujoco, pose_from_quaternion, pose_from_se3
from tests.samples import sheet
from tests.soles import SIDE, counting_sole, skin_of, sole_patch

N = 42


def pose(x=0.0, y=0.0, z=0.0, yaw=0.0, pitch=0.0):
    """Return T_world_link."""
    c, s, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]) @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    full = np.eye(4)
    full[:3, :3], full[:3, 3] = turn, (x, y, z)
    return full


def feet(**options):
    """Return a body with two soles."""
    return Body({"left": skin_of(sole_patch()), "right": skin_of(sole_patch())}, **options)


def test_two_feet_on_flat_ground():
    """The ZMP is weighted by the loads, the polygon is around both feet, the wrench is the complete weight."""
    rng = np.random.default_rng(2)
    left, right = rng.uniform(0.5, 30, N), rng.uniform(0.5, 30, N)
    left[5] = right[7] = 0.0  # partial contact: forces act at the centres of the cells
    poses = {"left": pose(0.1, 0.1, 0, 0.3), "right": pose(-0.05, -0.1, 0, -0.2)}
    frame = feet().update({"left": left, "right": right}, 0.0, poses)
    assert frame.flags == frozenset() and frame.standing == ("left", "right") and frame.reason is None
    places, forces = [], []
    for name, reading in (("left", left), ("right", right)):
        p = skin_of(sole_patch()).positions @ poses[name][:3, :3].T + poses[name][:3, 3]
        places.append(p)
        forces.append(reading)
    places, forces = np.concatenate(places), np.concatenate(forces)
    assert_allclose(frame.zmp, forces @ places[:, :2] / forces.sum(), atol=1e-12)
    assert_allclose(frame.wrench[2], forces.sum())
    assert_allclose(frame.wrench[3:5], (forces @ places[:, 1], -forces @ places[:, 0]), atol=1e-9)
    for name in ("left", "right"):
        alone = frame.links[name].polygon.outer.corners
        world = np.column_stack((alone, 0 * alone[:, 0])) @ poses[name][:3, :3].T + poses[name][:3, 3]
        assert all(frame.polygon.outer.margin(c[:2]) > -1e-8 for c in world)
    assert frame.polygon.guaranteed.area < frame.polygon.nominal.area < frame.polygon.outer.area
    assert_allclose(frame.cop, frame.zmp, atol=1e-12)


def test_moments_within_the_cells_count_everywhere():
    """At full contact under a linear pressure, CoP, ZMP and the wrenches of both feet have the exact centre."""
    body = feet()
    x = body.skins["left"].positions[:, 0]
    pressed = 10 + 60 * x
    poses = {"left": pose(0.1, 0.1, 0, 0.3), "right": pose(-0.05, -0.1, 0, -0.2)}
    frame = body.update({"left": pressed, "right": pressed}, 0.0, poses)
    centre = np.array((60 * (x @ x / N + 5 * SIDE**2 / 24) / 10, 0, 0, 1))
    expected = np.mean([(poses[name] @ centre)[:2] for name in poses], axis=0)
    assert_allclose(frame.cop, expected, atol=1e-12)
    assert_allclose(frame.zmp, expected, atol=1e-12)
    assert_allclose((-frame.wrench[4], frame.wrench[3]), expected * frame.wrench[2], atol=1e-9)
    for link in frame.links.values():
        assert_allclose(link.wrench, sum(c.wrench for c in link.contacts), atol=1e-9)
        assert_allclose((-link.wrench[4] / link.wrench[2], link.wrench[3] / link.wrench[2]), link.cop, atol=1e-12)


def two_feet(rng):
    """Return two feet with noise, which know their baselines."""
    body = Body({name: counting_sole() for name in ("left", "right")})
    for skin in body.skins.values():
        skin.tare(np.rint(50 + 2 * rng.normal(size=(250, N))), accept=True)
    return body


def test_deviations_of_a_body_are_those_of_repeated_readings():
    """Of two feet, one with four times the load of the other, CoP and ZMP scatter as stated."""
    rng = np.random.default_rng(6)
    forces = {"left": np.full((250, N), 8.0), "right": np.full((250, N), 2.0)}
    readings = {name: np.rint(50 + rows / 0.2 + 2 * rng.normal(size=rows.shape)) for name, rows in forces.items()}
    body = two_feet(rng)
    poses = {"left": pose(y=0.1), "right": pose(y=-0.1)}
    frames = [body.update({n: rows[k] for n, rows in readings.items()}, 0.01 * k, poses) for k in range(250)]
    for name in ("cop", "zmp"):
        found = np.std([getattr(frame, name) for frame in frames], axis=0)
        stated = np.mean([getattr(frame, f"{name}_sigma") for frame in frames], axis=0)
        assert_allclose(stated, found, rtol=0.25)


def test_load_below_the_noise_of_a_foot_is_in_the_deviation():
    """The right foot carries 8 N, evenly, which its noise hides: the ZMP is off by more than that of the left foot."""
    rng = np.random.default_rng(7)
    forces, poses = {"left": 4.0, "right": 0.2}, {"left": pose(y=0.1), "right": pose(y=-0.1)}
    body = two_feet(rng)
    true, ratios = 0.1 * (4.0 - 0.2) / 4.2, []
    for k in range(100):
        readings = {n: np.rint(50 + f / 0.2 + 2 * rng.normal(size=N)) for n, f in forces.items()}
        frame = body.update(readings, 0.01 * k, poses)
        if frame.standing == ("left",):
            ratios.append(abs(frame.zmp[1] - true) / frame.zmp_sigma[1])
            hidden = frame.links["right"]
            assert hidden.load == 0 and hidden.load_sigma > 2 and hidden.wrench_sigma[2] > 2
    assert len(ratios) > 50 and max(ratios) < 3.5 and np.mean(ratios) < 1.3


def test_foot_in_the_air_is_left_out():
    """A foot in the air is not part of ZMP and polygon, and gives no flag."""
    body = feet()
    poses = {"left": pose(), "right": pose(0.2, -0.2, 0.05)}
    frame = body.update({"left": np.full(N, 10.0), "right": np.zeros(N)}, 0.0, poses)
    alone = body.skins["left"].update(np.full(N, 10.0), 0.1)
    assert frame.standing == ("left",) and frame.flags == frozenset()
    assert_allclose(frame.zmp, alone.zmp, atol=1e-12)
    assert_allclose(frame.polygon.outer.area, alone.polygon.outer.area, rtol=1e-6)
    nobody = body.update({"left": np.zeros(N), "right": np.zeros(N)}, 0.2, poses)
    assert nobody.zmp is None and nobody.cop is None and nobody.polygon.outer.kind == "empty"
    assert nobody.reason == "no link carries a load of 5 N, which a ZMP needs"


def test_feet_on_different_heights_are_flagged():
    """The ZMP of the complete wrench is correct on the given ground. The flag says that its region is not the hull."""
    poses = {"left": pose(0, 0.1, 0.1), "right": pose(0, -0.1, 0.0)}
    readings = {"left": np.full(N, 5.0), "right": np.full(N, 10.0)}
    frame = feet().update(readings, 0.0, poses)
    assert frame.flags == {"not_coplanar"}
    assert_allclose(frame.zmp, (0, -0.1 / 3), atol=1e-12)  # forces along z: height does not matter
    sloped = feet().update(readings, 0.0, {"left": pose(0, 0.1, 0, 0, 0.2), "right": pose(0, -0.1)})
    assert sloped.flags == {"not_coplanar"}
    raised = feet(ground=Plane.through((0, 0, 0.1), (0, 0, 1)))
    level = raised.update(readings, 0.0, {"left": pose(0, 0.1, 0.1), "right": pose(0, -0.1, 0.1)})
    assert level.flags == frozenset()


def test_height_of_both_feet_over_the_ground_is_no_step():
    """Two feet that drift together from the stated ground are still on one plane."""
    poses = {"left": pose(0, 0.1, 0.03), "right": pose(0, -0.1, 0.03)}
    frame = feet().update({"left": np.full(N, 5.0), "right": np.full(N, 10.0)}, 0.0, poses)
    assert frame.flags == frozenset()


def test_sloped_foot_shifts_the_zmp_by_its_shear():
    """The normal force of a tilted foot has a component along the ground, at a height.

    The general formula includes it.
    """
    tilted = pose(0.3, 0, 0.2, 0, 0.3)
    body = Body({"left": skin_of(sole_patch())})
    frame = body.update({"left": np.full(N, 5.0)}, 0.0, {"left": tilted})
    force = 210 * tilted[:3, 2]
    middle = tilted[:3, 3]
    assert_allclose(frame.zmp[0], middle[0] - middle[2] * force[0] / force[2], atol=1e-12)


def test_contact_of_a_foot_that_is_not_known_leaves_nothing_to_state():
    """ZMP, CoP, polygon and wrench are None with a reason: those of the other foot alone would be wrong."""
    body = feet()
    good, poses = np.full(N, 10.0), {"left": pose(0, 0.1), "right": pose(0, -0.1)}
    both = {"left": good, "right": good}
    cases = [
        ({"left": good}, poses, "right:no_reading", "it has no reading"),
        (both | {"right": good[:3]}, poses, "right:wrong_length", "the reading has 3 channels"),
        (both | {"right": good * np.nan}, poses, "right:blind", "no taxel has a valid reading"),
        (both, {"left": pose()}, "right:no_pose", "it has no pose"),
    ]
    for wrong in (np.eye(3), np.full((4, 4), np.nan), [[1, 2], [3]], "pose", None):
        cases.append((both, poses | {"right": wrong}, "right:no_pose", "it has no pose"))
    mirrored, shear = np.diag((1.0, -1.0, 1.0, 1.0)), np.eye(4)
    shear[0, 1] = 0.01
    for wrong in (
        2 * pose(),
        np.diag((2.0, 2, 2, 1)),
        mirrored,
        np.zeros((4, 4)),
        shear,
        1e200 * np.eye(4),
        -np.eye(4),
    ):
        cases.append((both, poses | {"right": wrong}, "right:wrong_pose", "its pose is not a rigid motion"))
    for k, (readings, where, flag, why) in enumerate(cases):
        frame = body.update(readings, 0.01 * k, where)
        assert flag in frame.flags and frame.standing == ("left",)
        assert frame.zmp is None and frame.cop is None and frame.polygon is None and frame.wrench is None
        assert frame.zmp_sigma is None and frame.cop_sigma is None
        assert f"'right' may stand, but its contact is not known: {why}" in frame.reason
    frame = body.update(both, 1.0, poses)
    assert frame.flags == {"left:dropped", "right:dropped"}
    assert frame.reason is None and frame.wrench[2] == 20 * N
    with pytest.raises(UnknownLink, match=r"no link 'foot' in this body; it has \['left', 'right'\]"):
        body.update({"foot": good}, 2.0, {})


def test_cycle_without_readings_or_poses_raises_no_error():
    """A bus or a model of the robot that delivers nothing: every contact is not known, with its reason."""
    both = {"left": np.full(N, 10.0), "right": np.full(N, 10.0)}
    for readings, problem in ((both, "no_pose"), (None, "no_reading")):
        frame = feet().update(readings, 0.0, None)
        assert {f"left:{problem}", f"right:{problem}"} <= frame.flags and frame.wrench is None


def test_free_foot_needs_no_pose():
    """Its reading states that it carries nothing; nothing else of it counts."""
    frame = feet().update({"left": np.full(N, 10.0), "right": np.zeros(N)}, 0.0, {"left": pose()})
    assert frame.flags == {"right:no_pose"} and frame.zmp is not None and frame.wrench[2] == 10 * N


def test_arm_whose_contact_is_not_known_does_not_stand():
    """It leaves the wrench unknown, but not the ZMP of the feet."""
    body = Body({"left": skin_of(sole_patch()), "arm": skin_of(sheet(4, 12, 0.01), link="arm")})
    frame = body.update({"left": np.full(N, 10.0)}, 0.0, {"left": pose(), "arm": pose()})
    assert frame.wrench is None and frame.zmp is not None and frame.polygon is not None and frame.reason is None


def test_poses_of_other_libraries():
    """SE(3) objects, MuJoCo's arrays, and quaternions in both orders give one matrix."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        turn, position = Rotation.random(rng=rng), rng.normal(size=3)
        expected = np.eye(4)
        expected[:3, :3], expected[:3, 3] = turn.as_matrix(), position
        se3 = SimpleNamespace(rotation=turn.as_matrix(), translation=position)
        x, y, z, w = 3.0 * turn.as_quat()
        found = [
            pose_from_se3(se3),
            pose_from_mujoco(position, turn.as_matrix().ravel()),
            pose_from_quaternion(position, (x, y, z, w), "xyzw"),
            pose_from_quaternion(position, (w, x, y, z), "wxyz"),
        ]
        assert_allclose(found, np.broadcast_to(expected, (4, 4, 4)), atol=1e-12)
        assert all(checked_pose(one)[1] is None for one in found)
        assert checked_pose(expected.astype(np.float32))[1] is None
    with pytest.raises(ValueError, match="must be 'xyzw' or 'wxyz', not 'wxzy'"):
        pose_from_quaternion((0, 0, 0), (1, 0, 0, 0), "wxzy")
    for wrong in ((0, 0, 0, 0), (np.nan, 0, 0, 1), (1, 0, 0)):
        with pytest.raises(ValueError, match="four finite numbers"):
            pose_from_quaternion((0, 0, 0), wrong, "wxyz")


def test_arm_adds_to_the_wrench_and_not_to_the_ground():
    """The skin of a limb has no ground: it adds to the wrench of the body, not to its ZMP and polygon."""
    body = Body({"left": skin_of(sole_patch()), "arm": skin_of(sheet(4, 12, 0.01), link="arm")})
    poses = {"left": pose(), "arm": pose(0, 0, 1.0)}
    touch = np.zeros(48)
    touch[0] = 7.0
    quiet = body.update({"left": np.full(N, 10.0), "arm": np.zeros(48)}, 0.0, poses)
    touched = body.update({"left": np.full(N, 10.0), "arm": touch}, 0.01, poses)
    assert_allclose(np.linalg.norm((touched.wrench - quiet.wrench)[:3]), 7.0)
    assert (touched.polygon.outer.corners == quiet.polygon.outer.corners).all()
    assert_allclose(touched.zmp, quiet.zmp)
    assert body.observable.tolist() == [True, True, True, True, True, False]


def test_frames_of_a_body_are_read_only():
    """A controller that writes into a result must not change later ones."""
    poses = {"left": pose(y=0.1), "right": pose(y=-0.1)}
    frame = feet().update({name: np.full(42, 3.0) for name in poses}, 0.0, poses)
    for array in (frame.wrench, frame.zmp, frame.cop, frame.poses["left"], frame.polygon.outer.corners):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(TypeError, match="does not support item assignment"):
        frame.links["left"] = None
    assert poses["left"].flags.writeable  # the pose of the caller stays as it was
