"""The experiments at 1 kHz."""

import pytest


def test_robot_walks_at_1_khz_and_feels_its_zmp():
    """The felt ZMP is compared with the true one of the time of the readings; a step later it is up to 8 mm away."""
    from biped import PERIOD, TIME_STEP
    from rates import cases_of, run

    slow, fast = (run(cases_of("walk", 1, period)[0]) for period in (PERIOD, TIME_STEP))
    assert slow.stands and fast.stands and slow.steps == fast.steps == 2
    assert fast.apart < 0.001 and slow.apart < 0.001


@pytest.mark.slow
def test_table_of_the_rates_has_all_rows():
    """With the shortest runs of each row: it is built from what all experiments return."""
    from rates import PERIODS, ROWS, cases_of, column, run

    assert {name: len(cases_of(name, 20, PERIODS["1 kHz"])) for name in ROWS}["balance"] == 24
    assert all(case.period == PERIODS["1 kHz"] for name in ROWS for case in cases_of(name, 20, 1e-3))
    texts = column({name: [run(cases_of(name, 1, PERIODS["250 Hz"])[0])] for name in ROWS})
    assert texts["cone of the felt polygon: stands"] == "1/1" and texts["cone of the full sole: stands"] == "0/1"
    assert texts["balance, full sole: largest push [N s]"] == "10.0"
