"""Walking references, compared with integration of the pendulum's equations and with closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_control import walking
from skin_control.walking import (
    com_reference,
    com_velocity,
    com_velocity_command,
    dcm_reference,
    dcm_velocity,
    dcm_waypoints,
    desired_zmp,
    divergent_component,
    pendulum_frequency,
    repellent_points,
    zmp_reference,
    zmp_tracking_velocity,
)


def runge_kutta(slope, state, start, stop, count=150):
    """Return the state at the end, by the classic fourth-order method."""
    h = (stop - start) / count
    for k in range(count):
        t = start + k * h
        a = slope(t, state)
        b = slope(t + h / 2, state + h / 2 * a)
        c = slope(t + h / 2, state + h / 2 * b)
        d = slope(t + h, state + h * c)
        state = state + h / 6 * (a + 2 * b + 2 * c + d)
    return state


@st.composite
def walks(draw):
    """Draw repellent points of one to five steps in the plane or in space, a step time, a frequency, a velocity."""
    d = draw(st.sampled_from((2, 3)))
    numbers = st.lists(st.floats(-1, 1), min_size=d, max_size=d)
    points = np.array(draw(st.lists(numbers, min_size=1, max_size=5)))
    return points, draw(st.floats(0.2, 1.2)), draw(st.floats(2.0, 5.0)), np.array(draw(numbers))


def test_frequency_is_that_of_a_falling_pendulum():
    """It is known for a metre on Earth and for lunar gravity, and solves x'' = omega^2 x."""
    assert pendulum_frequency(1.0) == np.sqrt(9.81) and pendulum_frequency(0.8, 1.62) == np.sqrt(1.62 / 0.8)
    omega = pendulum_frequency(0.9)
    x, v = runge_kutta(lambda t, s: np.array((s[1], 9.81 / 0.9 * s[0])), np.array((0.01, 0.0)), 0.0, 1.0)
    assert_allclose(x, 0.01 * np.cosh(omega), rtol=1e-8)
    assert_allclose(v, 0.01 * omega * np.sinh(omega), rtol=1e-8)


@given(walk=walks())
def test_dcm_splits_the_pendulum_in_two(walk):
    """x' = -omega (x - xi) defines the DCM; with it, x'' = omega^2 (x - p) becomes xi' = omega (xi - p)."""
    points, _, omega, velocity = walk
    x, p = points[0], points[-1]
    xi = divergent_component(x, velocity, omega)
    assert_allclose(com_velocity(x, xi, omega), velocity, rtol=0, atol=1e-12)
    acceleration = omega**2 * (x - p)
    assert_allclose(dcm_velocity(xi, p, omega), velocity + acceleration / omega, rtol=0, atol=1e-11)


def test_repellent_points_stand_over_the_feet():
    """They are at the height of the CoM; in the plane they are the feet."""
    feet = np.array(((0.1, 0.2, 0.0), (0.4, -0.2, 0.1)))
    assert repellent_points(feet, 0.8).tolist() == [[0.1, 0.2, 0.8], [0.4, -0.2, 0.1 + 0.8]]
    assert repellent_points(feet[:, :2], 0.8).tolist() == feet[:, :2].tolist()


@given(walk=walks())
def test_waypoints_are_where_integration_ends(walk):
    """Integration of (4.12) over each step ends at the next waypoint; the last one is over its foot, or as given."""
    points, T, omega, last = walk
    for asked in (None, last):
        ends = dcm_waypoints(points, T, omega, asked)
        assert_allclose(ends[-1], points[-1] if asked is None else asked, rtol=0)
        start = dcm_reference(0.0, points, ends, T, omega)
        for r, end in zip(points, ends):
            assert_allclose(runge_kutta(lambda t, xi, r=r: omega * (xi - r), start, 0, T), end, rtol=0, atol=1e-6)
            start = end


@given(walk=walks(), fraction=st.floats(0, 1))
def test_references_solve_the_equations(walk, fraction):
    """At any time DCM and CoM agree with Runge-Kutta integration from the start, driven by the reference of the ZMP."""
    points, T, omega, start = walk
    ends = dcm_waypoints(points, T, omega)
    time = fraction * T * len(points)
    d = points.shape[1]
    state = np.concatenate((dcm_reference(0.0, points, ends, T, omega), start))
    for k, r in enumerate(points):
        stop = min(max(time - k * T, 0.0), T)

        def slope(t, s, r=r):
            return np.concatenate((omega * (s[:d] - r), -omega * (s[d:] - s[:d])))

        state = runge_kutta(slope, state, 0.0, stop)
    # Errors of the steps so far grow with the DCM by exp(omega T) a step; the reference does not.
    most = 1e-7 * np.exp(omega * T * len(points))
    assert_allclose(dcm_reference(time, points, ends, T, omega), state[:d], rtol=0, atol=most)
    assert_allclose(com_reference(time, points, ends, start, T, omega), state[d:], rtol=0, atol=most)


@given(walk=walks())
def test_references_are_smooth_enough(walk):
    """DCM and CoM are continuous from step to step, and their derivatives are those of (4.12) and (4.10)."""
    points, T, omega, start = walk
    ends = dcm_waypoints(points, T, omega)
    for time in (np.arange(len(points)) + 0.5) * T:
        around = time + np.array((-1e-5, 0.0, 1e-5))
        xi, x = dcm_reference(around, points, ends, T, omega), com_reference(around, points, ends, start, T, omega)
        p = zmp_reference(time, points, ends, T)
        assert_allclose((xi[2] - xi[0]) / 2e-5, dcm_velocity(xi[1], p, omega), rtol=0, atol=1e-6)
        assert_allclose((x[2] - x[0]) / 2e-5, com_velocity(x[1], xi[1], omega), rtol=0, atol=1e-6)
    for time in np.arange(1, len(points) + 1) * T:
        around = np.array((time - 1e-9, time + 1e-9))
        for value in (
            dcm_reference(around, points, ends, T, omega),
            com_reference(around, points, ends, start, T, omega),
        ):
            assert_allclose(value[1], value[0], rtol=0, atol=1e-6)


@given(walk=walks())
def test_walk_ends_at_rest(walk):
    """After the last step the DCM stays at the ZMP, and the CoM converges to it."""
    points, T, omega, start = walk
    for last in (None, start):
        ends = dcm_waypoints(points, T, omega, last)
        late = len(points) * T + np.array((0.1, 10.0, 1e6))
        assert_allclose(dcm_reference(late, points, ends, T, omega), np.tile(ends[-1], (3, 1)), rtol=0, atol=1e-15)
        assert_allclose(zmp_reference(late, points, ends, T), np.tile(ends[-1], (3, 1)), rtol=0)
        x = com_reference(late, points, ends, start, T, omega)
        assert_allclose(x[1:], np.tile(ends[-1], (2, 1)), rtol=0, atol=1e-7)
        before = com_reference(len(points) * T, points, ends, start, T, omega)
        assert_allclose(x[0], ends[-1] + (before - ends[-1]) * np.exp(-0.1 * omega), rtol=0, atol=1e-9)


def test_times_may_have_any_shape():
    """Times with no, one or two axes give the same results as single times."""
    points = np.array(((0.0, 0.1), (0.3, -0.1), (0.6, 0.1)))
    ends = dcm_waypoints(points, 0.7, 3.3)
    times = np.linspace(0, 3, 12).reshape(3, 4)
    for reference in (
        lambda t: dcm_reference(t, points, ends, 0.7, 3.3),
        lambda t: com_reference(t, points, ends, (0.0, 0.0), 0.7, 3.3),
        lambda t: zmp_reference(t, points, ends, 0.7),
    ):
        assert reference(times).shape == (3, 4, 2) and reference(0.5).shape == (2,) and reference([]).shape == (0, 2)
        assert_allclose(reference(times), [[reference(t) for t in row] for row in times], rtol=0, atol=0)


@given(walk=walks(), gain=st.floats(0.5, 6))
def test_desired_zmp_brings_the_dcm_back(walk, gain):
    """With (4.18) in (4.12), the error of the DCM decreases as exp(-k t) while the reference moves."""
    points, T, omega, push = walk
    ends = dcm_waypoints(points, T, omega)

    def slope(t, xi):
        planned = dcm_reference(t, points, ends, T, omega)
        return dcm_velocity(xi, desired_zmp(points[0], planned, xi, gain, omega), omega)

    start = dcm_reference(0.0, points, ends, T, omega)
    end = runge_kutta(slope, start + 0.1 * push, 0.0, T)
    assert_allclose(end - ends[0], 0.1 * push * np.exp(-gain * T), rtol=0, atol=1e-6)


@given(walk=walks(), gain=st.floats(0.5, 6))
def test_zmp_follows_a_reference_without_jerk(walk, gain):
    """(4.20) is (4.19) solved for the velocity of the CoM, with p'_d = x'_r."""
    points, _, _, velocity = walk
    p, desired = points[0], points[-1]
    command = zmp_tracking_velocity(p, velocity, desired, gain)
    assert_allclose(velocity - command, -gain * (p - desired), rtol=0, atol=1e-12)


@given(offset=st.lists(st.floats(-0.05, 0.05), min_size=2, max_size=2), height=st.floats(0.4, 1.2))
def test_command_balances_the_pendulum(offset, height):
    """A CoM with the velocity of (4.29) and the ZMP of the pendulum converges to the goal, at the rate of the roots."""
    omega = pendulum_frequency(height)
    zmp_gain, com_gain, goal = 0.5 * omega, 1.5 * omega, np.array((0.1, -0.2))

    def slope(t, state):
        x, v = state[:2], state[2:]
        p = goal + (v - com_gain * (goal - x)) / zmp_gain  # where the command is the velocity
        assert_allclose(com_velocity_command(p, goal, x, goal, zmp_gain, com_gain), v, rtol=0, atol=1e-12)
        return np.concatenate((v, omega**2 * (x - p)))

    # k_f e'' / omega^2 + e' + (k_x - k_f) e = 0
    slowest = -np.roots((zmp_gain / omega**2, 1.0, com_gain - zmp_gain)).real.max()
    x, v = runge_kutta(slope, np.concatenate((goal + offset, np.zeros(2))), 0.0, 12 / slowest, 300).reshape(2, 2)
    assert_allclose(x, goal, rtol=0, atol=1e-5)
    assert_allclose(v, 0, rtol=0, atol=1e-4)


POINTS = ((0.0, 0.1, 0.8), (0.3, -0.1, 0.8))
FLAT = ((0.0, 0.1), (0.3, -0.1))
CALLS = {
    "height": lambda bad: pendulum_frequency(bad),
    "gravity": lambda bad: pendulum_frequency(1.0, bad),
    "omega": lambda bad: divergent_component(POINTS[0], POINTS[1], bad),
    "omega of the CoM": lambda bad: com_velocity(POINTS[0], POINTS[1], bad),
    "omega of the DCM": lambda bad: dcm_velocity(POINTS[0], POINTS[1], bad),
    "height of feet": lambda bad: repellent_points(POINTS, bad),
    "height of feet in the plane": lambda bad: repellent_points(FLAT, bad),
    "step_time": lambda bad: dcm_waypoints(POINTS, bad, 3.0),
    "omega of waypoints": lambda bad: dcm_waypoints(POINTS, 0.5, bad),
    "step_time of the DCM": lambda bad: dcm_reference(0.1, POINTS, POINTS, bad, 3.0),
    "omega of the reference": lambda bad: dcm_reference(0.1, POINTS, POINTS, 0.5, bad),
    "step_time of the ZMP": lambda bad: zmp_reference(0.1, POINTS, POINTS, bad),
    "step_time of the CoM": lambda bad: com_reference(0.1, POINTS, POINTS, POINTS[0], bad, 3.0),
    "omega of the CoM's reference": lambda bad: com_reference(0.1, POINTS, POINTS, POINTS[0], 0.5, bad),
    "gain": lambda bad: desired_zmp(POINTS[0], POINTS[0], POINTS[1], bad, 3.0),
    "omega of the ZMP": lambda bad: desired_zmp(POINTS[0], POINTS[0], POINTS[1], 2.0, bad),
    "gain of tracking": lambda bad: zmp_tracking_velocity(POINTS[0], POINTS[0], POINTS[1], bad),
    "zmp_gain": lambda bad: com_velocity_command(*POINTS, *POINTS, bad, 2.0),
    "com_gain": lambda bad: com_velocity_command(*POINTS, *POINTS, 2.0, bad),
}


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
@pytest.mark.parametrize("name", CALLS)
def test_what_must_be_positive_is_named(name, bad):
    """A height, time, gain or frequency that is not positive raises an error with the name of the argument."""
    with pytest.raises(ValueError, match=f"^{name.split()[0]} must be positive and finite, not {bad}"):
        CALLS[name](bad)


@pytest.mark.parametrize("time", [-1e-9, np.nan, [0.1, -0.1]])
@pytest.mark.parametrize(
    "reference",
    [
        lambda t: dcm_reference(t, POINTS, POINTS, 0.5, 3.0),
        lambda t: zmp_reference(t, POINTS, POINTS, 0.5),
        lambda t: com_reference(t, POINTS, POINTS, POINTS[0], 0.5, 3.0),
    ],
)
def test_times_before_the_start_are_refused(reference, time):
    """A negative time raises an error."""
    with pytest.raises(ValueError, match="^time must be zero or more"):
        reference(time)


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("position", lambda: divergent_component(1.0, (0, 0), 3.0)),
        ("velocity", lambda: divergent_component((0, 0), (0, 0, 0, 0), 3.0)),
        ("footsteps", lambda: repellent_points([[1.0]], 1.0)),
        ("repellents", lambda: dcm_waypoints((0.0, 0.1), 0.5, 3.0)),
        ("repellents", lambda: dcm_waypoints(np.empty((0, 3)), 0.5, 3.0)),
        ("ends", lambda: dcm_reference(0.1, POINTS, POINTS[0], 0.5, 3.0)),
        ("ends", lambda: dcm_reference(0.1, POINTS, POINTS[:1], 0.5, 3.0)),
        ("ends", lambda: zmp_reference(0.1, POINTS, FLAT, 0.5)),
        ("ends", lambda: com_reference(0.1, POINTS, POINTS * 2, POINTS[0], 0.5, 3.0)),
        ("start", lambda: com_reference(0.1, POINTS, POINTS, FLAT[0], 0.5, 3.0)),
        ("last", lambda: dcm_waypoints(POINTS, 0.5, 3.0, FLAT[0])),
    ],
)
def test_points_of_a_wrong_shape_are_named(name, call):
    """Arrays that are not points, or do not fit to each other, raise an error with the name of the argument."""
    with pytest.raises(ValueError, match=f"^{name} must "):
        call()


def test_every_function_is_tested():
    """This file imports each public function of the module."""
    public = {n for n, f in vars(walking).items() if callable(f) and f.__module__ == walking.__name__ and n[0] != "_"}
    assert public <= set(globals())
