"""Results of many readings at once equal those of one reading after another."""

import copy

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.calibration import Response, ResponseTable, TaxelArray
from skin_calib_addon.common.errors import InvalidReading
from skin_calib_addon.runtime import Skin
from skin_calib_addon.runtime import batch as batch_module
from skin_calib_addon.runtime.touched import states, switched
from tests.examples import slow
from tests.samples import cylinder, small_calibration
from tests.soles import counting_sole, skin_of, sole_patch

ROWS = 300


def two_feet(**options):
    """Return a skin of two patches, one of them higher than the other."""
    left = sole_patch((5, 6, 5), first_channel=3)
    right = sole_patch((4, 3, 4), name="heel", height=0.001, first_channel=25)
    return skin_of(left, right, newtons=(0.0, 0.2, 1e-4), **options)


def limb():
    """Return a skin without a ground: boards and a sheet around a cylinder, with responses of several kinds."""
    table = ResponseTable((0.0, 40.0, 4095.0), (0.0, 5.0, 400.0))
    calibration = small_calibration(surfaces=(cylinder(),), response=Response((0.0, 0.1)), responses=(table,))
    patches = []
    for patch in calibration.patches:
        taxels = {name: getattr(patch.taxels, name) for name in TaxelArray.__dataclass_fields__}
        taxels["responses"] = np.arange(len(patch.taxels.ids)) % 2 - 1
        patches.append(type(patch)(*(getattr(patch, name) for name in ("name", "kind", "surface", "shape", "pitch")),
                                   TaxelArray(**taxels)))  # fmt: skip
    return Skin(small_calibration(patches=tuple(patches), surfaces=(cylinder(),), responses=(table,)), 1.0, 0.5)


def with_noise(**options):
    """Return a sole that has learned its noise."""
    skin = counting_sole(**options)
    skin.tare(np.clip(np.rint(np.random.default_rng(0).normal(1, 2, (250, 42))), 0, 4095))
    return skin


def readings_for(skin, seed=1):
    """Return counts (ROWS, channels) of a load that moves, grows and vanishes, with noise and broken readings."""
    rng = np.random.default_rng(seed)
    counts = np.zeros((ROWS, skin.reading_length))
    along = skin.positions @ rng.normal(size=3)
    order = (along - along.min()) / np.ptp(along)
    time = np.arange(ROWS)[:, None]
    counts[:, skin.channels] = 60 * np.sin(time / 15) * np.maximum(1 - np.abs(order - np.abs(np.sin(time / 40))) * 3, 0)
    counts[:, skin.channels] += np.where((time > 100) & (time < 130), 40.0, 0.0)  # all taxels
    counts[:, skin.channels] += np.where((time > 150) & (time < 170), 4.0, 0.0)  # a load below the noise of a taxel
    counts = np.clip(np.rint(counts + rng.normal(0, 2, counts.shape)), 0, 4095)
    counts[rng.random(counts.shape) < 0.01] = np.nan
    counts[rng.random(counts.shape) < 0.002] = np.inf
    counts[[0, 57, 200, 201]] = np.nan
    counts[260, skin.channels[0]] = 1e200
    return counts


def assert_equals_loop(skin, readings, times):
    """Compare a batch with the loop of updates; without times with an update of a new skin for each row."""
    skin._rest = None  # a loop learns the noise by itself; a batch does not
    batch = skin.batch(readings, times)
    new, states = copy.deepcopy(skin), 0
    for t, reading in enumerate(readings):
        if times is None:
            new = copy.deepcopy(skin) if t == 0 else new
            new._active = np.zeros(len(new.ids), bool)
            new._lost.forget()
            new._readings.drift = copy.deepcopy(skin._readings.drift)
        frame = new.update(reading, float(t) if times is None else times[t])
        is_known = frame.problem is None
        assert_array_equal(batch.forces[t], frame.forces)
        assert_array_equal(batch.known[t], frame.known)
        assert_array_equal(batch.active[t], frame.active)
        assert batch.contact_counts[t] == (len(frame.contacts) if frame.known.any() else -1)
        assert batch.stands[t] == frame.stands
        assert_allclose(batch.load[t], frame.load if is_known else np.nan, rtol=1e-12, atol=1e-12)
        assert_allclose(batch.wrench[t], frame.wrench, rtol=1e-12, atol=1e-12)
        for mine, its in ((batch.cop[t], frame.cop), (batch.zmp[t], frame.zmp)):
            assert_allclose(mine, [np.nan] * 2 if its is None else its, rtol=1e-12, atol=1e-12)
        states += frame.stands
    return batch, states


SKINS = {
    "thresholds": two_feet,
    "default thresholds": lambda: two_feet(switch_on=None, switch_off=None),
    "hysteresis": lambda: two_feet(switch_on=6.0, switch_off=1.0),
    "in cell": lambda: two_feet(in_cell=True),
    "noise": with_noise,
    "noise in cell": lambda: with_noise(in_cell=True),
    "noise and thresholds": lambda: with_noise(switch_on=3.0),
    "limb": limb,
}


@pytest.mark.parametrize("block", [slow(2**20), 1000])
@pytest.mark.parametrize(
    ("name", "has_times"), [*((name, True) for name in SKINS), ("thresholds", False), ("noise in cell", False)]
)
def test_batch_equals_the_loop(monkeypatch, name, has_times, block):
    """Every number equals that of the loop to 1e-12, with NaN, masked taxels, hysteresis and times that jump."""
    monkeypatch.setattr(batch_module, "BLOCK_NUMBERS", block)
    skin = SKINS[name]()
    skin.mask(skin.ids[4:6])
    times = None
    if has_times:
        times = 0.004 * np.arange(ROWS)
        times[40:] += 10  # a jump
        times[90:] -= 3  # back
        times[120] = np.nan
        times[200:] -= 2  # back, in a row that is unknown
    batch, standing = assert_equals_loop(skin, readings_for(skin), times)
    assert batch.contact_counts.max() > 1 and (batch.contact_counts == -1).sum() == 4
    assert 40 < standing < 290


def test_batch_does_not_change_the_skin():
    """The next frame is the same with and without a batch before it."""
    skin = with_noise()
    readings = readings_for(skin)
    frames = []
    for uses_batch in (False, True):
        skin = with_noise()
        skin.update(readings[20], 1.0)
        if uses_batch:
            skin.batch(readings, 0.01 * np.arange(ROWS))
        frame = skin.update(readings[21], 1.01)
        frames.append((frame.flags, frame.active.tolist(), [c.number for c in frame.contacts]))
    assert frames[0] == frames[1]


def test_hysteresis_needs_times():
    """A force between the thresholds stays a contact in a log, and is none where rows are independent."""
    skin = skin_of(sole_patch(), switch_on=2.0, switch_off=1.0)
    readings = np.zeros((4, 42))
    readings[:, 5] = 3.0, 1.5, 0.5, 1.5
    assert_array_equal(skin.batch(readings, np.arange(4.0)).contact_counts, (1, 1, 0, 0))
    assert_array_equal(skin.batch(readings).contact_counts, (1, 0, 0, 0))


def test_states_of_many_frames_are_those_of_one_after_another():
    """Any taxels that switch on, stay or switch off, from any state before."""
    rng = np.random.default_rng(2)
    for count in (1, 2, 3, 16, 37):
        on, stays = rng.random((count, 50)) < 0.2, rng.random((count, 50)) < 0.7
        state = before = rng.random(50) < 0.5
        expected = [state := switched(*row, state) for row in zip(on, stays)]
        assert_array_equal(states(on, stays, before), expected)


def test_types_and_sizes():
    """Whole numbers of 8 bits, no rows, one row, and extra channels are fine; other inputs are refused."""
    skin = two_feet()
    length = skin.reading_length
    full = skin.batch(np.full((2, length + 5), 255, np.uint8))
    assert_allclose(full.forces, 0.2 * 255 + 1e-4 * 255**2)
    assert skin.batch(np.zeros((0, length)), []).wrench.shape == (0, 6)
    with pytest.raises(InvalidReading, match="channels"):
        skin.batch(np.zeros((3, length - 1)))
    with pytest.raises(InvalidReading, match="a batch must be rows of real numbers"):
        skin.batch(np.zeros(length))
    with pytest.raises(ValueError, match="one time for each"):
        skin.batch(np.zeros((3, length)), [0.0, 1.0])


def test_skin_without_taxels():
    """It has no contacts, no wrench and no noise, whatever the data type of its readings."""
    skin = Skin(small_calibration(patches=(), surfaces=()))
    for dtype in (np.int64, float):
        skin.tare(np.zeros((30, 0), dtype))
    frames = [skin.update(np.zeros(0), 0.02 * k) for k in range(40)]
    assert skin.noise is None and frames[-1].contacts == () and frames[-1].flags == {"noise_unknown"}
    batch = skin.batch(np.zeros((3, 0)))
    assert batch.forces.shape == (3, 0) and (batch.contact_counts == 0).all() and (batch.wrench == 0).all()


@pytest.mark.parametrize("make", [two_feet, with_noise])
def test_masked_numbers_of_a_batch_are_unknown(make):
    """A number under the mask is as NaN, whatever is there; rows that are masked completely are unknown."""
    skin, rng = make(), np.random.default_rng(5)
    counts = rng.integers(0, 60, (80, skin.reading_length)).astype(np.uint16)
    mask = rng.random(counts.shape) < 0.2
    mask[[0, 40]] = True
    hidden = np.where(mask, 60000, counts).astype(np.uint16)
    times = np.arange(80.0)
    ours = skin.batch(np.ma.array(hidden, mask=mask), times)
    theirs = skin.batch(np.where(mask, np.nan, counts), times)
    for name in ("forces", "known", "active", "contact_counts", "wrench", "load", "stands", "cop", "zmp"):
        assert_array_equal(getattr(ours, name), getattr(theirs, name))
    assert_array_equal(ours.known, ~mask[:, skin.channels])
    assert (ours.contact_counts[[0, 40]] == -1).all()
    with pytest.raises(InvalidReading, match="real numbers"):
        skin.batch(mask, times)
