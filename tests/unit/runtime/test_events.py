"""Readings as events: frames are those of the full readings, to the bit."""

import dataclasses
import re
import tracemalloc

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from skin_calib_addon.calibration import Response, ResponseTable
from skin_calib_addon.runtime import Skin
from tests.samples import plane, small_calibration
from tests.soles import skin_of, sole_patch

N = 42
FIRST = 5  # the lowest channel; those below belong to another skin
LENGTH = FIRST + N
TABLE = ResponseTable((0.0, 300.0, 4000.0), (0.0, 2.0, 40.0))
CUBIC = Response((0.0, 0.01, 1e-6, 1e-10), (0.0, 4000.0))


def calibration(responses=(), own=None, response=CUBIC):
    """Return a sole whose channels begin at FIRST; ``own`` has the response of each taxel."""
    patch = sole_patch(first_channel=FIRST)
    if own is not None:
        patch = dataclasses.replace(patch, taxels=dataclasses.replace(patch.taxels, responses=np.array(own)))
    return small_calibration(
        link="left_sole", patches=(patch,), surfaces=(plane(),), response=response, responses=responses
    )


SKINS = {
    "cubic": calibration(),
    "table": calibration(response=TABLE),
    "both": calibration((CUBIC, TABLE, Response((0.0, -0.01), (-4000.0, 0.0))), np.arange(N) % 3),
}


def equal(one, other):
    """Check that two values have the same bits, through records, tuples and arrays."""
    if isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        assert_array_equal(one, other)
    elif dataclasses.is_dataclass(one):
        for field in dataclasses.fields(one):
            if field.name not in ("deviations", "skin", "ground"):
                equal(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, tuple | list):
        assert len(one) == len(other)
        for a, b in zip(one, other):
            equal(a, b)
    else:
        assert one == other or (one != one and other != other)


def same(one, other):
    """Check that two frames are the same, with all that is computed when it is first used."""
    for name in ("time", "flags", "problem", "forces", "known", "saturated", "stuck", "contacts", "wrench", "sets"):
        equal(getattr(one, name), getattr(other, name))
    for name in ("active", "load", "stands", "reason", "cop", "zmp", "force_sigmas", "cop_sigma", "noise"):
        equal(getattr(one, name), getattr(other, name))
    for name in ("outer", "nominal", "guaranteed"):
        equal(getattr(one.polygon, name).corners, getattr(other.polygon, name).corners)


def pushes(count, rng):
    """Return full readings with noise, a foot that comes and goes, and times."""
    rest = rng.normal(10, 2, (count, LENGTH))
    foot = 400.0 * np.clip(np.sin(np.arange(count) / 40), 0, 1)[:, None] * (np.arange(LENGTH) % 3 == 0)
    return np.rint(np.clip(rest + foot, 0, 4095)).astype(np.uint16), np.arange(count) / 200


@pytest.mark.parametrize(("options", "most"), [({}, 1), ({"switch_on": 0.2}, 200), ({"creep": (0.2, 0.5)}, 5)])
def test_frames_of_events_are_those_of_full_readings(options, most):
    """Random events, from none to more than there are channels, with repeated ones; the last of them counts."""
    rng = np.random.default_rng(most)
    full, events = Skin(SKINS["both"], **options), Skin(SKINS["both"], **options)
    rows, times = pushes(130, rng)
    rest = np.rint(np.clip(rng.normal(10, 2, (100, LENGTH)), 0, 4095)).astype(np.uint16)
    full.tare(rest, accept=True)
    events.tare(rest, accept=True)
    now = rows[0].copy()
    same(full.update(now, times[0]), events.update(now, times[0]))
    for row, time in zip(rows[1:], times[1:]):
        indices = rng.integers(0, LENGTH + 3, rng.integers(0, most + 1))
        values = np.append(row, [1, 2, 3]).astype(np.uint16)[indices] + rng.integers(0, 2, len(indices), np.uint16)
        for i, value in zip(indices, values):
            if i < LENGTH:
                now[i] = value
        same(full.update(now, time), events.update_events(indices, values, time))


def test_events_before_the_first_reading():
    """Taxels that have not sent anything are unknown, as NaN in a full reading."""
    full, events = (Skin(SKINS["table"]) for _ in range(2))
    now = np.full(LENGTH, np.nan)
    same(full.update(now, 0.0), events.update_events([], [], 0.0))
    assert events.update_events([], [], 0.0).touched is None
    now[[7, 9]] = 500.0, 600.0
    same(full.update(now, 0.0), events.update_events([7, 9], [500.0, 600.0], 0.0))
    for k in range(FIRST, LENGTH):
        now[k] = 3.0 * k
        same(full.update(now, k / 100), events.update_events([k], [3.0 * k], k / 100))


def test_events_and_full_readings_mix():
    """Each continues from the other; tare, masked taxels, lost numbers and times that are wrong included."""
    rng = np.random.default_rng(3)
    full, events = (Skin(SKINS["both"]) for _ in range(2))
    rows, times = pushes(150, rng)
    now, rest = rows[0].astype(float), np.rint(rng.normal(100, 2, (25, LENGTH)))
    for k, (row, time) in enumerate(zip(rows, times)):
        if k % 50 == 20:
            for skin in (full, events):
                skin.tare(rest, accept=True)
        if k == 90:
            for skin in (full, events):
                skin.mask(["sole.3", "sole.8"])
        time = {60: np.nan, 61: np.inf, 100: 0.1, 140: 90.0}.get(k, time)
        indices = rng.permutation(LENGTH)[:4]
        now[indices] = row[indices]
        if k % 17 == 0:
            now[indices[0]] = (np.nan, np.inf, 1e300)[k % 3]
        if k == 120:
            now[:] = np.nan
        one = full.update(now, time)
        events.forces(np.zeros(LENGTH))  # changes nothing
        same(one, events.update(now, time) if k % 10 == 0 else events.update_events(indices, now[indices], time))


def test_masked_events_are_lost_numbers():
    """A masked value is NaN, as in a masked array of full readings."""
    full, events = skin_of(sole_patch()), skin_of(sole_patch())
    now = np.full(N, 2.0)
    same(full.update(now, 0.0), events.update(now, 0.0))
    now[4] = np.nan
    now[5] = 3.0
    values = np.ma.masked_array([9, 3], [True, False])
    same(full.update(now, 0.1), events.update_events([4, 5], values, 0.1))


def test_skin_learns_its_noise_from_events():
    """First quiet frames give the same noise, and whole numbers stay whole where a frame has no event."""
    rng = np.random.default_rng(5)
    full, events = (Skin(calibration(response=Response((0.0, 0.01)))) for _ in range(2))
    now = np.rint(np.clip(rng.normal(0, 2, LENGTH), 0, 4095)).astype(np.uint16)
    same(full.update(now, 0.0), events.update(now, 0.0))
    for k in range(1, 250):
        indices = rng.permutation(LENGTH) if k % 23 else np.empty(0, int)
        now[indices] = np.rint(np.clip(rng.normal(0, 2, len(indices)), 0, 4095))
        same(full.update(now, k / 200), events.update_events(indices, now[indices], k / 200))
    assert events.noise is not None


def test_silence_is_frozen_as_equal_readings_are():
    """The checks are those of `update`: no event for a second means that nothing changed."""
    rng = np.random.default_rng(7)
    skin = Skin(SKINS["cubic"])
    skin.tare(np.rint(rng.normal(100, 2, (200, LENGTH))).astype(np.uint16), accept=True)
    skin.update(np.rint(rng.normal(100, 2, LENGTH)).astype(np.uint16), 0.0)
    flags = [skin.update_events([], [], k / 100).flags for k in range(1, 100)]
    assert "frozen" not in flags[5] and "frozen" in flags[-1]
    assert "frozen" not in skin.update_events([FIRST], [120], 1.0).flags


@pytest.mark.parametrize(
    ("indices", "values", "flag", "message"),
    [
        ([1, 2], [1.0], "wrong_length", "2 indices for 1 values"),
        ([0.5], [1.0], "wrong_type", "must be one row of whole numbers; this one is float64 of shape"),
        ([True], [1.0], "wrong_type", "this one is bool of shape"),
        ([-1], [1.0], "wrong_type", "index -1 of an event is negative; channels are counted from 0"),
        ([[1]], [[1.0]], "wrong_type", "of shape \\(1, 1\\)"),
        ([1], [True], "wrong_type", "values of events must be one row of real numbers"),
        ([1], ["a"], "wrong_type", "values of events must be one row of real numbers"),
        ([1], None, "wrong_type", "values of events must be one row of real numbers"),
        (None, [1.0], "wrong_type", "indices of events must be one row of whole numbers"),
        ([[1], [1, 2]], [1.0], "wrong_type", "has rows of different lengths"),
        ([1], {"force": [1.0]}, "wrong_type", "values of events must be one row of real numbers"),
    ],
)
def test_wrong_events_are_refused_as_a_whole(indices, values, flag, message):
    """A flag and a sentence, as for `update`; no event of the packet counts, and the next packet continues."""
    full, events = skin_of(sole_patch()), skin_of(sole_patch())
    now = np.full(N, 2.0)
    same(full.update(now, 0.0), events.update(now, 0.0))
    frame = events.update_events(indices, values, 0.1)
    assert flag in frame.flags and frame.touched is None
    assert re.search(message, frame.problem), frame.problem
    now[3] = 1.0
    same(full.update(now, 0.2), events.update_events([3], [1.0], 0.2))


def test_channels_may_be_far_apart():
    """The memory follows the number of taxels, not the highest channel."""
    patch = sole_patch()
    taxels = dataclasses.replace(patch.taxels, channels=patch.taxels.channels * 10_000_000)
    tracemalloc.start()
    skin = skin_of(dataclasses.replace(patch, taxels=taxels))
    frame = skin.update_events([0, 41 * 10_000_000, 5], [3.0, 4.0, 9.0], 0.0)
    assert tracemalloc.get_traced_memory()[1] < 10e6
    tracemalloc.stop()
    assert frame.forces[[0, 41]].tolist() == [3.0, 4.0] and frame.known.sum() == 2
