"""Limits of the runtime that no other test comes near: a reading just within passes, one just beyond does not."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from scipy.stats import norm, t

from skin_calib_addon.calibration import Response
from skin_calib_addon.runtime import Body, Skin
from skin_calib_addon.runtime.byte_order import ByteOrder
from skin_calib_addon.runtime.plane import ground_of
from skin_calib_addon.runtime.rest import is_rest
from tests.samples import plane, small_calibration
from tests.soles import skin_of, sole_patch

N, FRAMES, NOISE = 42, 250, 4.0


def sole():
    """A sole at default settings, 0.2 N for each count."""
    response = Response((0.0, 0.2))
    return Skin(small_calibration(link="sole", patches=(sole_patch(),), surfaces=(plane(),), response=response))


def at_rest(correlation=0.0):
    """Readings without contact; the correlation is that of successive ones."""
    rows = np.random.default_rng(0).normal(size=(FRAMES, N))
    for k in range(1, FRAMES):
        rows[k] = correlation * rows[k - 1] + (1 - correlation**2) ** 0.5 * rows[k]
    return NOISE * rows


def rests(rows):
    """Whether the skin learns its noise from these readings by itself."""
    return is_rest(rows, np.zeros(N), False)


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


@pytest.mark.parametrize("millimetres, degrees, flags", [
    (4.0, 0.0, set()), (6.0, 0.0, {"not_coplanar"}), (0.0, 2.5, set()), (0.0, 3.5, {"not_coplanar"})
])  # fmt: skip
def test_feet_are_on_one_plane_up_to_5_mm_and_3_degrees(millimetres, degrees, flags):
    """The right foot is higher, or inclined about the ground point below its origin."""
    body = Body({"left": skin_of(sole_patch()), "right": skin_of(sole_patch())})
    right = np.eye(4)
    right[:3, :3] = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    right[2, 3] = 1e-3 * millimetres
    frame = body.update(dict.fromkeys(body.skins, np.full(N, 10.0)), 0.0, {"left": np.eye(4), "right": right})
    assert frame.flags == flags


@pytest.mark.parametrize("degrees, stands", [(55.0, True), (65.0, False), (80.0, False)])
def test_taxels_up_to_60_degrees_from_straight_down_can_stand(degrees, stands):
    """Two of 20 are inclined to opposite sides, and higher than the others: the ground is the mean of those that do."""
    a = np.deg2rad(degrees)
    normals = np.tile((0, 0, -1.0), (20, 1))
    normals[:2] = (np.sin(a), 0, -np.cos(a)), (-np.sin(a), 0, -np.cos(a))
    positions = np.column_stack((np.arange(20) % 5, np.arange(20) // 5, np.arange(20) < 2)) * 0.01
    plane = ground_of(positions, normals, np.full(20, 1e-4))
    assert (plane.origin[2] > 0) == stands


def learned_from(rows):
    """The noise after a tare with these readings (frames, N)."""
    skin = sole()
    skin.tare(rows)
    return skin.noise


def each(values):
    """The same numbers for each taxel, in another order (k, N)."""
    rng = np.random.default_rng(2)
    return np.column_stack([rng.permutation(values) for _ in range(N)])


def quantiles(count):
    """Numbers with exactly the standard normal distribution, as far as ``count`` of them can have it."""
    return norm.ppf((np.arange(count) + 0.5) / count)


@pytest.mark.parametrize("fraction, is_clipped", [(0.03, False), (0.07, True)])
def test_more_than_a_twentieth_of_the_readings_at_the_lowest_level_is_clipped(fraction, is_clipped):
    """Readings with a deviation of 4, cut off at a level: that of clipped ones is the one before."""
    rows = each(np.maximum(np.rint(100 + 4 * quantiles(250)), np.rint(100 + 4 * norm.ppf(fraction))))
    assert ((rows[:, 0] == rows.min()).mean() > 0.05) == is_clipped
    assert (abs(learned_from(rows).sigma[0] / rows[:, 0].std(ddof=1) - 1) > 1e-6) == is_clipped


@pytest.mark.parametrize("lowest, is_clipped", [(40, False), (60, True)])
def test_clipped_readings_are_half_as_many_as_those_of_the_next_level(lowest, is_clipped):
    """Of 250 readings, 100 are at the next level."""
    rows = each(np.repeat((7.0, 8.0, 9.0), (lowest, 100, 150 - lowest)))
    assert (abs(learned_from(rows).mean[0] - rows[:, 0].mean()) > 1e-6) == is_clipped


@pytest.mark.parametrize("probability, is_tail", [(0.014, False), (0.007, True)])
def test_noise_with_a_largest_reading_of_a_probability_below_a_hundredth_is_not_normal(probability, is_tail):
    """Of 250 readings of 42 taxels, one is as far from rest as the largest one is with this probability."""
    rows, far = each(np.rint(1e5 + 1e3 * quantiles(250))), norm.isf(probability / (250 * N))
    row = rows[:, 7]
    for _ in range(20):  # the reading changes the mean and the deviation that it is compared with
        row[np.argmax(row)] = np.rint(row.mean() + 0.5 + far * row.std(ddof=1))
    noise = learned_from(rows)
    assert (noise.sure[7] > row.mean() + 8 * row.std(ddof=1)) == is_tail


def test_taxel_is_dead_if_chance_repeats_its_number_with_a_probability_of_a_millionth():
    """One taxel sends one number; the others send 0 in three of five frames, else 1."""
    for frames in range(20, 40):
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


@pytest.mark.parametrize("response_range, is_flagged", [(4000.0, True), (4200.0, False)])
def test_range_below_16_levels_of_256_is_of_readings_with_a_lower_byte(response_range, is_flagged):
    """Multiples of 256 that change: of such a response they are in the wrong order, of others they may be coarse."""
    order, rng = ByteOrder(response_range), np.random.default_rng(0)
    flags = [order.is_wrong(256.0 * rng.integers(0, 16, N), 0.02 * k) for k in range(5)]
    assert flags[-1] == is_flagged


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
