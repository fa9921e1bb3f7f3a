"""Partial footholds, by short versions of the runs."""

import pytest


@pytest.mark.slow
@pytest.mark.parametrize(("part", "seed"), [("inner half", 0), ("outer half", 0), ("30 %", 3)])
def test_robot_stands_on_a_part_of_a_sole(part, seed):
    """On the 30 % it fell when the plan moved the DCM on while it was held."""
    from footholds import Case, run

    result = run(Case(part, True, seed))
    assert result.stands and result.steps == 5 and 0.4 < result.area < 0.6
