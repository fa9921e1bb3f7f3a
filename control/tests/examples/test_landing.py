"""Landings: where they are, how they are judged, and short versions of the runs."""

import numpy as np
import pytest


def test_landing_is_on_the_obstacle_with_the_whole_sole_or_not_at_all():
    """Places that the steps lead to, moved by up to 2 cm; a fifth step would meet a part of it."""
    from estimator import SOLE_CENTRE
    from landing import OBSTACLE_STEPS, STEP, WIDTH, Impact
    from walker import forward_steps

    def meets(steps, off=(0.0, 0.0)):
        at = (np.append(step.centre + off, 0.0) - SOLE_CENTRE for step in forward_steps(steps, STEP, WIDTH))
        landings = [Impact(100.0, 0.3, 0.8, place) for place in at]
        return [i.is_on_obstacle for i in landings], [i.is_whole for i in landings]

    for off in np.random.default_rng(4).uniform(-0.02, 0.02, (20, 2)):
        assert meets(OBSTACLE_STEPS, off) == ([False, False, True, False],) * 2
    on, whole = meets(OBSTACLE_STEPS + 1)
    assert on[4] and not whole[4]


@pytest.mark.slow
def test_proximity_softens_the_landing():
    """Two steps: less than a quarter of the impact, no later contact."""
    from landing import Case, run

    (stands, hard), (stands_too, soft) = (run(Case("flat", near, 2, 0.4, 0)) for near in (False, True))
    assert stands and stands_too and len(hard) == len(soft) == 2
    assert max(i.force for i in soft) < min(i.force for i in hard) / 4
    assert np.mean([i.time for i in soft]) < np.mean([i.time for i in hard]) + 0.02


def test_speed_of_a_sole_is_that_of_its_centre():
    """As small motions give it, of a foot that turns; not the one of the frame at the CoM of the robot."""
    import mujoco
    from biped import Biped
    from estimator import SOLE_CENTRE
    from landing import sinking

    robot = Biped(proximity=False)
    foot, speeds, heights = robot.data.body("right_foot"), [], []
    robot.data.qvel[:] = np.random.default_rng(0).normal(0, 0.3, robot.model.nv)
    for _ in range(2):
        mujoco.mj_forward(robot.model, robot.data)
        heights.append(foot.xpos[2] + foot.xmat.reshape(3, 3)[2] @ SOLE_CENTRE)
        speeds.append(sinking(robot, "right_foot", SOLE_CENTRE))
        mujoco.mj_integratePos(robot.model, robot.data.qpos, robot.data.qvel, 1e-5)
    assert abs(speeds[0] - (heights[0] - heights[1]) / 1e-5) < 1e-4 < 0.01 < abs(speeds[0] + foot.cvel[5])


def test_landings_on_the_obstacle_are_judged_apart():
    """The third of four landings; the foot meets it about as fast as the floor, and softly with proximity."""
    from landing import OBSTACLE_STEPS, Case, by_place, run

    results = {
        (ground, near): [run(Case(ground, near, OBSTACLE_STEPS, 0.4, 1))] if ground == "obstacle" else []
        for ground in ("flat", "obstacle")
        for near in (False, True)
    }
    places = by_place(results)
    (hard,), (soft,) = (places["on the obstacle", near] for near in (False, True))
    assert len(places["floor next to the obstacle", False]) == OBSTACLE_STEPS - 1
    assert hard.is_whole and soft.is_whole and 0.3 < hard.speed < 0.5 and soft.force < hard.force / 4
