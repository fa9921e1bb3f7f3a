"""A tare needs readings at rest: contacts during it are refused, noise of any kind is not."""

import numpy as np
import pytest

from skin_calib_addon.calibration import Response
from skin_calib_addon.common.errors import InvalidReading
from tests.soles import counting_sole, skin_of, sole_patch

N = 42


def sole(**options):
    """Return a sole of 42 hexagons whose readings are newtons."""
    return skin_of(sole_patch(), **options)


def filtered(rng, shape, correlation, times=1):
    """Return noise with standard deviation 1 after a filter of first order, applied ``times`` times."""
    rows = rng.normal(size=(shape[0] + 200, shape[1]))
    for _ in range(times):
        out, last = np.empty_like(rows), np.zeros(shape[1])
        for t, row in enumerate(rows):
            out[t] = last = correlation * last + row
        rows = out / out[100:].std()
    return rows[200:]


NOISE = {
    "white": lambda rng, shape: rng.normal(size=shape),
    "rounded": lambda rng, shape: 3 * np.rint(0.3 * rng.normal(size=shape)),
    "clipped": lambda rng, shape: np.maximum(np.rint(rng.normal(size=shape)), 0),
    "correlated": lambda rng, shape: filtered(rng, shape, 0.9),
    "smooth": lambda rng, shape: filtered(rng, shape, 0.9, times=2),
    "spikes": lambda rng, shape: rng.normal(size=shape) * (1 + 20 * (rng.random(shape) < 0.005)),
    "common": lambda rng, shape: rng.normal(size=shape) + 3 * rng.normal(size=(shape[0], 1)),
    "hum": lambda rng, shape: rng.normal(size=shape) + 4 * np.sin(0.4 * np.pi * np.arange(shape[0]))[:, None],
    "drift": lambda rng, shape: rng.normal(size=shape) + 2 * np.linspace(0, 1, shape[0])[:, None],
}
TIME = np.linspace(0, 1, 250)
PRESSES = {
    "step": np.sin(np.pi * TIME),
    "ramp": TIME,
    "onset": TIME > 0.4,
    "press": (TIME > 0.3) & (TIME < 0.6),
    "tap": (TIME > 0.3) & (TIME < 0.35),
    "taps": np.sin(6 * np.pi * TIME) > 0,
    "three steps": np.abs(np.sin(3 * np.pi * TIME)),
}


@pytest.mark.parametrize("kind", NOISE)
def test_noise_of_any_kind_is_rest(kind):
    """The noise is far above the force that counts as a contact without known noise; offsets differ."""
    rng = np.random.default_rng(4)
    for frames in (8, 20, 250):
        for _ in range(5):
            sole().tare(rng.uniform(-20, 20, N) + 2 * NOISE[kind](rng, (frames, N)), accept=True)


@pytest.mark.parametrize("kind", PRESSES)
@pytest.mark.parametrize("count", [1, 12, N])
@pytest.mark.parametrize("noise", [0.02, 1.0])
def test_contact_during_a_tare_is_refused(kind, count, noise):
    """A finger or a foot presses during a part of it; the baseline stays that of before, and one taxel is named."""
    rng = np.random.default_rng(4)
    skin, forces = sole(), 40 * rng.uniform(0.8, 1.2, N) * (np.arange(N) < count)
    rows = 5 + noise * rng.normal(size=(250, N)) + PRESSES[kind][:, None] * forces
    with pytest.raises(
        InvalidReading, match=r"the 250 readings for a tare are not at rest: the force changes by \d+ N on sole"
    ):
        skin.tare(rows)
    assert skin.noise is None and skin.forces(np.full(N, 5.0)).sum() == pytest.approx(5 * N)
    skin.mask(skin.ids[:count])
    if count < N:
        skin.tare(rows, accept=True)  # what presses on defective taxels does not count


def test_slow_frames_of_a_walk_are_refused():
    """A step takes 20 frames, and the load moves over the foot: there is no noise to compare with."""
    at = np.linspace(0, 1, N)
    for frames in (10, 20, 60):
        phase = np.arange(frames)[:, None] / 30 % 1
        load = np.maximum(np.sin(1.5 * np.pi * phase), 0) * np.exp(-(((at - phase * 1.5) / 0.3) ** 2))
        with pytest.raises(InvalidReading, match="not at rest"):
            sole().tare(30 * load)


def test_silent_sensors_show_a_contact():
    """Readings that are exactly zero without contact, and a constant force for a part of the time."""
    for count in (1, N):
        rows = np.zeros((50, N), int)
        rows[20:, :count] = 9
        with pytest.raises(InvalidReading, match="changes by 9 N"):
            sole().tare(rows)
    sole().tare(rows[20:], accept=True)


def test_taxels_that_send_in_turn_are_at_rest():
    """Each taxel changes in every tenth frame."""
    rng = np.random.default_rng(4)
    rows = np.stack([np.repeat(rng.normal(size=31), 10)[k % 10 :][:300] for k in range(N)], axis=1)
    sole().tare(rows)


def test_missing_numbers_do_not_hide_a_contact():
    """A taxel without a number in some frames, or in all, is at rest."""
    rng = np.random.default_rng(4)
    rows = rng.normal(size=(60, N))
    rows[10:20, 3], rows[:, 4] = np.nan, np.nan
    sole().tare(rows)
    rows[30:50, 3] += 60
    with pytest.raises(InvalidReading, match="changes by 6. N on sole.3. Use a second"):
        sole().tare(rows)


def test_tare_under_a_load_is_refused_unless_it_is_accepted():
    """A standing foot, an even load that no taxel shows, and a sensor with offsets, which only its user knows."""
    rng = np.random.default_rng(5)
    noise = rng.normal(size=(250, N)) * 0.4
    for forces, words in (
        (np.linspace(5, 35, N), "neighbours are alike, as under a contact"),
        (np.full(N, 1.0), "those of 42"),
        (np.full(N, 0.5), "those of 21"),
        (np.where(np.arange(N) == 7, 3.0, 0.0), "3 N on sole.7, and the means of 1 taxel"),
    ):
        skin = sole(switch_on=None, switch_off=None)
        with pytest.raises(InvalidReading, match=words):
            skin.tare(noise + forces)
        assert skin.noise is None
        tare = skin.tare(noise + forces, accept=True)
        assert tare.noise is skin.noise and tare.frames == 250 and words in tare.warnings[0]
        assert tare.forces == pytest.approx(forces, abs=0.15) and not skin.update(noise[0] + forces, 0.0).touched
    assert sole().tare(noise).warnings == ()


def test_readings_far_below_rest_are_refused():
    """Those that never change, as of a simulation, and those with noise."""
    noise = np.random.default_rng(5).normal(size=(250, N))
    for rows, words in ((0 * noise, "they are as far below rest as 84 N are above it"), (0.4 * noise, "42 taxels are")):
        with pytest.raises(InvalidReading, match=words):
            sole().tare(rows - 2.0)


def test_even_load_at_the_start_is_not_learned():
    """No taxel shows it, but the sum of all does."""
    rng = np.random.default_rng(5)
    for newtons, learns in ((0.0, True), (0.5, False), (1.0, False)):
        skin = sole(switch_on=None, switch_off=None)
        for k in range(300):
            frame = skin.update(newtons + 0.4 * rng.normal(size=N), 0.004 * k)
        assert (skin.noise is not None) == learns and ("noise_unknown" in frame.flags) != learns


COUNTS = Response((0.0, 0.2), (0.0, 4095.0))


@pytest.mark.parametrize(
    "response, scale, kind, words",
    [
        (COUNTS, 1, np.uint16, None),
        (COUNTS, 1, np.uint8, "up to 255, the response needs 4095"),
        (COUNTS, 16, np.uint16, "multiples of 16"),
        (COUNTS, 16, float, "multiples of 16"),
        (Response((0.0, 0.2 / 16), (0.0, 65520.0)), 16, np.uint16, None),
        (COUNTS, 0.2, float, "have fractions, the response is for whole numbers up to 4095"),
        (Response((0.0, 1.0)), 0.2, float, None),
    ],
)
def test_readings_in_another_unit_are_refused(response, scale, kind, words):
    """Eight bits for twelve, numbers at the left of their word, newtons for counts: each would give a wrong force."""
    counts = np.maximum(np.rint(2 * np.random.default_rng(6).normal(size=(250, N))), 0)
    skin, rows = counting_sole(response), (counts * scale).astype(kind)
    if words is None:
        assert skin.tare(rows).warnings == ()
        return
    with pytest.raises(InvalidReading, match=words):
        skin.tare(rows)
    for k, row in enumerate(rows):
        skin.update(row, 0.004 * k)
    assert skin.noise is None
