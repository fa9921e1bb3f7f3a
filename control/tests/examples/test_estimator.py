"""Where the robot is, by its own estimate."""

import numpy as np
import pytest


@pytest.mark.slow
def test_estimated_feet_stay_where_they_stand():
    """A foot bounces after it has met the ground, and slides by 2 mm; it is anchored when it carries load."""
    from beam import GAIT, side_steps
    from biped import FEET, Biped
    from estimator import SOLE_CENTRE
    from walker import Walker, walk

    robot = Biped(proximity=False)
    walker = Walker(robot, side_steps(6), GAIT)
    assert walk(robot, walker, 15.0)
    for foot, sole in zip(FEET, walker.log.rows[-1]["soles"]):
        body = robot.data.body(f"{foot}_foot")
        assert np.abs(sole - body.xpos - body.xmat.reshape(3, 3) @ SOLE_CENTRE)[:2].max() < 0.002
