"""New steps: the rule, and short versions of the runs."""

import numpy as np
import pytest


def test_step_leaves_an_obstacle_by_the_shortest_shift():
    from replanning import CLEARANCE, shift_off
    from shapes import HALF_SIZE

    from skin_calib_addon.runtime import convex_hull

    def box(low, high):
        return convex_hull([low, high, (low[0], high[1]), (high[0], low[1])])

    middle, ahead = box((-0.04, -0.03), (0.03, 0.03)), box((0.05, -0.03), (0.09, 0.03))
    np.testing.assert_allclose(shift_off(middle, "right"), (0.0, -0.03 - CLEARANCE - HALF_SIZE[1]))
    np.testing.assert_allclose(shift_off(middle, "left"), -shift_off(middle, "right"))
    np.testing.assert_allclose(shift_off(ahead, "right"), (0.05 - CLEARANCE - HALF_SIZE[0], 0.0))


@pytest.mark.slow
@pytest.mark.parametrize("obstacle", ["small block in the middle", "three pebbles"])
def test_robot_steps_next_to_an_obstacle_and_walks_on(obstacle):
    from replanning import MIN_AREA, Case, run

    result = run(Case(obstacle, "what is felt, new steps", 0))
    assert result.stands and result.steps == 5
    assert result.retracted[0] == "right" and result.area < MIN_AREA  # without the skin it falls there
