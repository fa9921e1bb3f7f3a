"""The planar arm: what it feels, and short versions of the runs."""

import numpy as np
import pytest


def test_table_as_printed_avoids_again_at_the_first_motion():
    """The arm was slow near the obstacle and pushes; as it moves, the printed table avoids again."""
    from planar_arm import SLOW, Printed

    from skin_control.reflexes import Stage

    policy = Printed()
    assert policy.update(0.0, 0.5 * SLOW, False, 3.0, 0.0) is Stage.PUSH
    assert policy.update(0.1, 2 * SLOW, False, 3.0, 0.0) is Stage.AVOID


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
def test_planar_arm_feels_again_after_what_it_did_not_know():
    """A press is felt after a frame of NaN. If the readings of the link then stop, its mean decreases."""
    from biped import COUNTS, OFFSET
    from planar_arm import FULL_SCALE, MAX_FORCE, Controller, PlanarArm

    arm = PlanarArm(0)
    controller, cells, felt = Controller(arm.body, "runtime"), arm.body.skins["link3"].channels[:6], []
    for cycle in range(150):
        time, q, qd, readings = arm.senses()
        force = readings["link3"]["force"]
        if cycle == 5:
            force[:] = np.nan
        if cycle >= 10:
            force[cells] = OFFSET + 20 * COUNTS / FULL_SCALE  # 20 N each
        if cycle >= 80:
            del readings["link3"]
        torques = controller(time, q, qd, readings)
        assert np.isfinite(torques).all()
        felt.append(controller.contact)
        arm.step(torques)
    assert felt[60] > MAX_FORCE and felt[-1] == 0


def test_animation_shows_the_arm_that_moves_from_above(frames, tmp_path):
    """Its skin is green, the obstacle is not."""
    import mujoco
    from planar_arm import PlanarArm, View

    arm = PlanarArm(0)
    view = View(arm)
    for k in range(2):
        arm.data.qpos[0], arm.data.time = 0.5 * k, k
        mujoco.mj_kinematics(arm.model, arm.data)
        view(arm)
    view.save(tmp_path / "planar.gif")
    film = frames(tmp_path / "planar.gif")
    green = (film[..., 1] > 1.5 * film[..., 0]) & (film[..., 1] > 1.3 * film[..., 2])
    assert len(film) == 2 and (green.sum(axis=(1, 2)) > 500).all() and (green[0] != green[1]).sum() > 500
