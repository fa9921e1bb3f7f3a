"""The arms of the control examples: what they feel, and short versions of their experiments."""

import numpy as np
import pytest

for package in ("mujoco", "tqdm", "PIL", "matplotlib"):
    pytest.importorskip(package, reason=f"the package {package} is not installed: pip install '.[control]'")

pytestmark = pytest.mark.usefixtures("scripts")


def test_table_as_printed_avoids_again_at_the_first_motion():
    """The arm was slow near the obstacle and pushes; as it moves, the printed table avoids again."""
    from planar_arm import SLOW, Printed

    from skin_calib_addon.runtime.reflexes import Stage

    policy = Printed()
    assert policy.update(0.0, 0.5 * SLOW, False, 3.0, 0.0) is Stage.PUSH
    assert policy.update(0.1, 2 * SLOW, False, 3.0, 0.0) is Stage.AVOID


def test_balls_of_the_soft_probe_touch_the_forearm():
    """All at the distance of their radius from the cone of the forearm."""
    from arm import FOREARM_LENGTH, PRESSED, SMALL, WRIST_RADIUS, cushion, radius_at
    from shapes import ELBOW_RADIUS

    places = cushion()
    slope = (WRIST_RADIUS - ELBOW_RADIUS) / FOREARM_LENGTH
    to_axis = np.hypot(places[:, 1], radius_at(PRESSED) + SMALL - places[:, 2])
    np.testing.assert_allclose(to_axis - SMALL, radius_at(PRESSED) + slope * places[:, 0], atol=1e-9)


@pytest.mark.slow
def test_proximity_of_the_planar_arm_is_that_of_a_ray():
    """Rays to the upright cylinder of the obstacle, by the simulator."""
    import mujoco
    from planar_arm import RANGE, RANGE_COUNTS, PlanarArm

    arm = PlanarArm(0)
    arm.data.qpos[:7] = (0.35, 0.1, 0.1, 0.2, 0.4, 0.2, -0.1)
    mujoco.mj_forward(arm.model, arm.data)
    seen, group = 0, np.zeros(6, np.uint8)
    group[0] = 1
    for sites in arm._sites.values():
        near = arm._nearness(sites)
        for site, reading in zip(sites, near):
            out, found = arm.data.site_xmat[site].reshape(3, 3)[:, 2], np.zeros(1, np.int32)
            ray = mujoco.mj_ray(arm.model, arm.data, arm.data.site_xpos[site], out, group, 1, -1, found)
            if ray >= 0 and reading > 0 and arm.model.geom_bodyid[found[0]] == arm.model.body("obstacle").id:
                seen += 1
                assert abs(RANGE * (1 - reading / RANGE_COUNTS) - ray) < 1e-3
    assert seen > 3


@pytest.mark.slow
def test_planar_arm_gets_to_its_goal_only_if_it_may_push():
    from planar_arm import MAX_FORCE, run

    avoids, pushes = (run((policy, 0), duration=9.0) for policy in ("avoid only", "runtime"))
    assert np.isnan(avoids.arrival) and avoids.peak(0, 9) == 0
    assert pushes.arrival < 9 and pushes.changes == pushes.changes_before_touch == 1
    assert pushes.log[:, 3].max() < MAX_FORCE  # the felt force


@pytest.mark.slow
def test_arm_yields_to_two_contacts():
    from arm import Case, run

    stiff, yields = (run(Case("contacts", variant, 0), duration=1.2) for variant in ("stiff", "yields"))
    for name in ("force", "second"):
        assert yields[name].max() < stiff[name].max() / 2


@pytest.mark.slow
def test_arm_avoids_in_the_null_space_of_its_hand():
    from arm import Case, run

    still, moves = (run(Case("near", variant, 0), duration=2.8) for variant in ("hand only", "null space"))
    assert still["force"].max() > 0 == moves["force"].max()
    assert moves["hand"].max() < 0.02 and moves["gap"].min() > 0.002


@pytest.mark.slow
def test_heat_and_pain_have_priority_over_the_hand():
    from arm import HEAT_LIMIT, Case, run

    hand, first = (run(Case("heat", variant, 0), duration=3.0) for variant in ("hand only", "first"))
    assert first["heat"].max() - HEAT_LIMIT < 0.5 * (hand["heat"].max() - HEAT_LIMIT)
    pain = run(Case("pain", "small", 0), duration=3.0)
    assert 2 < pain.pain_force < 10


@pytest.mark.slow
def test_planar_arm_feels_again_after_what_it_did_not_know():
    """A press is felt after a frame of NaN. If the readings of the link then stop, its mean decreases."""
    from planar_arm import FORCE_COUNTS, FULL_SCALE, MAX_FORCE, OFFSET, Controller, PlanarArm

    arm = PlanarArm(0)
    controller, cells, felt = Controller(arm.body, "runtime"), arm.body.skins["link3"].channels[:6], []
    for cycle in range(150):
        time, q, qd, readings = arm.senses()
        force = readings["link3"]["force"]
        if cycle == 5:
            force[:] = np.nan
        if cycle >= 10:
            force[cells] = OFFSET + 20 * FORCE_COUNTS / FULL_SCALE  # 20 N each
        if cycle >= 80:
            del readings["link3"]
        torques = controller(time, q, qd, readings)
        assert np.isfinite(torques).all()
        felt.append(controller.contact)
        arm.step(torques)
    assert felt[60] > MAX_FORCE and felt[-1] == 0
