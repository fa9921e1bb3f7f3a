"""Limits of the runtime that no other test comes near: a reading just within passes, one just beyond does not."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import norm, t

from skin_calib_addon.runtime.rest import is_rest
from tests.soles import counting_sole

N, FRAMES, NOISE = 42, 250, 4.0


def at_rest():
    """Readings without contact."""
    return NOISE * np.random.default_rng(0).normal(size=(FRAMES, N))


def rests(rows):
    """Whether the skin learns its noise from these readings by itself."""
    return is_rest(rows, False)


@pytest.mark.parametrize("sigmas, is_rest", [(4.5, True), (9.0, False)])
def test_rest_has_no_reading_six_standard_deviations_from_the_others(sigmas, is_rest):
    """One reading of one taxel, as of a tap."""
    rows = at_rest()
    rows[100, 7] = sigmas * NOISE
    assert rests(rows) == is_rest


@pytest.mark.parametrize("sigmas, is_rest", [(0.4, True), (0.85, False)])
def test_rest_is_the_same_in_both_halves(sigmas, is_rest):
    """Up to four standard deviations of the difference of two means, 0.09 of the noise each; here of one taxel."""
    rows = at_rest()
    rows[:, 7] -= rows[:, 7].mean()
    rows[FRAMES // 2 :, 7] += rows[: FRAMES // 2, 7].mean() - rows[FRAMES // 2 :, 7].mean() + sigmas * NOISE
    assert rests(rows) == is_rest


def learned_from(rows):
    """The noise after a tare with these readings (frames, N)."""
    skin = counting_sole()
    skin.tare(rows, accept=True)
    return skin.noise


def each(values):
    """The same numbers for each taxel, in another order (k, N)."""
    rng = np.random.default_rng(2)
    return np.column_stack([rng.permutation(values) for _ in range(N)])


def quantiles(count):
    """Numbers with exactly the standard normal distribution, as far as ``count`` of them can have it."""
    return norm.ppf((np.arange(count) + 0.5) / count)


def test_taxel_is_dead_if_chance_repeats_its_number_with_a_probability_of_a_millionth():
    """One taxel sends one number; the others send 0 in three of five frames, else 1."""
    for frames in range(23, 33):
        rows = np.tile((np.arange(frames) % 5 >= 3).astype(float)[:, None], N)
        rows[:, 3] = 0
        most = (rows == 0).mean()
        assert learned_from(rows).dead[3] == (most**frames < 1e-6)


@pytest.mark.parametrize("frames", [20, 60])
def test_few_frames_give_wider_levels(frames):
    """The threshold is that of Student's distribution with the freedom of the frames, to 3 %."""
    rows = each(np.rint(1e5 + 1e3 * quantiles(frames)))
    noise = learned_from(rows)
    false_sure = 3e-4 / 2 / N
    expected = rows.mean(axis=0) + 0.5 + rows.std(axis=0, ddof=1) * t.isf(false_sure, frames - 1)
    np.testing.assert_allclose(noise.sure - 1e5, expected - 1e5, rtol=0.03)


def test_noise_of_a_clipped_taxel_is_that_of_its_readings_and_of_50_frames_of_all():
    """Its deviation is twice that of the others: the likelihood of both histograms together has its maximum there."""
    deviations = np.where(np.arange(N) == 7, 4.0, 2.0)
    rows = np.maximum(np.rint(each(quantiles(FRAMES)) * deviations), 0)
    levels = np.arange(rows.max() + 1)
    own, of_all = (np.array([(part == level).sum() for level in levels]) for part in (rows[:, 7], rows))
    counts = own + 50 * of_all / of_all.sum()

    def misfit(x):
        below = norm.cdf((levels + 0.5 - x[0]) / x[1])
        return -(counts * np.log(np.maximum(np.diff(below, prepend=0), 1e-300))).sum()

    mean, deviation = minimize(misfit, (0.5, 3.0), method="Nelder-Mead").x
    noise = learned_from(rows)
    assert noise.sigma[7] == pytest.approx(np.hypot(deviation, 12**-0.5), rel=0.01)
    assert noise.mean[7] == pytest.approx(mean, abs=0.04)
