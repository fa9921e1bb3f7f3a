"""Pushes: the search for the largest one, and short versions of the runs."""

import numpy as np
import pytest


@pytest.mark.parametrize("bears", [0.5, 3.2, 7.9, 10.6, 20.0, 33.3])
def test_search_finds_the_largest_push_however_large_it_is(bears):
    from balance import largest_push

    found = largest_push(lambda impulse: impulse <= bears, first=8.0, resolution=1.0)
    assert found <= bears < found + 1


@pytest.mark.slow
def test_force_torque_sensors_and_skin_feel_the_same_zmp_under_a_push():
    """The robot survives a push of a fifth of its momentum at 1 m/s; both ZMPs agree to a few millimetres."""
    from balance import Case, push

    stands, zmps = push(Case("full sole", "skin", 0), 6.0)
    apart = np.linalg.norm(zmps[:, 0] - zmps[:, 1], axis=1)
    assert stands and np.ptp(zmps[:, 0, 0]) > 0.03
    assert apart.mean() < 0.003 and apart.max() < 0.010


@pytest.mark.slow
def test_pushed_robot_that_falls_slowly_does_not_count_as_standing():
    """It stood on the half soles for 1.4 s after a diagonal push, with a tilt of 43 degrees at the end."""
    from balance import Case, push

    assert push(Case("half sole", "skin", 1), 4.5)[0]
    assert not push(Case("half sole", "skin", 1), 9.0)[0]
