"""Fitted responses of synthetic sensors with known truth, and warnings about the measurements."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.calibration import Response, ResponseTable
from skin_calib_addon.calibration.response import response_document
from skin_calib_addon.calibration.response_checks import response_findings
from skin_calib_addon.calibration.response_fit import fit_response
from skin_calib_addon.common.errors import UnderdeterminedFit

FULL = 20.0  # [N] saturation of the sensors of the simulated forearm


def forearm(forces, noise=0.0, seed=1):
    """Return readings of the simulated forearm: 8 bits, I = 255 (1 - (1 - F / 20)^3)."""
    exact = 255 * (1 - (1 - np.minimum(forces, FULL) / FULL) ** 3)
    return np.clip(np.rint(exact + np.random.default_rng(seed).normal(0, noise, len(forces))), 0, 255)


def forearm_truth(readings):
    return FULL * (1 - np.cbrt(1 - readings / 255))


def presses(largest, n=300, seed=0):
    return np.random.default_rng(seed).uniform(0, largest, n)


def errors(fit, truth, low, high):
    """Return predicted minus true forces for readings between two values."""
    x = np.linspace(low, high, 1001)
    return fit.response.newtons(x) - truth(x)


def about(fit, code):
    return [warning.message for warning in fit.warnings if warning.code == code]


@pytest.mark.parametrize(("noise", "rms", "largest"), [(0.0, 0.01, 0.03), (0.5, 0.015, 0.05), (2.0, 0.05, 0.2)])
def test_forearm_sensor_is_fitted(noise, rms, largest):
    """Up to 10 N an 8-bit step is at most 0.1 N: the error is a tenth of that, and with noise half of it.

    A standard deviation of 2 readings is 0.2 N there; 300 measurements and 4 to 6 numbers leave a seventh to a tenth.
    """
    forces = presses(10.0)
    readings = forearm(forces, noise)
    fit = fit_response(readings, forces)
    assert isinstance(fit.response, Response) and fit.response.range == (readings.min(), readings.max())
    off = errors(fit, forearm_truth, readings.min(), readings.max())
    assert np.sqrt(np.mean(off**2)) < rms and np.abs(off).max() < largest
    assert fit.used.all() and fit.warnings == ()
    assert_allclose(fit.residuals, forces - fit.response.newtons(readings), rtol=0, atol=0)


def test_steep_sensor_is_a_table():
    """A curve that becomes steeper up to 16 N is not a polynomial; knots are where it bends."""
    forces = presses(16.0, 1000)
    readings = forearm(forces)
    fit = fit_response(readings, forces)
    assert isinstance(fit.response, ResponseTable) and len(fit.response.readings) <= 24
    off = errors(fit, forearm_truth, readings.min(), readings.max())
    # The last 8-bit steps are 0.3 N and more.
    assert np.sqrt(np.mean(off**2)) < 0.02 and np.abs(off).max() < 0.3
    assert np.mean(np.array(fit.response.readings) > 128) > 0.5


@pytest.mark.parametrize("falls", [False, True])
def test_saturated_measurements_are_left_out(falls):
    """Measurements in saturation affect only the end of the curve, not its shape."""
    forces = presses(30.0)
    readings = np.clip(np.rint(12 * forces + np.random.default_rng(3).normal(0, 1, 300)), 0, 255)
    full = 255.0
    if falls:
        readings, full = 1000 - readings, 745.0
    fit = fit_response(readings, forces)
    off = errors(fit, lambda x: np.abs(x - (1000 if falls else 0)) / 12, readings.min(), readings.max())
    assert np.abs(off).max() < 0.03  # a third of a reading
    assert fit.response.full == full
    assert 255 / 12 - 0.3 < fit.response.newtons(full) < 255 / 12 + 0.3
    assert (~fit.used).sum() == (readings == full).sum() - 1 and (forces[~fit.used] > 21).all()
    (text,) = about(fit, "saturated")
    assert len(fit.warnings) == 1
    assert f"all read {full:g}. The sensor is saturated there" in text and text.startswith(
        f"{(readings == full).sum()} "
    )


def test_dead_zone_gives_no_force():
    """A sensor without reaction below 2 N: no force at rest, correct forces above, and a warning."""
    forces = presses(20.0)
    readings = np.clip(np.rint(12 * (forces - 2) + np.random.default_rng(4).normal(0, 0.5, 300)), 0, 255)
    fit = fit_response(readings, forces)
    assert fit.response.newtons(0.0) < 0.1
    off = errors(fit, lambda x: 2 + x / 12, 5, readings.max())
    assert np.abs(off).max() < 0.1
    (text,) = about(fit, "dead-zone")
    assert len(fit.warnings) == 1
    assert "all read 0. The sensor does not react to smaller forces" in text


@pytest.mark.parametrize(("least", "quantity"), [(0.5, "force"), (20.0, "temperature")])
def test_rest_has_the_least_value_of_the_dead_zone(least, quantity):
    """No measurement is below 0.5 N, or 20 degC: the reading of the dead zone gives this, neither 0 nor a mean."""
    values = least * np.linspace(1, 9, 81)
    readings = np.rint(np.maximum(values / least - 3, 0.0) * 40)
    fit = fit_response(readings, values, quantity, "unit")
    assert len(about(fit, "dead-zone")) == 1
    assert_allclose(fit.response.values(0.0), least, rtol=0.02)
    assert_allclose(fit.response.values(120.0), 6 * least, rtol=0.02)


def cycles(lag, noise=0.5):
    """Return three cycles up to 12 N and back; the reading lags by a force in both directions."""
    forces = np.tile(np.concatenate((np.linspace(0, 12, 40), np.linspace(12, 0, 40))), 3)
    direction = np.tile(np.repeat((1.0, -1.0), 40), 3)
    exact = 18 * (forces - lag * direction * np.sin(np.pi * forces / 12))
    return np.rint(exact + np.random.default_rng(5).normal(0, noise, len(forces))), forces


def test_hysteresis_is_reported_and_halved():
    """The response is the mean of both directions; the mean difference for a lag of 0.3 N is 0.38 N."""
    readings, forces = cycles(0.3)
    fit = fit_response(readings, forces)
    assert np.abs(errors(fit, lambda x: x / 18, 0, readings.max())).max() < 0.05
    (text,) = about(fit, "hysteresis")
    assert "is 0.3" in text and "N larger while it rises" in text
    backwards = fit_response(*cycles(-0.3))
    assert "N smaller while it rises" in about(backwards, "hysteresis")[0]


@pytest.mark.parametrize("fraction", [0.1, 0.4, 0.6])
def test_large_hysteresis_is_no_independence(fraction):
    """Unloading a foam with a fraction of the force of loading: the warning states it, and nothing else."""
    up = np.linspace(0, 255, 40)
    loading = 3.85 * (up / 255) ** 1.3
    fit = fit_response(np.concatenate((up, up[::-1])), np.concatenate((loading, (1 - fraction) * loading[::-1])))
    (warning,) = fit.warnings
    assert warning.code == "hysteresis" and "N larger while it rises than while it falls" in warning.message
    stated = float(warning.message.split("%")[0].split()[-1]) / 100
    assert stated == pytest.approx(fraction, rel=0.11)


def test_scatter_is_no_independence():
    """Two taxels of other gains in one table: the readings depend on the force, but do not determine it.

    The larger force of each reading follows a rise more often than not, which is no hysteresis.
    """
    forces = np.random.default_rng(3).uniform(0, 10, 200)
    (warning,) = fit_response(np.where(np.arange(200) % 2, 10, 25) * forces, forces).warnings
    assert warning.code == "poor-response" and "scatters by 1." in warning.message and "hardly" not in warning.message


def test_hysteresis_is_reported_for_constant_forces():
    """Steps of 1 N up to 12 N and back, with 20 readings each: the last change gives the direction."""
    forces = np.repeat(np.concatenate((np.arange(13.0), np.arange(11.0, 0, -1))), 20)
    lag = np.repeat((0.8, -0.8), (260, 220))
    readings = np.rint(18 * (forces - lag) + np.random.default_rng(6).normal(0, 1, len(forces)))
    assert "N larger while it rises" in about(fit_response(readings, forces), "hysteresis")[0]


@given(seed=st.integers(0, 2**20), noise=st.floats(0, 3), n=st.integers(10, 200))
def test_noise_does_not_give_hysteresis_warnings(seed, noise, n):
    """Noise of up to 3 readings, in cycles and in any order."""
    rng = np.random.default_rng(seed)
    for forces in (np.abs(np.linspace(-12, 12, n)), rng.uniform(0, 12, n)):
        fit = fit_response(np.rint(18 * forces + rng.normal(0, noise, n)), forces)
        assert about(fit, "hysteresis") == []


def test_smallest_sufficient_degree_is_used():
    """Exact polynomials are found exactly; rounding does not increase the degree."""
    x = np.arange(0.0, 4096, 41)
    for powers in ([0.0, 1e-3], [0.5, 1e-3, 1e-7], [0.0, 1e-3, 0.0, 1e-10]):
        fit = fit_response(x, np.polynomial.polynomial.polyval(x, powers))
        assert len(fit.response.coefficients) == len(powers)
        assert_allclose(fit.response.newtons(x), np.polynomial.polynomial.polyval(x, powers), rtol=0, atol=1e-7)


def test_readings_far_from_zero_keep_their_digits():
    """24 bits, of which the sensor uses the last few: powers lose accuracy, and the result is a table."""
    forces = presses(10.0)
    readings = np.rint(8e6 + 300 * np.sqrt(forces))
    fit = fit_response(readings, forces)
    off = errors(fit, lambda x: ((x - 8e6) / 300) ** 2, readings.min(), readings.max())
    assert np.abs(off).max() < 0.05  # a reading is 0.02 N at 10 N


def test_response_is_monotone_for_other_forces():
    """A parabola fits forces that fall near the end best, but is not a valid response."""
    readings = np.arange(100.0)
    fit = fit_response(readings, 50 - (readings - 70) ** 2 / 100)
    assert isinstance(fit.response, ResponseTable)
    assert (np.diff(fit.response.forces) >= 0).all()
    assert np.abs(fit.residuals[:60]).max() < 1.0 and np.abs(fit.residuals).max() < 7


def test_coarse_readings_do_not_count_as_saturated():
    """With four bits, each reading covers 7 % of the forces, and the last covers no more."""
    forces = presses(20.6)
    fit = fit_response(np.rint(0.75 * forces), forces)
    assert fit.used.all() and fit.warnings == ()


def test_random_readings_have_no_hysteresis():
    """If readings are independent of the force, the warning states that, and not hysteresis."""
    (warning,) = fit_response(np.random.default_rng(7).uniform(0, 255, 100), presses(10.0, 100)).warnings
    assert warning.code == "poor-response" and "hardly depend" in warning.message


@pytest.mark.parametrize(
    ("readings", "forces", "words"),
    [
        ([0, 10, 20, 30], [0, 1, 2, 3], "only 4 measurements at 4 readings. Take 10 or more"),
        ([0, 10, 20, 30] * 5, [0, 1, 2, 3] * 5, "only 20 measurements at 4 readings"),
        ([*range(10), *range(40, 60)], [*range(10), *range(40, 60)], "No measurement reads between 9 and 40"),
        ([7, 3, 9, 1, 5, 8, 2, 6, 4, 0] * 3, [*range(30)], "The readings hardly depend on the force"),
    ],
)
def test_warnings_are_given(readings, forces, words):
    """Few points, few readings, a gap, no relation: one warning for each."""
    (warning,) = fit_response(np.array(readings), np.array(forces)).warnings
    assert words in str(warning)


@pytest.mark.parametrize("readings", [[], [5.0], [5.0, 5.0, 5.0]])
def test_constant_measurements_are_an_error(readings):
    """Constant readings or forces determine no response."""
    with pytest.raises(UnderdeterminedFit, match="Measure at two or more forces with different readings"):
        fit_response(np.array(readings), np.arange(float(len(readings))))


measurements = st.lists(st.tuples(st.integers(-50, 300), st.floats(-1, 50)), min_size=2, max_size=40).filter(
    lambda rows: min(len(set(column)) for column in zip(*rows)) > 1
)


@given(rows=measurements)
def test_any_measurements_give_a_valid_response(rows):
    """For any measurements the response is monotone on their readings, finite, and valid in a file."""
    readings, forces = np.array(rows, float).T
    fit = fit_response(readings, forces)
    assert list(response_findings(response_document(fit.response), "")) == []
    assert {fit.response.rest, fit.response.full} == {readings.min(), readings.max()}
    predicted = fit.response.newtons(np.linspace(readings.min(), readings.max(), 50))
    assert np.isfinite(predicted).all() and predicted.max() <= max(2 * np.abs(forces).max(), 1)
    assert len(fit.residuals) == fit.used.sum() >= 2


@pytest.mark.parametrize("unit", [1e-15, 1e-100, 1e12 / 255])
def test_unit_of_readings_makes_no_difference(unit):
    """Any unit gives the same curve; if powers overflow, it is a table."""
    forces = presses(10.0)
    readings = forearm(forces) * unit
    fit = fit_response(readings, forces)
    off = errors(fit, lambda x: forearm_truth(x / unit), readings.min(), readings.max())
    assert np.abs(off).max() < (0.03 if isinstance(fit.response, Response) else 0.1)
    assert isinstance(fit.response, Response) == (unit > 1e-90)


values = st.floats(-1e12, 1e12).filter(lambda x: x == 0 or abs(x) >= 1e-100)


@given(
    rows=st.lists(
        st.tuples(values | st.sampled_from((0.0, 1e-100, 1e-90, 1.0, 1 + 1e-15)), values),
        min_size=2,
        max_size=12,
    ).filter(lambda rows: min(len(set(column)) for column in zip(*rows)) > 1)
)
def test_extreme_measurements_give_a_valid_response(rows):
    """Readings that differ in the last bit, or span the full range: no NumPy warning, no overflow."""
    readings, forces = np.array(rows, float).T
    fit = fit_response(readings, forces)
    assert list(response_findings(response_document(fit.response), "")) == []
    assert np.isfinite(fit.response.newtons(readings)).all()


@given(rows=measurements)
def test_mirrored_readings_give_the_mirrored_response(rows):
    """Rising and falling sensors are treated equally."""
    readings, forces = np.array(rows, float).T
    together = np.sum((readings - readings.mean()) * (forces - forces.mean()))
    assume(abs(together) > 1e-6)  # without correlation, the sensor counts as rising
    fit, mirrored = fit_response(readings, forces), fit_response(-readings, forces)
    x = np.linspace(readings.min(), readings.max(), 50)
    assert_allclose(mirrored.response.newtons(-x), fit.response.newtons(x), rtol=0, atol=1e-6 * max(1, np.ptp(forces)))
