"""Invalid readings and times.

Each problem is a flag, nothing raises an error, and the state of the skin stays correct.
"""

import gc
import threading
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from skin_calib_addon.calibration import Response, ResponseTable, TaxelResponses
from skin_calib_addon.common.errors import InvalidReading, UnknownTaxel
from skin_calib_addon.runtime import Skin
from skin_calib_addon.runtime.clock import Clock
from tests.samples import plane, small_calibration
from tests.soles import counting_sole, skin_of, sole_patch

N = 42
FLAGS = {"wrong_type", "wrong_length", "not_finite", "too_large", "blind", "saturated", "stuck", "lost", "overload"}
FLAGS |= {"below_rest", "byte_order", "time_not_finite", "time_still", "time_back", "time_jump", "dropped"}


def sole(**options):
    """Return a sole of 42 hexagons whose readings are newtons."""
    return skin_of(sole_patch(), **options)


def pressed_everywhere(force=20.0):
    """Return a reading in which every taxel is pressed."""
    return np.full(N, force)


@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf])
def test_invalid_taxels_are_not_without_contact(broken):
    """Some invalid taxels are flagged and left out.

    If all are invalid the skin is blind, which is not the same as no contact.
    """
    skin = sole()
    some = pressed_everywhere()
    some[:10] = broken
    frame = skin.update(some, 0.0)
    assert frame.flags == {"not_finite"} and frame.touched and frame.known.sum() == 32
    blind = skin.update(pressed_everywhere(broken), 0.1)
    assert blind.flags == {"not_finite", "blind"} and blind.touched is None
    assert np.isnan(blind.wrench).all() and blind.reason == "no taxel has a valid reading"
    free = skin.update(np.zeros(N), 0.2)
    assert free.flags == frozenset() and free.touched is False and (free.wrench == 0).all()


@pytest.mark.parametrize("has_noise", [False, True])
def test_taxel_stays_active_over_an_invalid_reading(has_noise):
    """A taxel keeps its hysteresis over an invalid reading: it was active, and is active with the next valid one."""
    skin, weak = sole(), pressed_everywhere(0.15)
    if has_noise:
        skin = counting_sole()
        skin.tare(100 + np.rint(4 * np.random.default_rng(0).normal(size=(250, N))), accept=True)
        weak = skin.noise.mean + 2 * skin.noise.sigma
    skin.update(weak + 100, 0.0)
    invalid = weak.copy()
    invalid[3] = np.nan
    assert not skin.update(invalid, 0.01).active[3]
    assert skin.update(weak, 0.02).active[3]


def test_saturated_taxel_is_counted_and_flagged():
    """Its force is the lower limit of the true one."""
    response = Response((0.0, 0.1), (0.0, 1000.0))
    skin = counting_sole(response, switch_on=0.2)
    reading = np.zeros(N)
    reading[5] = 4000
    frame = skin.update(reading, 0.0)
    assert frame.flags == {"saturated"} and frame.saturated.tolist().index(True) == 5
    assert frame.contacts[0].force == 100.0


def test_saturation_counts_the_baseline():
    """A sensor that reads 300 too high at rest is saturated 300 later, and one that reads too low earlier."""
    response = Response((0.0, 0.1), (0.0, 1000.0))
    skin = counting_sole(response, switch_on=0.2)
    offsets = np.zeros(N)
    offsets[5], offsets[6] = 300.0, -300.0
    skin.tare(offsets, accept=True)
    frame = skin.update(offsets + 900.0, 0.0)
    assert frame.flags == frozenset()
    pressed = np.zeros(N)
    pressed[5], pressed[6], pressed[7] = 1299.0, 701.0, 1001.0
    assert skin.update(pressed, 0.1).saturated.nonzero()[0].tolist() == [6, 7]


def test_masked_taxels_are_left_out_of_everything():
    """A masked taxel makes no contact and no flag. Unknown ids raise an error; an empty mask restores all taxels."""
    skin = sole()
    reading = np.zeros(N)
    reading[4] = np.nan
    reading[5] = 50.0
    skin.mask(["sole.4", "sole.5"])
    frame = skin.update(reading, 0.0)
    assert frame.flags == frozenset() and frame.touched is False and not frame.known[[4, 5]].any()
    with pytest.raises(UnknownTaxel, match="^no taxel 'sole.99' on the skin of left_sole; use") as raised:
        skin.mask(["sole.99"])
    assert isinstance(raised.value, KeyError)  # which it was before
    assert not skin.update(reading, 0.1).known[5]
    skin.mask([])
    assert skin.update(reading, 0.2).active[5]


def test_reading_that_never_changes_is_stuck():
    """The flag is for active taxels whose last bit does not change for 30 s.

    Inactive taxels may have constant readings.
    """
    skin = sole()
    moving = np.zeros(N)
    for k in range(32):
        moving[3], moving[9] = 5.0, 5.0 + 0.001 * (k % 2)
        frame = skin.update(moving, float(k))
        assert ("stuck" in frame.flags) == (k > 30) and frame.stuck.nonzero()[0].tolist() == [3] * (k > 30)
    moving[3] = 5.5
    assert "stuck" not in skin.update(moving, 33.0).flags


def test_stuck_readings_are_counted_from_a_step_back_in_time():
    """A clock that starts again at zero does not hide a stuck reading: it is stuck 30 s after the restart."""
    skin = sole()
    reading = np.zeros(N)
    reading[3] = 5.0
    for time in (1000.0, 0.0, 29.0):
        assert "stuck" not in skin.update(reading, time).flags
    assert skin.update(reading, 31.0).stuck.nonzero()[0].tolist() == [3]


def test_baseline_removes_the_offsets():
    """Offsets are subtracted from the readings, before the response; of several frames the mean counts."""
    rng = np.random.default_rng(1)
    offset = rng.uniform(-3, 3, N)
    for response in (Response((0.0, 0.1, 0.002)), ResponseTable((0.0, 100.0, 255.0), (30.0, 4.0, 0.0))):
        skin = counting_sole(response)
        skin.tare(np.stack((response.rest + offset - 1, response.rest + offset + 1)))
        assert np.abs(skin.forces(response.rest + offset)).max() < 1e-9
        expected = TaxelResponses([response], np.zeros(N, int)).forces(np.full(N, 40.0))
        np.testing.assert_allclose(skin.forces(40.0 + offset), expected, rtol=1e-9)


def test_baseline_is_the_mean_of_the_valid_frames_of_a_taxel():
    """Frames in which one taxel is invalid count for the other taxels only."""
    skin = sole()
    rows = np.full((4, N), 2.0)
    rows[:, 1] = (np.nan, np.inf, 5.0, 7.0)
    skin.tare(rows, accept=True)
    assert skin.forces(np.full(N, 10.0)).tolist() == [8.0, 4.0] + [8.0] * (N - 2)


def test_baseline_of_an_invalid_taxel_stays():
    """A baseline of the wrong length changes nothing at all."""
    skin = sole()
    skin.tare(np.full(N, 2.0), accept=True)
    invalid = np.full(N, 3.0)
    invalid[0] = np.nan
    skin.tare(invalid, accept=True)
    assert skin.forces(np.full(N, 3.0)).tolist() == [1.0] + [0.0] * (N - 1)
    frame = skin.update(np.full(N + 1, 3.0)[:5], 0.0)
    assert frame.flags == {"wrong_length"}
    with pytest.raises(Exception, match="the reading has 5 channels"):
        skin.tare(np.zeros(5))
    assert skin.forces(np.full(N, 3.0))[0] == 1.0


def test_masked_numbers_are_unknown():
    """Numbers under the mask of a masked array are not readings: of one frame, and of a rest."""
    skin = sole()
    reading = np.ma.array(np.full(N, 9), mask=np.arange(N) < 5)
    frame = skin.update(reading, 0.0)
    assert frame.flags == {"not_finite"} and frame.known.tolist() == [False] * 5 + [True] * (N - 5)
    assert np.isnan(skin.forces(reading)[:5]).all() and frame.wrench[2] == 9.0 * (N - 5)
    assert skin.update(np.ma.masked_all(N), 0.1).flags == {"not_finite", "blind"}
    rest = np.ma.array(np.full((2, N), 3), mask=np.zeros((2, N), bool))
    rest[0, 4], rest[:, 5] = np.ma.masked, np.ma.masked
    rest.data[0, 4] = 90
    skin.tare(rest, accept=True)
    assert skin.forces(np.full(N, 9.0)).tolist() == [6.0] * 5 + [9.0] + [6.0] * (N - 6)


class Tensor:
    """An array of another library that is not in the memory of the processor."""

    def __array__(self, *_, **__):
        raise RuntimeError("it is on another device")


def test_arrays_of_other_devices_are_flagged():
    """A controller that runs gets flags and no error, also for events."""
    skin = sole()
    frame = skin.update(Tensor(), 0.0)
    assert frame.flags == {"wrong_type"} and "this one is Tensor: it is on another device" in frame.problem
    assert skin.update_events([0], Tensor(), 0.0).flags == {"wrong_type"}
    assert skin.update_events(Tensor(), [1], 0.0).flags == {"wrong_type"}


def test_truth_values_are_no_readings():
    """A row of true and false is a mask or a comparison that was passed by mistake."""
    skin = sole()
    for wrong in (np.ones(N, bool), [True] * N, np.ma.array(np.ones(N, bool), mask=False)):
        assert skin.update(wrong, 0.0).flags == {"wrong_type"}
        with pytest.raises(InvalidReading, match="one row of real numbers; this one is bool"):
            skin.tare(wrong)


@pytest.mark.parametrize(
    ("times", "flags"),
    [
        ((0.0, 0.004, 0.008), ()),
        ((0.0, 0.004, 0.004), ("time_still",)),
        ((0.0, 0.004, 0.003), ("time_back",)),
        ((0.0, 0.004, 0.012), ("dropped",)),
        ((0.0, 0.004, 5.0), ("time_jump",)),
        ((0.0, 5.0), ("time_jump",)),
        ((0.0, 5.0, 5.004), ()),
        ((0.0, 5.0, 5.004, 5.012), ("dropped",)),
        ((0.0, 0.9), ()),
        ((0.0, 0.004, np.nan), ("time_not_finite",)),
        ((0.0, 0.004, np.inf), ("time_not_finite",)),
        ((np.inf,), ("time_not_finite",)),
        ((-np.inf, 0.0), ()),
        ((0.0, 3.0, 6.0), ()),
        ((0.0, 0.004, 5.0, 10.0, 15.0), ()),
        ((0.0, 0.004, 0.012, 0.016), ()),
    ],
)
def test_time_that_is_wrong_is_flagged(times, flags):
    """The time stands still, goes back, jumps, or is not a number, or a frame is missing.

    A slow clock gives no flag.
    """
    skin = sole()
    for time in times:
        frame = skin.update(pressed_everywhere(), time)
    assert frame.flags == set(flags)


@pytest.mark.parametrize("unusable", [np.full(N, np.nan), np.ones(3), "text"])
def test_frames_without_a_reading_are_no_missing_frames(unusable):
    """For 1.5 s at even times nothing can be read: no frame is dropped. Contacts from before are forgotten."""
    skin, flags, numbers = sole(), set(), set()
    for k in range(400):
        frame = skin.update(unusable if 100 <= k < 250 else pressed_everywhere(), 0.01 * k)
        flags |= frame.flags
        numbers |= {contact.number for contact in frame.contacts}
    assert not flags & {"dropped", "time_jump", "time_back"} and len(numbers) == 2
    assert {"blind", "wrong_length", "wrong_type"} & flags
    frame = skin.update(unusable, 4.02)
    assert "dropped" in frame.flags and "dropped" not in skin.update(pressed_everywhere(), 4.03).flags


def test_batch_forgets_contacts_after_a_blind_second():
    """An active taxel that would stay active is none after it, as in the loop."""
    rows, times = np.zeros((300, N)), 0.01 * np.arange(300)
    rows[:150, 3], rows[150:, 3], rows[20:150] = 0.3, 0.15, np.nan
    skin = sole()
    expected = [skin.update(row, time).active for row, time in zip(rows, times)]
    assert (sole().batch(rows, times).active == expected).all() and not expected[-1].any() and expected[0].any()


def test_usual_period_is_that_of_regular_frames():
    """After any number of regular frames a missing one is found; one long gap changes the period by a tenth at most."""
    clock, time = Clock(), 0.0
    for _ in range(100):
        assert clock.flags(time) == frozenset()
        clock.accept(time)
        time += 0.01
    assert clock.flags(time + 0.01) == {"dropped"}
    clock.accept(time + 0.4)
    assert clock.flags(time + 0.41) == frozenset() and clock.flags(time + 0.42) == {"dropped"}


anything = st.one_of(
    hnp.arrays(
        st.sampled_from(["u1", "u2", "i1", "i8", "u8", "f2", "f4", "f8", "?", "c8", "O", "U2", "M8[s]"]),
        st.one_of(st.just((N,)), hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=60)),
    ),
    st.none(),
    st.text(),
    st.lists(st.one_of(st.floats(), st.integers(-(2**70), 2**70), st.none(), st.text()), min_size=40, max_size=45),
    st.dictionaries(st.integers(), st.floats()),
)


@given(readings=st.lists(st.tuples(anything, st.floats()), min_size=1, max_size=3))
def test_no_reading_raises(readings):
    """Any reading at any time gives a frame with finite numbers, or without any, and with documented flags only."""
    skin = skin_of(sole_patch(), newtons=(0.5, -2.0, 3.0, 1e-3))
    for reading, time in readings:
        frame = skin.update(reading, time)
        assert frame.flags <= FLAGS
        assert np.isfinite(frame.forces).all() and frame.forces.shape == (N,) and (frame.forces >= 0).all()
        if frame.problem is not None:
            assert np.isnan(frame.wrench).all() and frame.reason and frame.cop is None and frame.zmp is None
            assert frame.flags & {"wrong_type", "wrong_length", "blind", "lost"}
        else:
            assert np.isfinite(frame.wrench).all()
            assert (frame.cop is None) == (frame.reason is not None)
        for polygon in (frame.polygon.outer, frame.polygon.nominal, frame.polygon.guaranteed):
            assert np.isfinite(polygon.corners).all()
        for contact in frame.contacts:
            assert np.isfinite(contact.position).all() and contact.force > 0


def test_polygons_of_a_frame_are_its_own():
    """For similar and for different consecutive frames, a new skin gives the same polygons in every bit.

    Frames that a controller keeps do not change.
    """
    skin, rng, reading = sole(), np.random.default_rng(1), pressed_everywhere()
    kept = []
    for k in range(30):
        if k % 10 == 0:
            reading = rng.choice([0.0, 5.0], N)
        else:
            some = rng.integers(0, N, rng.integers(0, 3))
            reading[some] = 5.0 - reading[some]
        ours, fresh = (which.update(reading, 0.001 * k).polygon for which in (skin, sole()))
        kept.append((ours, fresh))
    for ours, fresh in kept:
        for name in ("outer", "nominal", "guaranteed"):
            assert getattr(ours, name).corners.tolist() == getattr(fresh, name).corners.tolist()


@pytest.mark.nightly
def test_memory_does_not_grow():
    """Thousands of frames with other contacts leave no more memory allocated than a few."""
    skin, rng = sole(), np.random.default_rng(0)

    def run(frames, start):
        for k in range(frames):
            frame = skin.update(rng.choice([0.0, 5.0], N), 0.001 * (start + k))
            assert frame.polygon.outer is not None and frame.cop is not None or frame.reason

    run(300, 0)
    tracemalloc.start()
    run(50, 300)
    gc.collect()  # lists that Python keeps for later use are not ours
    before = tracemalloc.get_traced_memory()[0]
    run(3000, 350)
    gc.collect()
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert grown < 20_000


@pytest.mark.parametrize(("side", "most"), [(0.016308, 6909.7), (0.002, 103.92), (0.001, 100.0)])
def test_force_that_no_skin_can_bear_is_left_out(side, most):
    """The limit is that of the cell: 10 MPa on a hexagon of any size, and 100 N at least."""
    skin = skin_of(sole_patch(side=side))
    assert skin.areas[0] == pytest.approx(1.5 * 3**0.5 * side**2)
    for force, flags in ((0.99 * most, frozenset()), (1.01 * most, {"too_large"})):
        frame = skin.update(np.where(np.arange(N) == 7, force, 2.0), 0.0)
        assert frame.flags - {"time_still", "lost", "overload"} == flags and frame.known[7] == (not flags)


def test_range_of_a_response_states_what_the_skin_can_bear():
    """A response that was measured up to 9 kN has forces up to 9 kN."""
    response = Response((0.0, 1.0), (0.0, 9000.0))
    skin = counting_sole(response, switch_on=0.2)
    frame = skin.update(np.full(N, 8990.0), 0.0)
    assert frame.flags == {"overload"} and frame.known.all()


@pytest.mark.parametrize("response", [Response((0.0, 0.2)), ResponseTable((0.0, 100.0, 255.0), (30.0, 4.0, 0.0))])
def test_reading_far_below_rest_is_a_fault_without_noise_too(response):
    """A reading as far below rest as 98 N is above it: flagged without any knowledge of the noise, and for a second."""
    skin = counting_sole(response)
    sign = -1 if response.rest else 1
    for time, below, is_fault in ((0.0, 4, False), (0.1, 490, True), (0.2, 0, True), (1.0, 0, True), (1.2, 0, False)):
        reading = np.full(N, response.rest)
        reading[5] -= sign * below
        assert ("below_rest" in skin.update(reading, time).flags) == is_fault


def test_fault_that_shows_in_some_frames_stays_reported():
    """A byte around 127 that is read as signed is below rest in every other frame; the flag stays, and then goes."""
    skin = skin_of(sole_patch(), newtons=(0.0, 0.2))
    rng = np.random.default_rng(3)
    skin.tare(rng.integers(10, 15, (250, N)).astype(np.uint8), accept=True)
    for k in range(100):
        reading = rng.integers(10, 15, N).astype(np.uint8)
        reading[4] = 127 + (k % 5 == 0)
        frame = skin.update(reading.view(np.int8), 10 + 0.01 * k)
        assert "below_rest" in frame.flags
    flags = [skin.update(rng.integers(10, 15, N).astype(np.uint8), 11 + 0.01 * k).flags for k in range(120)]
    assert "below_rest" in flags[50] and "below_rest" not in flags[-1]


@pytest.mark.filterwarnings("error")
def test_readings_too_large_to_square_are_no_rest():
    """A response with a range accepts every finite reading; the variance of such a one overflows."""
    response = Response((0.0, 0.01), (0.0, 4095.0))
    skin = counting_sole(response)
    reading = np.full(N, 2.0)
    reading[3] = 1e200
    frames = [skin.update(reading + k % 2, 0.01 * k) for k in range(100)]
    assert frames[-1].flags >= {"noise_unknown"}


@pytest.mark.parametrize("stated", [None, 300.0])
def test_load_that_no_foot_bears_is_not_trusted(stated):
    """200 kPa on the area by default, or the load that the calibration states: readings 16 times too large show."""
    patch = replace(sole_patch(), max_load=stated)
    calibration = small_calibration(patches=(patch,), surfaces=(plane(),), response=Response((0.0, 0.2)))
    limit = stated or 2e5 * patch.taxels.areas.sum()
    assert stated or 5700 < limit < 5900
    for load, is_plausible in ((0.95 * limit, True), (1.05 * limit, False)):
        skin = Skin(calibration)
        skin.tare(np.maximum(np.rint(2 * np.random.default_rng(0).normal(size=(250, N))), 0))
        frame = skin.update(np.full(N, load / N / 0.2), 0.0)
        assert ("overload" not in frame.flags) == is_plausible == bool(len(frame.polygon.guaranteed.corners))


def test_two_threads_in_one_skin_are_named(monkeypatch):
    """The second one gets no values, and the frame of the first one is that of a skin alone."""
    alone, skin = (counting_sole(Response((0.0, 0.2))) for _ in range(2))
    rest, reading, others = np.zeros((250, N)), np.arange(N) % 7, []
    alone.tare(rest, accept=True)
    skin.tare(rest, accept=True)
    touched = skin._touched

    def while_another_thread_updates(*arguments):
        thread = threading.Thread(target=lambda: others.append(skin.update(reading + 1, 0.5)))
        thread.start()
        thread.join()
        return touched(*arguments)

    monkeypatch.setattr(skin, "_touched", while_another_thread_updates)
    first, (second,) = skin.update(reading, 1.0), others
    assert second.flags == {"concurrent"} and second.touched is None and "another thread" in second.problem
    expected = alone.update(reading, 1.0)
    assert first.flags == expected.flags and np.array_equal(first.wrench, expected.wrench)
    assert not skin.update(reading, 1.01).flags & {"concurrent", "time_back"}
