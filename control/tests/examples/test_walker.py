"""The controller of a walk."""

from types import SimpleNamespace

import numpy as np
import pytest


def test_plan_waits_for_a_dcm_that_is_behind_it_and_goes_on_faster_for_one_ahead():
    from walker import Gains, plan_rate
    from zmp_plan import Reference

    gains, omega, rng = Gains(), 3.8, np.random.default_rng(3)
    for _ in range(20):
        zmp, away = rng.normal(0, 0.1, (2, 2))
        reference, aside = Reference(zmp, zmp + away), np.array((-away[1], away[0]))
        assert plan_rate(reference, reference.dcm, omega, gains) == 1.0
        assert plan_rate(reference, reference.dcm + 0.2 * aside, omega, gains) == pytest.approx(1.0)
        fast = plan_rate(reference, reference.dcm + away, omega, gains)
        slow = plan_rate(reference, reference.dcm - away, omega, gains)
        assert 0.0 <= slow < 1.0 < fast <= gains.fastest
    standing = Reference(np.zeros(2), np.zeros(2))
    assert plan_rate(standing, np.array((0.1, 0.0)), omega, gains) == 1.0


@pytest.mark.slow
def test_standing_robot_feels_its_zmp_and_its_weight():
    from biped import Biped
    from walker import Walker

    robot = Biped()
    walker = Walker(robot, [])
    off = []
    for _ in range(150):
        robot.step(*walker.cycle(robot.senses()))
        off.append(walker.log.rows[-1]["zmp"] - robot.true_zmp())
    felt = walker.log.rows[-1]
    assert np.abs(np.mean(off[-100:], axis=0)).max() < 0.001
    weight = robot.model.body_subtreemass[0] * 9.81
    assert abs(sum(felt["loads"]) / weight - 1) < 0.01


@pytest.mark.slow
def test_walker_needs_the_five_members_that_the_page_states():
    """The robot is hidden behind them; it begins to lift a foot."""
    from biped import Biped
    from walker import Walker, forward_steps

    robot = Biped(proximity=False)
    names = ("body", "start", "period", "senses", "step")
    walker = Walker(SimpleNamespace(**{name: getattr(robot, name) for name in names}), forward_steps(1, 0.15, 0.18))
    while robot.data.time < 1.5:
        robot.step(*walker.cycle(robot.senses()))
    assert walker.swing_foot == "right" and not robot.fallen
