"""Readings and times that are not what they should be: every doubt is a flag, nothing raises, nothing is forgotten."""

import gc
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from skin_calib_addon.calibration import Response, ResponseTable, TaxelResponses
from skin_calib_addon.runtime import Skin
from tests.samples import plane, small_calibration
from tests.soles import skin_of, sole_patch

N = 42
FLAGS = {"wrong_type", "wrong_length", "not_finite", "too_large", "blind", "saturated", "stuck"}
FLAGS |= {"time_not_finite", "time_still", "time_back", "time_jump", "dropped"}


def sole(**options):
    """A sole of 42 hexagons whose readings are newtons."""
    return skin_of(sole_patch(), **options)


def resting(force=20.0):
    """Every taxel pressed."""
    return np.full(N, force)


@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf])
def test_taxels_without_a_number_are_not_without_contact(broken):
    """Some: flagged and left out. All: the skin is blind, which is not the same as touched by nothing."""
    skin = sole()
    some = resting()
    some[:10] = broken
    frame = skin.update(some, 0.0)
    assert frame.flags == {"not_finite"} and frame.touched and frame.known.sum() == 32
    blind = skin.update(resting(broken), 0.1)
    assert blind.flags == {"not_finite", "blind"} and blind.touched is None
    assert np.isnan(blind.wrench).all() and blind.reason == "no taxel has a valid reading"
    free = skin.update(np.zeros(N), 0.2)
    assert free.flags == frozenset() and free.touched is False and (free.wrench == 0).all()


def test_taxel_that_sends_nothing_once_is_remembered():
    """Hysteresis outlives a lost number: the taxel was on, and is on when it can be read again."""
    skin = sole()
    skin.update(resting(), 0.0)
    lost = resting(0.15)
    lost[3] = np.nan
    assert not skin.update(lost, 0.01).active[3]
    assert skin.update(resting(0.15), 0.02).active[3]


def test_force_that_nothing_bears_is_none():
    """1e30 N is a broken number, not a force; it does not reach the wrench."""
    frame = sole().update(np.where(np.arange(N) == 7, 1e30, 2.0), 0.0)
    assert frame.flags == {"too_large"} and not frame.known[7] and np.abs(frame.wrench).max() < 100


def test_saturated_taxel_is_counted_and_flagged():
    """Its force is the least it can be."""
    response = Response((0.0, 0.1), (0.0, 1000.0))
    skin = Skin(small_calibration(link="sole", patches=(sole_patch(),), surfaces=(plane(),), response=response))
    reading = np.zeros(N)
    reading[5] = 4000
    frame = skin.update(reading, 0.0)
    assert frame.flags == {"saturated"} and frame.saturated.tolist().index(True) == 5
    assert frame.contacts[0].force == 100.0


def test_masked_taxels_are_left_out_of_everything():
    """A dead taxel that screams makes no contact and no flag; unknown ids are refused; the mask can be taken off."""
    skin = sole()
    reading = np.zeros(N)
    reading[4] = np.nan
    reading[5] = 50.0
    skin.mask(["sole.4", "sole.5"])
    frame = skin.update(reading, 0.0)
    assert frame.flags == frozenset() and frame.touched is False and not frame.known[[4, 5]].any()
    with pytest.raises(KeyError, match="no taxel 'sole.99' on the skin of left_sole"):
        skin.mask(["sole.99"])
    assert not skin.update(reading, 0.1).known[5]
    skin.mask([])
    assert skin.update(reading, 0.2).active[5]


def test_reading_that_never_changes_is_stuck():
    """A pressed taxel whose last bit stands still for half a minute is in doubt; one at rest may."""
    skin = sole()
    moving = np.zeros(N)
    for k in range(32):
        moving[3], moving[9] = 5.0, 5.0 + 0.001 * (k % 2)
        frame = skin.update(moving, float(k))
        assert ("stuck" in frame.flags) == (k > 30) and frame.stuck.nonzero()[0].tolist() == [3] * (k > 30)
    moving[3] = 5.5
    assert "stuck" not in skin.update(moving, 33.0).flags


def test_baseline_makes_rest_rest():
    """Offsets of the sensors at rest are taken off, in readings, before the response; of frames the mean counts."""
    rng = np.random.default_rng(1)
    offset = rng.uniform(-3, 3, N)
    for response in (Response((0.0, 0.1, 0.002)), ResponseTable((0.0, 100.0, 255.0), (30.0, 4.0, 0.0))):
        skin = Skin(small_calibration(link="sole", patches=(sole_patch(),), surfaces=(plane(),), response=response))
        skin.tare(np.stack((response.rest + offset - 1, response.rest + offset + 1)))
        assert np.abs(skin.forces(response.rest + offset)).max() < 1e-9
        expected = TaxelResponses([response], np.zeros(N, int)).forces(np.full(N, 40.0))
        np.testing.assert_allclose(skin.forces(40.0 + offset), expected, rtol=1e-9)


def test_baseline_of_a_taxel_without_a_number_stays():
    """And a wrong one changes nothing at all."""
    skin = sole()
    skin.tare(np.full(N, 2.0))
    lost = np.full(N, 3.0)
    lost[0] = np.nan
    skin.tare(lost)
    assert skin.forces(np.full(N, 3.0)).tolist() == [1.0] + [0.0] * (N - 1)
    frame = skin.update(np.full(N + 1, 3.0)[:5], 0.0)
    assert frame.flags == {"wrong_length"}
    with pytest.raises(Exception, match="the reading has 5 channels"):
        skin.tare(np.zeros(5))
    assert skin.forces(np.full(N, 3.0))[0] == 1.0


@pytest.mark.parametrize(
    ("times", "flags"),
    [
        ((0.0, 0.004, 0.008), ()),
        ((0.0, 0.004, 0.004), ("time_still",)),
        ((0.0, 0.004, 0.003), ("time_back",)),
        ((0.0, 0.004, 0.012), ("dropped",)),
        ((0.0, 0.004, 5.0), ("time_jump",)),
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
    """Still, back, a jump, a lost frame, no number; and a slow clock is no doubt."""
    skin = sole()
    for time in times:
        frame = skin.update(resting(), time)
    assert frame.flags == set(flags)


@pytest.mark.parametrize(("time", "stays"), [(0.008, True), (0.004, True), (0.0, False), (7.0, False), (np.nan, True)])
def test_what_was_felt_long_ago_says_nothing_about_now(time, stays):
    """After a jump, or back in time, taxels need the upper force again, and contacts get new numbers."""
    skin = sole()
    skin.update(resting(), 0.001)
    first = skin.update(resting(), 0.004).contacts[0].number
    later = skin.update(resting(0.15), time)
    assert later.active.all() == stays
    if stays:
        assert later.contacts[0].number == first
    else:
        assert skin.update(resting(), time + 0.004).contacts[0].number != first


def test_refused_frame_leaves_the_skin_as_it_was():
    """Reading after reading, with and without broken ones in between: the good frames are the same."""
    rng = np.random.default_rng(3)
    good = rng.uniform(0, 0.4, (30, N))
    plain, bothered = sole(), sole()
    for k, reading in enumerate(good):
        time = 0.004 * k
        for broken in (None, np.zeros(3), np.full(N, np.nan), np.zeros((2, N)), ["x"] * N):
            assert bothered.update(broken, time).touched is None
        a, b = plain.update(reading, time), bothered.update(reading, time)
        assert a.flags == b.flags and (a.active == b.active).all()
        assert [c.number for c in a.contacts] == [c.number for c in b.contacts]


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


@given(readings=st.lists(st.tuples(anything, st.floats()), min_size=1, max_size=6))
def test_no_reading_raises(readings):
    """Whatever arrives at whatever time: a frame, with finite numbers or none at all, and flags that are documented."""
    skin = skin_of(sole_patch(), newtons=(0.5, -2.0, 3.0, 1e-3))
    for reading, time in readings:
        frame = skin.update(reading, time)
        assert frame.flags <= FLAGS
        assert np.isfinite(frame.forces).all() and frame.forces.shape == (N,) and (frame.forces >= 0).all()
        if frame.touched is None:
            assert np.isnan(frame.wrench).all() and frame.reason and frame.cop is None and frame.zmp is None
            assert frame.flags & {"wrong_type", "wrong_length", "blind"}
        else:
            assert np.isfinite(frame.wrench).all()
            assert (frame.cop is None) == (frame.reason is not None)
        for polygon in (frame.polygon.outer, frame.polygon.nominal, frame.polygon.guaranteed):
            assert np.isfinite(polygon.corners).all()
        for contact in frame.contacts:
            assert np.isfinite(contact.position).all() and contact.force > 0


def test_array_of_another_library_that_refuses_is_told():
    """As tensors that live elsewhere do: no exception, whatever theirs is."""

    class Tensor:
        def __array__(self, dtype=None, copy=None):
            raise RuntimeError("call detach() first")

    frame = sole().update(Tensor(), 0.0)
    assert frame.flags == {"wrong_type"} and "this one is Tensor: call detach() first" in frame.problem


def test_polygons_of_a_frame_are_its_own():
    """Over frames of which each is the last one but for a taxel or two, or like none: to the bit what a new skin says.

    And what a controller kept of an earlier frame is what it was.
    """
    skin, rng, reading = sole(), np.random.default_rng(1), resting()
    kept = []
    for k in range(200):
        if k % 20 == 0:
            reading = rng.choice([0.0, 5.0], N)
        else:
            some = rng.integers(0, N, rng.integers(0, 3))
            reading[some] = 5.0 - reading[some]
        ours, fresh = (which.update(reading, 0.001 * k).polygon for which in (skin, sole()))
        kept.append((ours, fresh))
    for ours, fresh in kept:
        for name in ("outer", "nominal", "guaranteed"):
            assert getattr(ours, name).corners.tolist() == getattr(fresh, name).corners.tolist()


def test_memory_does_not_grow():
    """Thousands of frames, every one with other contacts, leave no more behind than a few."""
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
