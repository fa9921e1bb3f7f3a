"""The baseline of free taxels follows a drift; loads are not taken for one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.calibration import Response
from skin_calib_addon.runtime.noise import TRACKING_TIME
from tests.soles import counting_sole, sole_patch

N = 42
NEWTONS = 0.2  # of a count
PERIOD = 0.04  # [s]
REST = 50.0  # [counts]
SIGMA = NEWTONS * np.sqrt(4 + 1 / 12)  # [N]


def read(rng, newtons):
    """Return readings (frames, n) of forces with two counts of noise."""
    return np.clip(np.rint(REST + newtons / NEWTONS + 2 * rng.normal(size=newtons.shape)), 0, 4095).astype(int)


def rested(rng, **options):
    """Return a sole that has learned its noise."""
    skin = counting_sole(**options)
    skin.tare(read(rng, np.zeros((250, N))), accept=True)
    return skin


def frames_of(skin, rng, newtons, start=10.0, period=PERIOD):
    """Return the frames of forces (frames, n)."""
    return [skin.update(reading, start + period * k) for k, reading in enumerate(read(rng, newtons))]


def seconds(duration):
    """Return the times of frames (frames, 1)."""
    return np.arange(0, duration, PERIOD)[:, None]


@pytest.mark.parametrize("sign", [1, -1])
def test_baseline_follows_a_slow_drift_of_free_taxels(sign):
    """It is behind by rate times time constant; after .5 N of it, the free foot does not stand."""
    rng, rate = np.random.default_rng(0), 0.4 / 60
    skin = rested(rng)
    drift = sign * rate * seconds(75) * np.linspace(0.5, 1.5, N) + np.zeros(N)
    frames = frames_of(skin, rng, drift)
    assert np.mean([f.stands for f in frames]) < 2e-3
    assert all("drift" not in f.flags and "below_rest" not in f.flags for f in frames)
    behind = drift[-1] - skin.drift * NEWTONS
    assert_allclose(behind.mean(), sign * rate * TRACKING_TIME, atol=0.02)
    assert_allclose(behind.std(), rate * TRACKING_TIME * np.linspace(0.5, 1.5, N).std(), atol=0.03)


def test_option_leaves_the_baseline():
    """Then the drift is reported only."""
    rng = np.random.default_rng(0)
    skin = rested(rng, follow_drift=False)
    frames = frames_of(skin, rng, 0.4 / 60 * seconds(60) + np.zeros(N))
    assert "drift" in frames[-1].flags and not skin.drift.any()


def test_foot_that_walks_follows_the_drift_as_fast():
    """Free in a third of the time, its baseline is behind by the same."""
    rng, rate = np.random.default_rng(1), 0.4 / 60
    skin = rested(rng)
    time = seconds(60)
    frames = frames_of(skin, rng, rate * time + np.where(time % 1.5 < 1.0, 10.0, 0.0) + np.zeros(N))
    assert_allclose(rate * 60 - skin.drift.mean() * NEWTONS, rate * TRACKING_TIME, atol=0.03)
    air = [f.stands for f, now in zip(frames, time) if now % 1.5 > 1.1]
    assert np.mean(air) < 5e-3


@pytest.mark.parametrize("taxels", [1, N])
def test_load_that_grows_twice_as_fast_as_the_limit_is_no_drift(taxels):
    """The baseline takes at most the part that the analytic solution of the filter gives: 2 ln 2 - 1 of the limit."""
    rng = np.random.default_rng(2)
    skin = rested(rng)
    one, limit = skin.noise.rate_limits.max(), skin.noise.load_rate_limit
    rates = np.where(np.arange(N) < taxels, 2 * one if taxels == 1 else 2 * limit / N, 0.0)
    time = seconds(60)
    frame = frames_of(skin, rng, rates * time)[-1]
    assert frame.stands and (frame.sets.sure[0] or taxels > 1)
    lost = skin.drift.sum() * NEWTONS
    assert -0.5 < lost < (2 * np.log(2) - 1) * TRACKING_TIME * (one if taxels == 1 else limit) + 4 * SIGMA


def test_load_that_grows_at_a_tenth_of_the_limit_counts_as_drift():
    """That is what the limit states: nothing distinguishes it from a drift."""
    rng = np.random.default_rng(3)
    skin = rested(rng)
    frames = frames_of(skin, rng, 0.1 * skin.noise.load_rate_limit / N * seconds(60) + np.zeros(N))
    assert np.mean([f.stands for f in frames]) < 5e-3
    assert skin.drift.sum() * NEWTONS > 0.7 * 6 * skin.noise.load_rate_limit


def test_constant_load_stays():
    """A load at the limit of the sum, and a taxel at its detection limit, are there three time constants later."""
    rng = np.random.default_rng(4)
    even, one = rested(rng), rested(rng)
    frames = frames_of(even, rng, np.full((750, N), even.noise.load_limit / N))
    assert np.mean([f.stands for f in frames]) > 0.998
    assert_allclose(np.mean([f.load for f in frames[-250:]]), np.mean([f.load for f in frames[:250]]), atol=1.0)
    frames_of(one, rng, np.where(np.arange(N) == 5, one.noise.detection_limits.max(), np.zeros((750, N))))
    assert abs(one.drift[5]) * NEWTONS < 0.5 * SIGMA


def test_light_load_at_the_start_is_unlearned():
    """A skin that learned a light even load as rest is right again some time constants after the foot is lifted."""
    rng = np.random.default_rng(5)
    skin = rested(rng)
    skin.tare(read(rng, np.full((250, N), 1.0)), accept=True)
    frames = frames_of(skin, rng, np.zeros((round(5 * TRACKING_TIME / PERIOD), N)))
    assert "drift" in frames[200].flags and "drift" not in frames[-1].flags
    assert_allclose(skin.drift.mean() * NEWTONS, -1.0, atol=0.05)


def test_tare_with_a_few_frames_moves_the_baseline_of_the_noise():
    """After a drift of 3 standard deviations the foot in the air does not stand, and a load is right."""
    rng = np.random.default_rng(11)
    skin = rested(rng)
    sigma = skin.noise.sigma
    drift = np.full(N, 1.2)
    assert frames_of(skin, rng, drift + np.zeros((1, N)))[-1].stands
    skin.tare(read(rng, drift + np.zeros((10, N))), accept=True)
    assert skin.noise.sigma is sigma and not skin.drift.any()
    before = skin.noise.mean
    skin.tare(np.where(np.arange(N) == 4, np.nan, read(rng, drift + np.zeros((10, N)))), accept=True)
    assert skin.noise.mean[4] == before[4] and skin.noise.mean[5] != before[5]
    assert not any(f.stands for f in frames_of(skin, rng, drift + np.zeros((100, N)), 20.0))
    loads = [f.load for f in frames_of(skin, rng, drift + np.full((100, N), 10.0), 30.0)]
    assert_allclose(np.mean(loads), 420, rtol=0.02)


def test_broken_taxel_does_not_keep_the_others():
    """A masked taxel at full scale, and one that sends NaN, are left out."""
    rng = np.random.default_rng(6)
    skin = rested(rng)
    skin.mask([skin.ids[3]])
    readings = read(rng, 0.3 / 60 * seconds(30) + np.zeros(N)).astype(float)
    readings[:, 3], readings[::2, 7] = 4095, np.nan
    for k, reading in enumerate(readings):
        skin.update(reading, 10 + PERIOD * k)
    assert skin.drift[3] == skin.drift[7] == 0
    others = np.delete(skin.drift, [3, 7]) * NEWTONS
    assert_allclose(others.mean(), 0.3 / 60 * (30 - TRACKING_TIME), atol=0.02)


def test_neighbours_of_a_taxel_that_is_possibly_touched_are_not_free():
    """A weak contact of three standard deviations that spreads over its neighbours, with half of one each, stays."""
    rng = np.random.default_rng(12)
    skin = rested(rng)
    near = skin.geometry.neighbours[:, 20]
    forces = np.zeros((round(2 * TRACKING_TIME / PERIOD), N))
    forces[:, 20], forces[:, near] = 3 * SIGMA, 0.5 * SIGMA
    frames_of(skin, rng, forces)
    assert len(near) == 6 and np.abs(skin.drift[near]).mean() * NEWTONS < 0.1 * SIGMA


def test_frozen_bus_teaches_nothing():
    """The same readings again and again are no rest."""
    rng = np.random.default_rng(7)
    skin = rested(rng)
    frame = read(rng, np.zeros((1, N)))[0]
    for k in range(500):
        skin.update(frame, 10 + PERIOD * k)
    assert not skin.drift.any()


def with_creep(forces, fraction, time):
    """Return the forces (frames, n) that a sensor reads: exact for forces that are constant in each period."""
    late, felt = np.zeros(N), []
    for force in forces:
        felt.append(force + fraction * late)
        late = force + np.exp(-PERIOD / time) * (late - force)
    return np.array(felt)


def walking(duration):
    """Return forces of a foot that stands for one second, with its rear half, and is in the air for half of one."""
    time = seconds(duration)
    rear = sole_patch().taxels.positions_link[:, 0] < 0
    return np.where((time % 1.5 < 1.0) & rear, 15.0, 0.0)


@pytest.mark.parametrize("fraction", [0.08, 0.4])
def test_known_creep_is_taken_off(fraction):
    """The foot in the air does not stand, and loads are right; otherwise it stands on its creep."""
    rng, forces = np.random.default_rng(9), walking(15)
    air, loads = forces.sum(axis=1) == 0, forces.sum(axis=1)
    felt = with_creep(forces, fraction, 2.0)
    frames = frames_of(rested(rng, creep=(fraction, 2.0)), rng, felt)
    assert np.mean([f.stands for f, free in zip(frames, air) if free]) < 0.01
    assert_allclose(np.mean([f.load for f in frames[-300:]]), loads[-300:].mean(), rtol=0.02)
    unknown = frames_of(rested(rng), rng, felt)
    assert np.mean([f.stands for f, free in zip(unknown, air) if free]) > 0.8


def test_creep_of_a_falling_response_is_that_of_a_rising_one():
    """The readings are mirrored, the forces are equal."""
    rng = np.random.default_rng(10)
    felt = with_creep(walking(6), 0.3, 2.0)
    rest, readings = read(rng, np.zeros((250, N))), read(rng, felt)
    loads = []
    for sign in (1, -1):
        response = (
            Response((0.0, NEWTONS), (0.0, 4095.0)) if sign > 0 else Response((4095 * NEWTONS, -NEWTONS), (0.0, 4095.0))
        )
        skin = counting_sole(response, creep=(0.3, 2.0))
        skin.tare(rest if sign > 0 else 4095 - rest, accept=True)
        rows = readings if sign > 0 else 4095 - readings
        loads.append([skin.update(row, PERIOD * k).load for k, row in enumerate(rows)])
    assert_allclose(loads[0], loads[1], atol=1e-6)


@pytest.mark.parametrize("wrong", [(-0.1, 2.0), (0.1, 0.0), (np.nan, 2.0), (0.1, np.inf)])
def test_creep_must_be_positive(wrong):
    """Other constants are refused."""
    with pytest.raises(ValueError, match="creep .* must be a fraction of at least 0 and a time above 0 s"):
        rested(np.random.default_rng(0), creep=wrong)


@pytest.mark.parametrize(("whole", "creep"), [(True, None), (False, (0.3, 2.0))])
def test_batch_follows_drift_and_creep_as_the_loop(whole, creep):
    """Also with steps, jumps of the time and broken readings, and after updates of the skin."""
    rng = np.random.default_rng(8)
    skin, time = rested(rng, creep=creep), np.arange(0, 12, 0.02)[:, None]
    forces = 0.02 * time * np.linspace(0, 1, N) + np.where((time % 1.5 < 1.0) & (time > 6), 10.0, 0.0)
    readings = read(rng, forces)
    if not whole:
        readings = readings + np.where(rng.random(readings.shape) < 1e-3, np.nan, 0.0)
        readings[100] = np.nan
    for k in range(25):
        skin.update(readings[0], 5 + 0.1 * k)
    times = 10 + time[:, 0]
    times[300:] += 5
    times[400:] -= 2
    times[500] = np.nan
    batch = skin.batch(readings, times)
    skin._readings.drift.drop_block()
    skin._active = np.zeros(N, bool)
    offsets = set()
    for k, reading in enumerate(readings):
        frame = skin.update(reading, times[k])
        offsets.add(skin.drift.tobytes())
        assert_allclose(batch.forces[k], frame.forces, rtol=1e-12, atol=1e-12)
        assert_array_equal(batch.active[k], frame.active)
        assert batch.stands[k] == frame.stands
        if frame.problem is None:
            assert_allclose(batch.load[k], frame.load, rtol=1e-12, atol=1e-12)
    assert len(offsets) > 20


REAR = sole_patch().taxels.positions_link[:, 0] < 0
STANCES = {"in the air": np.zeros(N), "on its rear half": np.where(REAR, 40.0, 0.0)}


def ones(period, duration):
    """Return ones (frames, n) for a duration and a period [s]."""
    return np.ones((round(duration / period), N))


@pytest.mark.parametrize("period", [0.001, 0.004, 0.04])
@pytest.mark.parametrize(("load", "duration", "grows"), [(15.0, 1.0, False), (10.0, 3.0, False), (15.0, 3.0, True)])
def test_light_load_at_rest_is_no_drift_of_the_stance_after_it(load, duration, grows, period):
    """Also a load that grows. While it is there nothing is guaranteed, and the frames say why."""
    rng = np.random.default_rng(20)
    light = load / N * ones(period, duration)
    if grows:
        light *= np.linspace(0, 1, len(light))[:, None]
    skin = rested(rng)
    frames = frames_of(skin, rng, np.concatenate((light, 855 / N * ones(period, 2.0))), period=period)
    rest, stance = frames[: len(light)], frames[len(light) :]
    assert all(f.polygon.guaranteed.kind == "empty" for f in rest)
    assert all("drift" in f.flags or not f.stands for f in rest[-round(0.1 / period) :])
    assert all(not f.flags and f.polygon.guaranteed.kind == "area" for f in stance)


@pytest.mark.parametrize("period", [0.004, 0.04])
@pytest.mark.parametrize("stance", STANCES)
@pytest.mark.parametrize("sigmas", [1.0, 2.0, 4.0, -2.0])
def test_drift_is_reported_within_a_second_and_makes_no_free_taxel_sure(sigmas, stance, period):
    """Of all taxels, in one step; half a second after its end the report has ended, too."""
    rng, forces = np.random.default_rng(21), STANCES[stance]
    drift = np.concatenate([step * SIGMA * ones(period, 2.0) for step in (0, sigmas, 0)])
    frames = frames_of(rested(rng), rng, forces + drift, period=period)
    second = len(frames) // 6
    is_drift = ["drift" in f.flags or (sigmas > 0 and not f.stands) for f in frames]
    assert all(is_drift[3 * second : 4 * second])
    assert not any("drift" in f.flags for f in frames[: 2 * second] + frames[4 * second + second // 2 :])
    assert sum(np.count_nonzero(f.sets.sure & (forces == 0)) for f in frames) <= 1
    assert all(f.flags <= {"drift"} for f in frames)


def test_feet_that_step_have_no_drift_and_no_noise():
    """At 40 ms, with loads from 0 to 700 N that roll over the sole."""
    rng, time = np.random.default_rng(22), seconds(40)
    x = sole_patch().taxels.positions_link[:, 0]
    load, place = 700 * np.clip(0.5 + 0.6 * np.sin(np.pi * time), 0, 1), 0.06 * np.sin(0.7 * time)
    forces = load / N * np.maximum(1 + 12 * place * x / np.ptp(x) ** 2, 0.0)
    assert not any(f.flags for f in frames_of(rested(rng), rng, forces))


@pytest.mark.parametrize("period", [0.004, 0.04])
@pytest.mark.parametrize("stance", STANCES)
@pytest.mark.parametrize("scale", [np.full(N, 3.0), np.where(np.arange(N) % 15 == 9, 4.0, 1.0)])
def test_noise_that_grew_makes_no_free_taxel_sure(scale, stance, period):
    """Three times as large on all taxels, or four times on three: they are not sure, and the others are as before."""
    rng, forces = np.random.default_rng(23), STANCES[stance] * ones(period, 8.0)
    skin = rested(rng)
    readings = np.rint(REST + forces / NEWTONS + 2 * scale * rng.normal(size=forces.shape)).astype(int)
    frames = [skin.update(reading, 10 + period * k) for k, reading in enumerate(readings)]
    late = frames[3 * len(frames) // 4 :]
    assert all("noisy" in f.flags for f in late)
    assert not any((f.sets.sure & (forces[0] == 0) & (scale > 1)).any() for f in late)
    assert all(f.sets.sure[(forces[0] > 0) & (scale == 1)].all() for f in late)


def test_taxels_that_die_are_stuck_and_not_sure():
    """One sends its reading at rest, one that of a load from before: both stay possibly touched."""
    rng = np.random.default_rng(24)
    skin = rested(rng)
    readings = read(rng, 40.0 * (np.arange(N) < 8) * ones(PERIOD, 12.0))
    readings[:, 30], readings[:, 20] = REST, 300
    frame = [skin.update(reading, 10 + PERIOD * k) for k, reading in enumerate(readings)][-1]
    assert frame.flags == {"stuck"} and frame.stuck.nonzero()[0].tolist() == [20, 30]
    assert not frame.sets.sure[[20, 30]].any() and frame.sets.possible[[20, 30]].all() and frame.sets.sure[:8].all()
