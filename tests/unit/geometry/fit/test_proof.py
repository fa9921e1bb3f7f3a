"""Proofs that a surface keeps within a tolerance."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.geometry.fit.proof import FIRST_BATCH, confirmed_error

COUNT = 5000


def case(seed, loose=0.3, unknown=0):
    """Distances, areas, and bounds that exceed them by up to a fraction; some bounds are infinite."""
    rng = np.random.default_rng(seed)
    distances, areas = rng.exponential(size=COUNT), rng.uniform(0.5, 2, COUNT)
    bounds = distances * (1 + loose * rng.uniform(0, 1, COUNT))
    bounds[rng.permutation(COUNT)[:unknown]] = np.inf
    return distances, areas, bounds


def stated(distances, areas, measure):
    """The mean or the largest."""
    return np.average(distances, weights=areas) if measure == "mean" else distances.max()


@given(
    seed=st.integers(0, 1000),
    measure=st.sampled_from(["mean", "max"]),
    fraction=st.floats(0.5, 2),
    unknown=st.sampled_from([0, 3, 400]),
)
def test_tolerance_is_claimed_only_where_it_is_kept(seed, measure, fraction, unknown):
    """Within the tolerance the result is no less than the true error; elsewhere it is an estimate."""
    distances, areas, bounds = case(seed, unknown=unknown)
    truth = stated(distances, areas, measure)
    error = confirmed_error(bounds, areas, lambda chosen: distances[chosen], measure, fraction * truth)
    if error <= fraction * truth:
        assert error >= truth * (1 - 1e-12)
    else:
        assert_allclose(error, truth, rtol=0.35)
    assert not (fraction < 1 and error <= fraction * truth)


@pytest.mark.parametrize("measure", ["mean", "max"])
@pytest.mark.parametrize("fraction", [1.0, 1.02, 1.05, 1.1])
def test_confirmed_error_is_an_upper_bound_just_above_the_truth(measure, fraction):
    """The estimate of the other distances decides when to stop; it must not replace their bounds."""
    for seed in range(20):
        distances, areas, bounds = case(seed, unknown=3)
        truth = stated(distances, areas, measure)
        error = confirmed_error(bounds, areas, lambda chosen, exact=distances: exact[chosen], measure, fraction * truth)
        assert error >= truth * (1 - 1e-12)


@pytest.mark.parametrize("measure", ["mean", "max"])
def test_proof_takes_no_more_exact_distances_than_it_needs(measure):
    """None where the bounds keep the tolerance, a first few where it is far, some of all where they nearly keep it."""
    distances, areas, bounds = case(1, unknown=10)
    bounds[np.isinf(bounds)] = 1.0
    asked = []

    def exact(chosen):
        asked.append(len(chosen))
        return distances[chosen]

    most, truth = stated(bounds, areas, measure), stated(distances, areas, measure)
    for tolerance, least, largest in (
        (1.001 * most, 0, 0),
        (0.5 * truth, 1, 2 * FIRST_BATCH),
        (0.3 * truth + 0.7 * most, FIRST_BATCH, COUNT // 2),
    ):
        asked.clear()
        error = confirmed_error(bounds, areas, exact, measure, tolerance)
        assert least <= sum(asked) <= largest and (error <= tolerance) == (tolerance > truth)


def test_nothing_is_proved_of_nothing():
    """A surface that lies over holes alone."""
    assert confirmed_error(np.empty(0), np.empty(0), lambda chosen: chosen * 1.0, "mean", 1.0) == np.inf
