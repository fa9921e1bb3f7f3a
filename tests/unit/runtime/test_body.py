"""Combine two feet, and several links, in a body."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import UnknownLink
from skin_calib_addon.runtime import Body, Plane
from tests.samples import sheet
from tests.soles import skin_of, sole_patch

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
    # at full contact each foot's CoP makes up for what the forces within the cells are off
    assert 0 < np.linalg.norm(frame.cop - frame.zmp) < 2e-3


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


def test_missing_readings_and_poses_are_flagged():
    """Without a reading or a valid pose a link is left out and named; the other foot is not affected."""
    body = feet()
    good = np.full(N, 10.0)
    frame = body.update({"left": good}, 0.0, {"left": pose(), "right": pose()})
    assert frame.flags == {"right:no_reading"} and frame.zmp is not None
    frame = body.update({"left": good, "right": good[:3]}, 0.01, {"left": pose(), "right": pose()})
    assert frame.flags == {"right:wrong_length"} and frame.standing == ("left",) and np.isnan(frame.wrench).all()
    for wrong in (np.eye(3), np.full((4, 4), np.nan), [[1, 2], [3]], "pose", None):
        frame = body.update({"left": good, "right": good}, 0.02, {"left": pose(), "right": wrong})
        assert "right:no_pose" in frame.flags and frame.standing == ("left",)
    frame = body.update({"left": good, "right": good}, 0.03, {"left": pose()})
    assert "right:no_pose" in frame.flags
    with pytest.raises(UnknownLink, match=r"no link 'foot' in this body; it has \['left', 'right'\]"):
        body.update({"foot": good}, 0.04, {})


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
