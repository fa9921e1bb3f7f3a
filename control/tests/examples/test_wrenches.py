"""The distribution of the wrench, by short versions of the runs."""

import pytest


@pytest.mark.slow
def test_cone_of_the_felt_polygon_keeps_a_foot_from_tipping_and_the_robot_from_falling():
    """A run of 3.5 s was too short: the robot tips, and falls 3 s after the motion of the ZMP."""
    from wrenches import END, MOVE, START, TIPPED, Case, run

    felt, full = (run(Case(cone, 0)) for cone in ("felt", "full"))
    assert felt.stands and felt.tilt < TIPPED and felt.demanded <= 0 and felt.off < 0.005
    assert not full.stands and full.tilt > TIPPED and full.demanded > 0 and START + MOVE < full.fell < END - 1
