"""Pain and intentional contact: when priorities change, and how smoothly."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_control.reflexes import IntentionalContact, Stage, Switch, blended


def test_switch_has_two_levels_and_a_time():
    """It goes on at once, and off after a time below the lower level; a force between the levels keeps it."""
    switch, states = Switch(10, 5, 3 / 16), []
    values = [0, 9, 10, 7, 4, 4, 6, 4, 4, 4, 0]
    for k, value in enumerate(values):
        states.append(switch.update(value, k / 16))
    assert states == [False, False, True, True, True, True, True, True, True, False, False]


def test_unknown_value_keeps_a_switch():
    """A value that is not a number neither hurts nor ends the pain."""
    switch = Switch(10, 5, 0.1)
    assert not switch.update(np.nan, 0) and switch.update(20, 0.1)
    assert all(switch.update(np.nan, t) for t in np.arange(0.2, 2, 0.1))
    with pytest.raises(ValueError, match="level off, 12, must not be larger"):
        Switch(10, 12, 0.1)


def test_unknown_values_neither_restart_nor_pass_the_time():
    """Pain ends after the time of known small values, however many unknown ones are between them."""
    switch = Switch(10, 5, 0.5)
    states = [switch.update(20 if k == 0 else np.nan if k % 2 else 0.0, k / 8) for k in range(10)]
    assert states == [True] * 8 + [False] * 2  # half of the time is known


def stages(policy, samples):
    return [policy.update(*sample) for sample in samples]


def test_robot_pushes_what_stops_it():
    """It pushes after it was slow for a time near an obstacle, and also while it then moves; it avoids when free."""
    policy, period = IntentionalContact(0.02, 10, 0.25), 0.125
    free = [(k * period, 0.3, False, 0.0, 0.0) for k in range(5)]
    stopped = [((5 + k) * period, 0.001, False, 3.0, 0.0) for k in range(4)]
    assert stages(policy, free) == [Stage.AVOID] * 5
    assert stages(policy, stopped) == [Stage.AVOID, Stage.PUSH, Stage.PUSH, Stage.PUSH]
    assert policy.since == stopped[1][0]
    approach = [((9 + k) * period, 0.2, False, 4.0, 2.0 * (k > 1)) for k in range(5)]  # table 1 avoids here again
    assert stages(policy, approach) == [Stage.PUSH] * 5
    left = [((14 + k) * period, 0.2, False, 0.0, 0.0) for k in range(4)]
    assert stages(policy, left)[-1] is Stage.AVOID


def test_slow_robot_at_its_goal_or_far_from_obstacles_does_not_push():
    """Only an obstacle between hand and goal is pushed."""
    at_goal, alone = (IntentionalContact(0.02, 10, 0.2) for _ in range(2))
    assert set(stages(at_goal, [(0.1 * k, 0.0, True, 3.0, 0.0) for k in range(20)])) == {Stage.AVOID}
    assert set(stages(alone, [(0.1 * k, 0.0, False, 0.0, 0.0) for k in range(20)])) == {Stage.AVOID}


@pytest.mark.parametrize("unknown", [{"speed": np.nan}, {"contact": np.nan}, {"near": np.nan}])
def test_robot_that_does_not_know_what_it_feels_does_not_push(unknown):
    """It avoids, however long; it yields as long as it does not know that the contact is weak."""
    sample = {"speed": 0.0, "is_at_goal": False, "near": 3.0, "contact": 0.0} | unknown
    policy = IntentionalContact(0.02, 10, 0.2)
    assert {policy.update(0.1 * k, **sample) for k in range(20)} == {Stage.AVOID}
    policy.update(2, 0.0, False, 3.0, 12.0)
    sample = sample | {"contact": np.nan}
    assert {policy.update(2 + 0.1 * k, **sample) for k in range(1, 20)} == {Stage.YIELD}


@pytest.mark.parametrize("before", [Stage.AVOID, Stage.PUSH])
def test_hard_contact_has_priority_until_it_is_weak(before):
    """Above the limit in any stage; it ends below half of it, and the robot then avoids first."""
    policy = IntentionalContact(0.02, 10, 0.2)
    for k in range(6 if before is Stage.PUSH else 1):
        policy.update(0.1 * k, 0.0, False, 3.0, 0.0)
    assert policy.stage is before
    forces = [11, 9.9, 6, 4, 4, 4, 4]
    found = [policy.update(1 + 0.1 * k, 0.0, False, 3.0, f) for k, f in enumerate(forces)]
    assert found[:4] == [Stage.YIELD] * 4 and found[5] is Stage.AVOID and found[4:] != [Stage.YIELD] * 3


def test_blend_starts_at_the_old_torque():
    """Nothing is sudden at the change, and the new torque remains; eq. 3.46 of the thesis starts in the middle."""
    before, now = np.array((4.0, -2)), np.array((0.0, 1))
    assert_allclose(blended(before, now, 0.0, 10), before)
    assert_allclose(blended(before, now, 1.0, 10), now, atol=1e-7)
    steps = np.array([blended(before, now, t, 10) for t in np.linspace(0, 1, 1001)])
    assert np.abs(np.diff(steps, axis=0)).max() <= 4 * 10 * 1e-3  # step of the torque times rate times time
    assert (np.diff(steps[:, 0]) < 0).all()


@pytest.mark.parametrize(
    ("call", "problem"),
    [
        (lambda: Switch(10, 5, np.nan), "must be zero or more, not nan"),
        (lambda: Switch(10, 5, -1), "must be zero or more, not -1"),
        (lambda: Switch(10, 5, 0.1).update(3, np.nan), "time nan is not a finite number"),
        (lambda: IntentionalContact(np.nan, 10, 0.2), "slow must be positive and finite, not nan"),
        (lambda: IntentionalContact(0.02, 0, 0.2), "max_force must be positive and finite, not 0"),
        (lambda: IntentionalContact(0.02, 10, 0), "patience must be positive and finite, not 0"),
        (lambda: IntentionalContact(0.02, 10, 0.2).update(np.inf, 0, False, 3, 0), "time inf is not a finite number"),
        (lambda: blended([1.0], [2.0], 0.1, -10), "rate must be positive and finite, not -10"),
        (lambda: blended([1.0], [2.0], np.nan, 10), "time since the change is not a number"),
        (lambda: blended([1.0], [2.0, 3.0], 0.1, 10), r"the torque now has shape \(2,\), expected \(1,\)"),
        (lambda: blended([np.nan], [2.0], np.inf, 10), "the torque before has values that are not finite"),
    ],
)
def test_wrong_values_of_reflexes_are_refused(call, problem):
    """The robot pushed while it moved, changed its stage in each cycle, or got twice the old torque."""
    with pytest.raises(ValueError, match=problem):
        call()
