"""Landings of the G1, by short versions of the runs."""

import pytest


@pytest.mark.slow
def test_g1_lands_softly_by_the_distances_below_its_feet(g1_feet):
    """It stands after two steps in place, with less than a tenth of the impact, and not later."""
    from g1 import URDF
    from g1_landing import Case, run

    (stands, soft), (_, hard) = (run(Case(URDF, g1_feet, "flat", near, 2, 0.4, 0)) for near in (True, False))
    assert stands and len(soft) == 2
    assert max(i.force for i in soft) < min(i.force for i in hard) / 10
    assert max(i.time for i in soft) < min(i.time for i in hard) + 0.02


@pytest.mark.slow
def test_g1_lands_softly_on_an_obstacle_that_it_does_not_know(g1_feet):
    """The first of two steps is onto it, the other one onto the floor; the robot stands."""
    from g1 import FEET, G1, URDF
    from g1_landing import OBSTACLE_STEPS, Case, by_place, run

    results = {
        (ground, near): [run(Case(URDF, g1_feet, ground, near, OBSTACLE_STEPS, 0.4, 0))] if ground != "flat" else []
        for ground in ("flat", "obstacle")
        for near in (False, True)
    }
    robot = G1(URDF, g1_feet, 0)
    places = by_place(results, robot.data.body(FEET[0]).xpos[2])
    (hard,), (soft,) = (places["on the obstacle", near] for near in (False, True))
    assert [len(places["floor next to the obstacle", near]) for near in (False, True)] == [1, 1]
    assert 0.3 < hard.speed < 0.5 and soft.force < hard.force / 4 and soft.time < hard.time
    assert results["obstacle", True][0][0]
