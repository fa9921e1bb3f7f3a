"""Faults of the sensors, and short versions of the runs."""

import numpy as np
import pytest


@pytest.mark.parametrize("period", [4e-3, 1e-3])
def test_fault_of_latency_is_10_ms_at_each_rate_rounded_up_to_a_cycle(period):
    from faults import FAULTS

    fault = FAULTS["10 ms of latency"](0.0, np.random.default_rng(0), period)
    assert 0 <= fault.latency * period - 10e-3 < period


@pytest.mark.slow
def test_frozen_bus_ends_the_walk_but_the_robot_stands():
    from faults import Case, run

    result = run(Case("frozen bus", True, 2, 3))  # it freezes in the first step, after 1.35 s
    assert result.stands and result.steps == 1 and 0.1 <= result.stopped < 1.2
