"""The beam, by short versions of the runs."""

import pytest


@pytest.mark.slow
def test_robot_walks_on_a_beam_with_the_skin_only():
    from beam import Case, run

    felt, full = (run(Case(feels, 0.08, 9, 0)) for feels in (True, False))
    assert felt.stands and felt.steps == 9 and not full.stands
