"""Whole numbers whose two bytes arrive in the wrong order are a fault; no other signal is taken for it."""

import numpy as np
import pytest

from skin_calib_addon.calibration import Response
from tests.examples import slow
from tests.soles import counting_sole

N = 42


def sole(bits, has_range=False, **options):
    """Return a sole whose converter has some bits."""
    top = 2.0**bits - 1
    return counting_sole(Response((0.0, 800 / top), (0.0, top) if has_range else None), **options)


def signal(rng, bits, noise, offset, load, frames, period):
    """Return counts (frames, N) of a foot that rocks at 1 Hz under a load [fraction of full scale], with noise."""
    time = period * np.arange(frames)[:, None]
    pressure = load * np.maximum(np.sin(2 * np.pi * time + np.linspace(0, 2, N)), 0)
    counts = offset + pressure * 2**bits + noise * rng.normal(size=(frames, N))
    return np.clip(np.rint(counts), 0, 2**bits - 1).astype(np.uint16)


def flagged_after(skin, readings, period, start=10.0):
    """Return the time from the first frame to the flag [s]; None without a flag."""
    for k, reading in enumerate(readings):
        frame = skin.update(reading, start + period * k)
        if "byte_order" in frame.flags:
            assert frame.polygon.guaranteed.kind == "empty"
            return period * k
    return None


CONVERTERS = [(12, 2.0), slow(12, 0.5), slow(16, 32.0), (16, 8.0)]
FRAMES = 60  # more than a second of the slowest; a fault is flagged within one
PERIODS = [slow(0.001), slow(0.004), 0.04]


@pytest.mark.parametrize(("bits", "noise"), CONVERTERS)
@pytest.mark.parametrize("offset", [0, 300])
@pytest.mark.parametrize("load", [0.0, 0.4])
@pytest.mark.parametrize("period", PERIODS)
def test_change_of_the_byte_order_is_flagged(bits, noise, offset, load, period):
    """A skin that rests in the correct order, and then sends the wrong one: flagged within a second, and no longer."""
    rng, count = np.random.default_rng(1), round(1 / period)
    skin = sole(bits)
    skin.tare(signal(rng, bits, noise, offset, 0.0, 250, 0.004), accept=True)
    live = signal(rng, bits, noise, offset, load, 2 * count, period)
    assert flagged_after(skin, live[:count], period) is None
    assert flagged_after(skin, live[count:].byteswap(), period, 11.0) is not None
    flags = [skin.update(reading, 12 + period * k).flags for k, reading in enumerate(live)]
    assert "byte_order" not in flags[-1]


@pytest.mark.parametrize(("bits", "noise"), CONVERTERS)
@pytest.mark.parametrize(("kind", "tared"), [(np.uint16, False), (np.int16, True), (float, True)])
def test_byte_order_is_wrong_from_the_start(bits, noise, kind, tared):
    """Even the rest is wrong. Under load, or with an offset of more than a byte, it is flagged within a second."""
    rng = np.random.default_rng(2)
    for offset, load in ((0, 0.4), (300, 0.0)):
        swapped = signal(rng, bits, noise, offset, load, 250, 0.004).byteswap()
        swapped = swapped.view(np.int16) if kind is np.int16 else swapped.astype(kind)
        skin = sole(bits)
        if tared:
            rest = signal(rng, bits, noise, offset, 0.0, 250, 0.004).byteswap()
            skin.tare(rest.view(np.int16) if kind is np.int16 else rest, accept=True)
        assert flagged_after(skin, swapped, 0.004) is not None


def test_rest_near_zero_is_flagged_with_a_range():
    """At rest near zero all readings are multiples of 256, as those of eight bits in the upper byte.

    A range of twelve bits is too small for those. Without it the fault shows under load only.
    """
    swapped = signal(np.random.default_rng(3), 12, 2.0, 0, 0.0, 250, 0.004).byteswap()
    assert flagged_after(sole(12, has_range=True), swapped, 0.004) is not None
    assert flagged_after(sole(12), swapped, 0.004) is None


@pytest.mark.parametrize("shift", [0, slow(4), 7])
@pytest.mark.parametrize("period", PERIODS)
def test_correct_order_is_not_flagged(shift, period):
    """Readings of 8 to 16 bits at either end of the word, at rest, under load and with contacts that jump.

    Nine bits in the upper end are not tried with jumps: in the wrong order, they would have one bit in the upper byte.
    """
    rng = np.random.default_rng(4)
    bits = 16 - shift
    for load in (0.0, 0.4):
        counts = signal(rng, bits, 2.0, 3, load, FRAMES, period)
        for frames in (counts, counts << shift, counts.astype(np.int16) - 3):
            assert flagged_after(sole(16), frames, period) is None
    if shift == 7:
        return
    jumps = np.where(rng.random((FRAMES, N)) < 0.5, 0, rng.integers(0, 2**bits, (FRAMES, N)))
    for frames in (jumps, jumps << shift, np.where(jumps > 0, 256, 0), rng.normal(size=(FRAMES, N))):
        assert flagged_after(sole(16), frames, period) is None
