"""Readings to forces: single taxels by the equation, and all taxels at once with the same result."""

import dataclasses
import warnings

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.calibration import Response, ResponseTable, TaxelResponses
from skin_calib_addon.calibration.response_checks import is_monotone
from tests.samples import boards, sheet, small_calibration

STRAIGHT = Response()
RISING = Response((-0.5, 0.02, 0.0001), (5.0, 250.0))
FALLING = Response((40.0, -0.04), (100.0, 1000.0))
TABLE = ResponseTable((0.0, 100.0, 250.0), (0.0, 1.0, 16.0))
DOWN = ResponseTable((100.0, 600.0, 1000.0), (30.0, 4.0, 0.0))
KINDS = (STRAIGHT, RISING, FALLING, TABLE, DOWN)

coefficients = st.lists(st.floats(-10, 10), min_size=1, max_size=5).map(tuple)
bounds = st.lists(st.integers(-1000, 1000), min_size=2, max_size=6, unique=True).map(sorted)


@st.composite
def tables(draw):
    readings = draw(bounds)
    n = len(readings)
    forces = sorted(draw(st.lists(st.floats(-10, 50), min_size=n, max_size=n)), reverse=draw(st.booleans()))
    return ResponseTable(tuple(map(float, readings)), tuple(forces))


responses = st.one_of(
    coefficients.map(Response),
    st.tuples(coefficients, bounds).map(lambda given: Response(given[0], (float(given[1][0]), float(given[1][-1])))),
    tables(),
)
readings = st.one_of(st.floats(-2000, 2000), st.integers(0, 255).map(float), st.sampled_from([np.nan, np.inf, -np.inf]))


def naive(response, reading):
    """Return the force of one reading, as the schema defines it."""
    if not np.isfinite(reading):
        return np.nan
    if isinstance(response, ResponseTable):
        x, y = response.readings, response.forces
        if reading <= x[0] or reading >= x[-1]:
            return max(y[0] if reading <= x[0] else y[-1], 0.0)
        k = max(i for i in range(len(x)) if x[i] <= reading)
        fraction = (reading - x[k]) / (x[k + 1] - x[k])
        return max(y[k] + fraction * (y[k + 1] - y[k]), 0.0)
    if response.range is not None:
        reading = min(max(reading, response.range[0]), response.range[1])
    return max(sum(c * reading**k for k, c in enumerate(response.coefficients)), 0.0)


@given(
    kinds=st.lists(responses, min_size=1, max_size=5),
    choice=st.lists(st.tuples(st.integers(0, 4), readings), max_size=30),
)
def test_all_taxels_at_once_equal_single_taxels(kinds, choice):
    """For any mixture of responses and any readings, the forces are those of the schema."""
    index = np.array([i % len(kinds) for i, _ in choice], np.int64)
    intensity = np.array([reading for _, reading in choice])
    expected = [naive(kinds[i], x) for i, x in zip(index, intensity)]
    together = TaxelResponses(kinds, index).forces(intensity)
    assert together.shape == intensity.shape
    assert_allclose(together, expected, rtol=1e-9, atol=1e-9)
    assert_allclose([kinds[i].newtons(x) for i, x in zip(index, intensity)], expected, rtol=1e-9, atol=1e-9)


def test_responses_go_by_patch_and_taxel():
    """Taxels have their own response, or that of the link, in the order of the patches."""
    own = dataclasses.replace(boards(2), taxels=dataclasses.replace(boards(2).taxels, responses=np.array((1, 0))))
    calibration = small_calibration(1, 2, patches=(sheet(1, 2, 0.01), own), response=RISING, responses=(DOWN, TABLE))
    responses = TaxelResponses.of(calibration)
    intensity = np.full(4, 200.0)
    expected = [naive(r, 200.0) for r in (RISING, RISING, TABLE, DOWN)]
    assert_allclose(responses.forces(intensity), expected, rtol=1e-14)
    assert responses.rest.tolist() == [5, 5, 0, 1000] and responses.full.tolist() == [250, 250, 250, 100]
    assert not responses.rest.flags.writeable and not responses.full.flags.writeable
    assert len(TaxelResponses.of(small_calibration(patches=())).forces([])) == 0


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint16, np.float32, np.float64, bool])
def test_readings_of_any_dtype_never_wrap(dtype):
    """Squares of 8-bit readings do not overflow."""
    raw = np.array([0, 1, 200, 255]).astype(dtype)
    expected = [naive(RISING, float(x)) for x in raw]
    assert_allclose(TaxelResponses([RISING], np.zeros(4, int)).forces(raw), expected, rtol=1e-12)


def test_readings_outside_the_range_have_the_force_of_its_ends():
    """A polynomial is not valid outside its range: this one would give 23.5 N far below it."""
    assert_allclose(RISING.newtons([-600.0, 250.0, 300.0]), [0.0, 10.75, 10.75])
    assert_allclose(Response((9.0, -0.5), (2.0, 10.0)).newtons([0.0, 2.0, 10.0, 30.0]), [8.0, 8.0, 4.0, 4.0])


def test_tables_of_several_taxels_end_each_at_their_own_forces():
    """Readings beyond both ends have the forces of the ends, whichever table is before or after on the common axis."""
    later = ResponseTable((20.0, 50.0, 200.0), (0.5, 1.0, 3.0))
    responses = TaxelResponses([TABLE, later, DOWN], np.array((0, 1, 2, 0)))
    assert responses.forces(np.array((400.0, 900.0, 5000.0, 251.0))).tolist() == [16.0, 3.0, 0.0, 16.0]
    assert responses.forces(np.array((-300.0, 0.0, -2000.0, -1.0))).tolist() == [0.0, 0.5, 30.0, 0.0]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_overflow_gives_nan_without_warning(sign):
    """A force that overflows in either direction is not finite: it must differ from a taxel at rest."""
    cubic = Response((0.0, 0.0, 0.0, sign * 1e5))
    responses = TaxelResponses([cubic, TABLE], np.array((0, 0, 1)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        forces = responses.forces(np.array((1e200, 1e150, 1e300)))
        saturated = responses.saturated(np.array((1e200, 1e308, 1e308)))
    assert not np.isfinite(forces[:2]).any() and forces[2] == 16.0
    assert saturated.tolist() == [False, False, True]


@pytest.mark.parametrize(("response", "rest", "full"), [*zip(KINDS, (0, 5, 1000, 0, 1000), (None, 250, 100, 250, 100))])
def test_rest_and_full_are_the_ends_of_the_range(response, rest, full):
    """Readings of smallest force and of saturation, for rising and falling sensors."""
    assert (response.rest, response.full) == (rest, full)
    responses = TaxelResponses([response], np.zeros(3, int))
    assert not responses.saturated([np.nan, np.inf, -np.inf]).any()
    if full is None:
        assert responses.full.tolist() == [np.inf] * 3 and not responses.saturated([0, 1e9, -1e9]).any()
        return
    inwards, outwards = np.nextafter(full, rest), full + (full - rest)
    assert responses.saturated([full, inwards, outwards]).tolist() == [True, False, True]
    assert_array_equal(
        responses.forces([full, rest, outwards])[[0, 0]], responses.forces([outwards, rest, full])[[0, 2]]
    )


@given(
    coefficients=st.lists(st.floats(-5, 5), min_size=1, max_size=7), low=st.floats(-20, 20), width=st.floats(0.1, 40)
)
@example(coefficients=[0.0, 0.0, 1.0], low=-1.0, width=2.0)
@example(coefficients=[0.0, 1.0], low=0.0, width=1.0)
def test_monotone_agrees_with_many_readings(coefficients, low, width):
    """The result agrees with values at 4001 readings, except for reversals below rounding."""
    values = np.polynomial.polynomial.polyval(np.linspace(low, low + width, 4001), coefficients)
    steps, span = np.diff(values), np.ptp(values)
    # Sum of all reversals, against the direction from the first to the last value.
    back = min(np.clip(steps, 0, None).sum(), np.clip(-steps, 0, None).sum())
    if back > 1e-6 * span:
        assert not is_monotone(coefficients, low, low + width)
    elif back < 1e-12 * span and np.abs(steps).min() > 1e-7 * span:
        assert is_monotone(coefficients, low, low + width)


def test_monotone_knows_its_hard_cases():
    """A flat point, a constant, a maximum just outside and just inside, a range far from zero, an overflow."""
    assert is_monotone([0, 0, 0, 1], -1, 1) and is_monotone([2.5], 0, 1) and is_monotone([0, 0], 0, 1)
    assert is_monotone([0, 2, -1], 0, 1) and not is_monotone([0, 2, -1], 0, 1.01)
    assert is_monotone([0, -2e7, 1], 1e7, 1e7 + 50) and not is_monotone([0, -2e7, 1], 1e7 - 50, 1e7 + 50)
    assert not is_monotone([0, 1, -0.475, -0.08 / 3], -1, 1)  # the smallest coefficient reverses it at 0.98
    assert not is_monotone([0, 1, 1e300], 0, 1e100) and not is_monotone([1e308, 1e308], 0, 1e3)
