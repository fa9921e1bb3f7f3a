"""Statements under noise: guaranteed and outer polygons, feet in the air, standard deviations, unknown noise."""

from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration import Response, ResponseTable
from skin_calib_addon.runtime import Skin, convex_hull
from skin_calib_addon.runtime.noise import joint_quantile, student
from tests.examples import slow
from tests.samples import plane, sheet, small_calibration
from tests.soles import counting_sole as sole
from tests.soles import sole_patch

N = 42
NEWTONS = 0.2  # of a count
FREE = np.zeros(N)


def read(rng, newtons, noise=2.0, frames=1, offset=0.0, low=0):
    """Return readings (frames, n) of 12 bits: rounded, and clipped at 0."""
    counts = np.asarray(newtons) / NEWTONS + offset + noise * rng.normal(size=(frames, np.size(newtons)))
    return np.clip(np.rint(counts), low, 4095).astype(np.int64)


def half_pressed(rng):
    """Return forces on the rear half of the sole, from 0 to 30 N, and which cells they press."""
    pressed = sole().positions[:, 0] < rng.uniform(-0.05, 0.05)
    return np.where(pressed, rng.uniform(0, 30, N), 0.0), pressed


@pytest.mark.parametrize(("noise", "offset"), [(0.5, 0.0), (2.0, 50.0), (5.0, 0.0)])
def test_noise_is_that_before_clipping(noise, offset):
    """Clipping at zero hides half of the noise; mean and standard deviation are those before, to a few percent."""
    rng, skin = np.random.default_rng(0), sole()
    skin.tare(read(rng, FREE, noise, 250, offset), accept=True)
    assert_allclose(skin.noise.mean.mean(), offset, atol=0.1 * noise)
    total = np.hypot(noise, np.sqrt(1 / 12))
    assert_allclose(skin.noise.sigma.mean(), total, rtol=0.08)
    assert (np.abs(skin.noise.sigma / total - 1) < 0.4).all()
    assert np.percentile(skin.noise.detection_limits, 90) < 7 * total * NEWTONS
    assert np.median(skin.noise.detection_limits) < 6 * total * NEWTONS


def test_levels_are_quantiles_of_the_noise():
    """Of so much noise that its deviation is known: the probabilities of the documentation, exact for normal noise."""
    rng, skin = np.random.default_rng(3), sole()
    noise, sigma, normal = 4.0, np.hypot(4.0, np.sqrt(1 / 12)), NormalDist()
    skin.tare(read(rng, FREE, noise, 20_000, 50.0), accept=True)
    learned = skin.noise
    pairs = len(skin.pairs)
    assert_allclose(learned.load_level, -normal.inv_cdf(2e-4) * sigma * NEWTONS * N**0.5, rtol=0.025)
    assert_allclose(learned.pair.mean() - 50, -normal.inv_cdf((1e-4 / pairs) ** 0.5) * noise + 0.5, rtol=0.015)
    assert_allclose(learned.release.mean() - 50, 1.5 * sigma, rtol=0.02)
    most = 1 - 2 * normal.cdf(-0.5 / noise)  # probability of the most frequent number
    assert_allclose(learned.repeats.mean(), np.log(1e-8) / np.log(most), rtol=0.02)
    assert_allclose(learned.load_rate_limit, learned.load_level / 10)  # the baseline follows in 10 s
    for sigmas, weight in ((0.95, 0), (2.0, 0.5), (3.05, 1)):
        assert_allclose(learned.steps(learned.mean + sigmas * learned.sigma), weight, atol=1e-9)


@pytest.mark.parametrize(("cells", "newtons", "offset"), [(2, 10.0, 0.0), (8, 10.0, 50.0), (42, 0.8, 0.0)])
def test_noise_of_free_taxels_moves_neither_load_nor_cop(cells, newtons, offset):
    """A few pressed cells, and loads below the noise of each cell: errors are zero on average, sigma holds 95 %."""
    rng, skin = np.random.default_rng(5), sole()
    skin.tare(read(rng, FREE, frames=300, offset=offset), accept=True)
    forces = np.where(np.arange(N) < cells, newtons, 0.0)
    point = forces @ skin.ground.centres / forces.sum()
    loads, cops, ratios = [], [], []
    readings = read(rng, forces, frames=400, offset=offset)
    for k, reading in enumerate(readings):
        frame = skin.update(reading, 10 + 0.004 * k)
        loads.append(frame.load - forces.sum())
        cops.append(frame.cop - point)
        ratios.extend((loads[-1] / frame.load_sigma, *(cops[-1] / frame.cop_sigma)))
    assert abs(np.mean(loads)) < 0.35 * np.std(loads)
    assert (np.abs(np.mean(cops, axis=0)) < 0.35 * np.std(cops, axis=0)).all()
    assert np.mean(np.abs(ratios) < 2) > 0.93
    assert_allclose(skin.batch(readings).load, np.array(loads) + forces.sum(), rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("rest", "offset"), [("tare", 0.0), ("tare", 4.0), ("frames", 0.0)])
def test_statements_hold_under_noise(rest, offset):
    """The guaranteed polygon is in the hull of the pressed cells, the outer one has all cells above the limit.

    Noise of the first frames guarantees nothing: no contact has ended before.
    """
    rng, skin, right, filled = np.random.default_rng(1), sole(), 0, 0
    at_rest = read(rng, FREE, frames=250, offset=offset)
    if rest == "tare":
        skin.tare(at_rest, accept=True)
    else:
        for k, reading in enumerate(at_rest):
            frame = skin.update(reading, 0.004 * k)
        assert "noise_unknown" not in frame.flags
    for k in range(200):
        forces, pressed = half_pressed(rng)
        frame = skin.update(read(rng, forces, offset=offset)[0], 10 + 0.04 * k)
        true = convex_hull(skin.ground.centres[pressed & (forces > 0)])
        polygon = frame.polygon
        core = convex_hull(skin.ground.centres[frame.sets.sure])
        assert all(core.margin(corner) > -1e-9 for corner in polygon.guaranteed.corners)
        right += all(true.margin(corner) > -1e-9 for corner in core.corners)
        filled += polygon.guaranteed.kind == "area"
        heavy = skin.ground.corners[forces > skin.noise.detection_limits].reshape(-1, 2)
        assert all(polygon.outer.margin(corner) > -1e-9 for corner in heavy)
        if rest == "tare":
            assert polygon.guaranteed_probability == 1 - 3e-4 and 0.998 < polygon.outer_probability < 1
        else:
            assert "rest_assumed" in frame.flags
    assert right >= 199 and filled >= 195 * (rest == "tare")


def test_foot_in_the_air_has_no_contact():
    """Of 1000 frames of noise, at most 2 have a contact; their wrench is zero, their outer polygon is empty."""
    rng, skin, ghosts = np.random.default_rng(2), sole(), 0
    skin.tare(read(rng, FREE, frames=250))
    for k, reading in enumerate(read(rng, FREE, frames=1000)):
        frame = skin.update(reading, 0.004 * k)
        if frame.touched or frame.stands:
            ghosts += 1
            continue
        assert not frame.wrench.any() and frame.cop is None and frame.polygon.outer.kind == "empty"
        assert "no load differs from the noise, which hides loads up to 1" in frame.reason
        assert "drift" not in frame.flags
    assert ghosts <= 2


def test_deviations_of_a_frame_are_those_of_its_noise():
    """They are computed when they are first used, also after a tare with other readings at rest."""
    rng = np.random.default_rng(4)
    early, late = rested(np.random.default_rng(1)), rested(np.random.default_rng(1))
    reading = read(rng, half_pressed(rng)[0])[0]
    expected, frame = early.update(reading, 0.0).force_sigmas, late.update(reading, 0.0)
    late.tare(read(rng, FREE, 20.0, 250, 8.0))
    assert_allclose(frame.force_sigmas, expected, rtol=0)


def test_foot_above_the_limit_of_its_sum_stands():
    """It does so if no taxel has more than its own noise; the stated deviation of its load is not too small."""
    rng, skin, errors = np.random.default_rng(3), sole(), []
    skin.tare(read(rng, FREE, frames=250))
    forces = np.full(N, skin.noise.load_limit / N)
    assert forces[0] < 2.5 * skin.noise.sigma[0] * NEWTONS
    for k in range(300):
        frame = skin.update(read(rng, forces)[0], 0.04 * k)
        assert frame.stands and frame.touched
        errors.append((frame.load - forces.sum()) / frame.load_sigma)
    assert np.sqrt(np.mean(np.square(errors))) < 2


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.15, -0.08)], ids=["below the link frame", "next to it"])
def test_standard_deviations_are_those_of_repeated_readings(shift):
    """Load, wrench, CoP and ZMP scatter as stated, for forces that are clear everywhere, wherever the link frame is."""
    rng, centred = np.random.default_rng(4), sole_patch()
    taxels = centred.taxels
    moved = replace(
        taxels, positions_link=taxels.positions_link + (*shift, 0), corners_link=taxels.corners_link + (*shift, 0)
    )
    response = Response((0.0, NEWTONS))
    patches = (replace(centred, taxels=moved),)
    skin = Skin(small_calibration(link="sole", patches=patches, surfaces=(plane(),), response=response))
    skin.tare(read(rng, FREE, frames=250))
    forces = np.full(N, 8.0)
    frames = [skin.update(reading, 0.01 * k) for k, reading in enumerate(read(rng, forces, frames=800))]
    for name, sigma in (("load", "load_sigma"), ("wrench", "wrench_sigma"), ("cop", "cop_sigma"), ("zmp", "zmp_sigma")):
        found = np.std([getattr(frame, name) for frame in frames], axis=0)
        stated = np.mean([getattr(frame, sigma) for frame in frames], axis=0)
        observed = np.array(found) > 1e-12
        ratio = stated[observed] / found[observed] if np.ndim(found) else stated / found
        assert (np.abs(ratio - 1) < 0.25).all(), name
    assert_allclose(frames[0].force_sigmas, NEWTONS * skin.noise.sigma)


def test_moments_of_the_wrench_are_as_uncertain_as_the_cop():
    """Under a heavy load on the rear half, noise is small: the deviation of a moment is load times that of the CoP."""
    rng, skin = np.random.default_rng(18), sole()
    skin.tare(read(rng, FREE, 0.5, 250))
    forces = np.maximum(0.0, -1e3 * skin.positions[:, 0] + 200 * skin.positions[:, 1])
    frame = skin.update(read(rng, forces, 0.5)[0], 0.0)
    assert frame.moments is None
    assert_allclose(frame.wrench_sigma[[4, 3]], frame.load * frame.cop_sigma, rtol=0.05)


def test_noise_common_to_all_taxels_is_in_the_deviation_of_the_load():
    """Half of the variance is common: the load scatters five times as much, and the free foot still does not stand."""
    rng, skin = np.random.default_rng(5), sole()

    def readings(newtons, frames):
        noise = rng.normal(size=(frames, N)) + rng.normal(size=(frames, 1))
        return np.rint(newtons / NEWTONS + 100 + 2 * noise / np.sqrt(2)).astype(int)

    skin.tare(readings(FREE, 250), accept=True)
    assert 3.5 < skin.noise.common < 6
    air = [skin.update(reading, 0.01 * k).stands for k, reading in enumerate(readings(FREE, 1000))]
    assert sum(air) <= 2
    frames = [skin.update(reading, 20 + 0.01 * k) for k, reading in enumerate(readings(np.full(N, 8.0), 400))]
    found, stated = np.std([f.load for f in frames]), np.mean([f.load_sigma for f in frames])
    assert 0.8 < stated / found < 1.25


def test_heavy_tails_raise_the_thresholds():
    """Noise with heavy tails at rest makes nothing sure in the air."""
    rng, skin = np.random.default_rng(6), sole()

    def readings(frames):
        return np.rint(100 + np.sqrt(2) * rng.standard_t(4, (frames, N))).astype(int)

    skin.tare(readings(250), accept=True)
    assert ((skin.noise.sure - skin.noise.mean) / skin.noise.sigma > 8).all()
    assert ((skin.noise.lasting - skin.noise.mean) / skin.noise.sigma < 3).all()
    sure = [skin.update(r, 0.01 * k).sets.sure.any() for k, r in enumerate(readings(500))]
    assert np.mean(sure) <= 2e-3


def test_without_knowledge_of_the_noise_nothing_is_guaranteed():
    """The frame states it; thresholds of the caller are such a knowledge, but have no probability."""
    pressed = np.full(N, 100)
    skin = sole()
    for frame in (skin.update(pressed, 0.0), skin.update(pressed, 0.01)):
        assert frame.flags == {"noise_unknown"} and frame.touched and frame.cop is not None
        assert frame.polygon.guaranteed.kind == "empty" and frame.polygon.guaranteed_probability is None
        assert frame.cop_sigma is None and frame.load_sigma is None and frame.force_sigmas is None
    skin.tare(np.zeros((5, N), int))  # too few frames
    assert skin.noise is None and "noise_unknown" in skin.update(pressed, 0.02).flags
    chosen = sole(switch_on=1.5).update(pressed, 0.0)
    assert chosen.flags == frozenset() and chosen.polygon.guaranteed.kind == "area"
    assert chosen.polygon.guaranteed_probability is None and sole(switch_on=1.5).switch_off == 0.75


def test_foot_that_stands_from_the_start_is_no_rest():
    """A constant or a slowly growing load never counts as rest."""
    rng = np.random.default_rng(7)
    for load in (lambda k: 3.0, lambda k: 0.01 * k, lambda k: 20.0 * (k > 30)):
        skin = sole()
        for k in range(200):
            frame = skin.update(read(rng, np.where(np.arange(N) < 12, load(k), 0.0))[0], 0.01 * k)
        assert "noise_unknown" in frame.flags and skin.noise is None
        for k in range(200, 300):  # lifted: now it rests
            frame = skin.update(read(rng, FREE)[0], 0.01 * k)
        assert "noise_unknown" not in frame.flags and skin.noise is not None


def test_dead_taxel_is_unknown_and_possibly_touched():
    """A taxel that sends one number while the others scatter has no force; the outer polygon of a foot contains it."""
    rng, skin = np.random.default_rng(8), sole()
    rest = read(rng, FREE, frames=250)
    rest[:, 0], rest[:, 41] = 0, 900
    skin.tare(rest, accept=True)
    assert skin.noise.dead.nonzero()[0].tolist() == [0, 41]
    reading = read(rng, np.where(np.abs(skin.positions[:, 0]) < 0.03, 20.0, 0.0))[0]
    reading[0], reading[41] = 0, 900
    frame = skin.update(reading, 0.0)
    assert frame.flags == {"dead"} and not frame.known[[0, 41]].any() and np.isinf(frame.force_sigmas[0])
    assert all(frame.polygon.outer.margin(c) > -1e-9 for c in skin.ground.corners[[0, 41]].reshape(-1, 2))


def test_outer_polygon_contains_what_is_active():
    """A heel that fades to two standard deviations, with a loaded toe, stays a contact; no polygon leaves it out."""
    rng, skin = np.random.default_rng(8), sole()
    skin.tare(read(rng, FREE, frames=250, offset=20.0), accept=True)
    heel, toe = (int(f(skin.positions[:, 0])) for f in (np.argmin, np.argmax))
    for k, counts in enumerate((40, 40, 3.6)):  # the noise has a standard deviation of 2
        forces = FREE.copy()
        forces[heel], forces[toe] = counts * NEWTONS, 20.0
        frame = skin.update(read(rng, forces, noise=0.3, offset=20.0)[0], 0.01 * k)
    assert any(heel in contact.taxels for contact in frame.contacts)
    assert all(frame.polygon.outer.margin(corner) > -1e-9 for corner in frame.polygon.nominal.corners)


@pytest.mark.parametrize("options", [{}, {"switch_on": 0.2, "switch_off": 0.1}])
def test_masked_taxel_is_possibly_touched(options):
    """The outer polygon of a foot that stands contains masked taxels; that of a free foot is empty."""
    rng, skin = np.random.default_rng(9), sole(**options)
    skin.tare(read(rng, FREE, frames=250, offset=20.0), accept=True)
    skin.mask([skin.ids[0]])
    forces = np.where(skin.positions[:, 0] > 0.03, 20.0, 0.0)
    frame = skin.update(read(rng, forces, offset=20.0)[0], 0.0)
    assert all(frame.polygon.outer.margin(c) > -1e-9 for c in skin.ground.corners[0])
    if not options:
        air = skin.update(read(rng, FREE, offset=20.0)[0], 0.01)
        assert air.polygon.outer.kind == "empty"


def test_noisy_taxel_has_its_own_thresholds():
    """One taxel with twenty times the noise makes no contacts in the air."""
    rng, skin = np.random.default_rng(10), sole()
    scale = np.where(np.arange(N) == 7, 20.0, 1.0)

    def readings(frames):
        return np.rint(200 + 2 * scale * rng.normal(size=(frames, N))).astype(int)

    skin.tare(readings(250), accept=True)
    assert 15 < skin.noise.sigma[7] / np.median(skin.noise.sigma) < 25
    assert np.mean([bool(skin.update(r, 0.01 * k).touched) for k, r in enumerate(readings(500))]) <= 2e-3


@pytest.mark.parametrize("drift", [1.0, -1.0])
def test_drift_of_the_free_taxels_is_reported(drift):
    """A common drift by one standard deviation looks like a load; two seconds later nothing is guaranteed."""
    rng, skin = np.random.default_rng(11), sole()
    skin.tare(read(rng, FREE, frames=250, offset=50.0), accept=True)
    for k in range(200):
        frame = skin.update(read(rng, FREE, offset=50.0)[0], 0.01 * k)
        assert "drift" not in frame.flags
    for k in range(200):
        frame = skin.update(read(rng, FREE, offset=50.0 + 2 * drift)[0], 2 + 0.01 * k)
    assert "drift" in frame.flags
    assert frame.polygon.guaranteed.kind == "empty" and frame.polygon.guaranteed_probability is None


def test_falling_response_and_table_have_detection_limits_in_newtons():
    """Noise is in readings: a response that falls, or bends, gives the force at the limit."""
    rng = np.random.default_rng(12)
    falling = sole(Response((100.0, -0.1), (0.0, 1000.0)))
    falling.tare(np.clip(np.rint(1000 + 2 * rng.normal(size=(250, N))), 0, 1000).astype(int))
    assert_allclose(np.median(falling.noise.detection_limits), 0.1 * (5.6 * 2.02 + 0.5), rtol=0.1)
    frame = falling.update(np.full(N, 900), 0.0)
    assert frame.stands and frame.sets.sure.all()
    bent = sole(ResponseTable((0.0, 20.0, 100.0), (0.0, 1.0, 41.0)))
    bent.tare(np.rint(2 + rng.normal(size=(250, N)) / 2).astype(int), accept=True)
    pressed = bent.update(np.full(N, 62), 0.0)
    assert_allclose(pressed.force_sigmas, 10 * 0.05 * bent.noise.sigma, rtol=1e-9)


def test_limb_without_ground_has_contacts_by_noise():
    """A skin around a limb finds a press of one taxel above its limit, and nothing at rest."""
    rng = np.random.default_rng(13)
    patch = sheet(4, 12, 0.01)
    skin = Skin(small_calibration(patches=(patch,), surfaces=(plane(),), response=Response((0.0, NEWTONS))))
    skin.tare(read(rng, np.zeros(48), frames=250))
    quiet = skin.update(read(rng, np.zeros(48))[0], 0.0)
    assert quiet.touched is False and quiet.reason == "the skin is not flat and has no ground; pass one to load()"
    press = np.zeros(48)
    press[17] = 10.0
    frame = skin.update(read(rng, press)[0], 0.01)
    assert [c.taxels.tolist() for c in frame.contacts] == [[17]] and frame.wrench_sigma.shape == (6,)


def test_students_quantiles():
    """The expansion agrees with SciPy to a percent at the thresholds in use."""
    from scipy.stats import norm, t

    freedom = np.array([20.0, 60.0, 250.0])
    for probability in (3e-4, 1e-5):
        expected = t.isf(probability, freedom)
        assert_allclose(student(float(norm.isf(probability)), freedom), expected, rtol=0.015)


def test_level_that_two_correlated_variables_exceed():
    """It agrees with SciPy's bivariate normal distribution; without correlation it is the quantile of the root."""
    from scipy.stats import multivariate_normal, norm

    assert_allclose(joint_quantile(1e-6, 0.0, 2), norm.isf(1e-3), rtol=1e-4)
    for c in (0.1, 0.5, 0.9):
        t = joint_quantile(1e-6, c, 2)
        assert_allclose(multivariate_normal.cdf([-t, -t], cov=[[1, c], [c, 1]]), 1e-6, rtol=0.01)
    assert joint_quantile(1e-6, 1.0, 2) < norm.isf(1e-6) + 0.1


def test_noise_common_to_neighbours_makes_no_pairs():
    """Half of the variance is common: two free neighbours exceed the level of a pair once in 10 000 frames at most."""
    rng, skin = np.random.default_rng(17), sole()

    def readings(frames):
        return np.rint(100 + np.sqrt(2) * (rng.normal(size=(frames, N)) + rng.normal(size=(frames, 1))))

    skin.tare(readings(250), accept=True)
    above = readings(40000) > skin.noise.pair
    both = (above[:, skin.pairs[:, 0]] & above[:, skin.pairs[:, 1]]).any(axis=1)
    assert both.mean() < 4e-4


@pytest.mark.parametrize("seed", range(2))
def test_correlated_noise_is_learned_from_the_first_frames(seed):
    """A correlation of 0.6 from frame to frame is no slow push."""
    rng, skin = np.random.default_rng(seed), sole()
    noise = rng.normal(size=(251, N))
    for k in range(1, len(noise)):
        noise[k] = 0.6 * noise[k - 1] + 0.8 * noise[k]
    for k, reading in enumerate(np.maximum(np.rint(2 * noise), 0)):
        skin.update(reading, 0.004 * k)
    assert skin.noise is not None


def test_three_frames_in_a_row_make_a_weak_contact_sure():
    """Of 3.5 standard deviations on a foot that stands, single frames prove nothing; repeated frames no more."""
    rng, skin = np.random.default_rng(19), sole()
    skin.tare(read(rng, FREE, frames=250))
    weak = np.arange(N) == 30
    forces = np.where(np.arange(N) < 8, 30.0, np.where(weak, 3.5 * skin.noise.sigma * NEWTONS, 0.0))
    readings = read(rng, forces, frames=600)
    found = [skin.update(reading, 0.004 * k).sets for k, reading in enumerate(readings)]
    sure = np.array([sets.sure for sets in found])
    single = readings[:, 30] > skin.noise.sure[30]
    assert single.mean() < 0.1 and sure[2:, 30].mean() > 0.5
    assert all((sets.sure <= sets.possible).all() for sets in found)
    high = int(np.flatnonzero((readings[:, 30] > skin.noise.lasting[30]) & ~single)[0])
    for k in range(20):
        frame = skin.update(readings[high], 10 + 0.004 * k)
    assert not frame.sets.sure[30]


@pytest.mark.parametrize("correlation", [0.0, 0.6])
def test_three_frames_of_noise_rarely_make_a_free_taxel_sure(correlation):
    """The level follows the correlation from frame to frame; the statement is one frame in 3000."""
    rng = np.random.default_rng(20)
    noise = rng.normal(size=(20000, N))
    for k in range(1, len(noise)):
        noise[k] = correlation * noise[k - 1] + np.sqrt(1 - correlation**2) * noise[k]
    readings = np.rint(100 + 2 * noise)
    skin = sole()
    skin.tare(readings[:250], accept=True)
    above = readings[250:] > skin.noise.lasting
    wrong = (above[2:] & above[1:-1] & above[:-2]).any(axis=1).mean()
    assert wrong < 3e-4
    assert 2.0 < ((skin.noise.lasting - skin.noise.mean) / skin.noise.sigma).min() < (3.8 if correlation else 2.6)


def test_repeated_frames_at_rest_are_no_more_frames():
    """A fast controller that passes each of 25 frames ten times has the thresholds of about 25 frames."""
    distance = {}
    for frames, times in ((250, 1), (25, 1), (25, 10)):
        skin = sole()
        skin.tare(
            np.repeat(read(np.random.default_rng(21), FREE, frames=frames, offset=100), times, axis=0), accept=True
        )
        distance[frames, times] = np.median((skin.noise.sure - skin.noise.mean) / skin.noise.sigma)
    assert distance[25, 10] > distance[250, 1] + 0.5 * (distance[25, 1] - distance[250, 1])


def test_in_cell_option_is_exact_for_a_linear_pressure_of_any_contact():
    """For a pressure that is linear where it acts, and ends at the border of the sole, CoP and ZMP agree with it."""
    skin = sole(switch_on=1e-6, in_cell=True)
    x = skin.positions[:, 0]
    forces = 10 + 60 * x
    forces[5] = 0.0  # free: no full contact
    plain = sole(switch_on=1e-6).update(forces / NEWTONS, 0.0)
    frame = skin.update(forces / NEWTONS, 0.0)
    assert_allclose(frame.cop, frame.zmp, atol=1e-12)
    assert_allclose((-frame.wrench[4], frame.wrench[3]), frame.cop * frame.wrench[2], atol=1e-9)
    assert np.linalg.norm(frame.cop - plain.cop) > 1e-4


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "response", [Response((0.0, 0.2)), Response((100.0, -0.1), (0.0, 1000.0)), Response((0.5, -2.0, 3.0, 1e-3))]
)
def test_any_reading_gives_finite_results_or_none(response):
    """Invalid taxels in a frame raise nothing, and no result is a number that is not finite."""
    rng, skin = np.random.default_rng(14), sole(response)
    rest = np.rint(response.rest + 2 * rng.normal(size=(40, N))).astype(int)
    skin.tare(rest)
    values = [0.0, 1.0, 3.0, 50.0, 900.0, 1e30, -5.0, np.nan, np.inf, -np.inf]
    for k in range(100):
        frame = skin.update(rng.choice(values, N) if k % 5 else rest[k % 40], 0.01 * k)
        assert (frame.cop is None) == (frame.reason is not None) and np.isfinite(frame.forces).all()
        assert np.isfinite(frame.wrench).all() == (frame.problem is None)
        for name in ("cop", "zmp", "cop_sigma", "zmp_sigma", "wrench_sigma"):
            result = getattr(frame, name)
            assert result is None or np.isfinite(result).all()
        assert np.isfinite(frame.polygon.outer.corners).all()


def pushes(kind, rng):
    """Return forces (200, 48) of a finger at 1 s: sliding over the sheet, tapping, pulsing slowly or holding still."""
    time = np.arange(200) / 200
    forces = np.zeros((200, 48))
    if kind == "slide":
        distance = np.abs(np.arange(12) - 11 * time[:, None])
        forces[:, 12:24] = 8 * np.maximum(1 - distance, 0)
    elif kind == "tap":
        forces[::25, 17] = 8
    elif kind == "pulse":
        forces[:, 17] = 4 - 4 * np.cos(8 * np.pi * time)
    elif kind == "hold":
        forces[:, 17] = 8
    else:
        assert kind == "rest"
    return forces


@pytest.mark.parametrize("counts", [slow(0.5), 2.0, slow(4.0)])
@pytest.mark.parametrize("kind", ["slide", "tap", "pulse", "hold", "rest"])
def test_only_a_rest_teaches_the_noise(kind, counts):
    """A skin that is touched from its first frame on must not take the touch for its noise."""
    rng = np.random.default_rng(15)
    patch = sheet(4, 12, 0.01)
    skin = Skin(small_calibration(patches=(patch,), surfaces=(plane(),), response=Response((0.0, NEWTONS))))
    for k, forces in enumerate(pushes(kind, rng)):
        frame = skin.update(read(rng, forces, counts)[0], k / 200)
    assert (skin.noise is not None) == (kind == "rest")
    assert ("noise_unknown" in frame.flags) == (kind != "rest")


def rested(rng, noise=2.0, offset=0.0, frames=250):
    """Return a sole that has learned its noise."""
    skin = sole()
    skin.tare(read(rng, FREE, noise, frames, offset), accept=True)
    return skin


def first_flag(skin, readings, flag, period=0.004):
    """Return the number of the first frame with a flag, of frames from 10 s on; None if there is none."""
    for k, reading in enumerate(readings):
        if flag in skin.update(reading, 10 + period * k).flags:
            return k
    return None


@pytest.mark.parametrize(
    ("noise", "offset", "period", "loaded"),
    [slow(2.0, 50.0, 0.001, True), (2.0, 50.0, 0.004, True), (0.5, 0.0, 0.004, False), (0.5, 0.0, 0.04, True)],
)
def test_frozen_bus_is_flagged(noise, offset, period, loaded):
    """One frame again and again is flagged within a second, and guarantees nothing; live frames before it are not."""
    rng = np.random.default_rng(4)
    skin = rested(rng, noise, offset)
    live = read(rng, half_pressed(rng)[0] if loaded else FREE, noise, 100, offset)
    assert first_flag(skin, live, "frozen", period) is None
    for k in range(round(1 / period)):
        frame = skin.update(live[-1], 10 + period * (len(live) + k))
    assert "frozen" in frame.flags and frame.polygon.guaranteed.kind == "empty"
    assert "frozen" not in skin.update(read(rng, FREE, noise, 1, offset)[0], 12 + period * len(live)).flags


def test_frames_that_are_equal_by_chance_are_not_frozen():
    """With little noise most frames repeat the one before: the time to the flag follows from that probability."""
    rng = np.random.default_rng(23)
    assert first_flag(rested(rng, 0.22), read(rng, FREE, 0.22, 300), "frozen", 0.04) is None


@pytest.mark.parametrize("offset", [0.0, 50.0])
def test_zeros_everywhere_are_flagged(offset):
    """A dead board sends zeros: below a rest with an offset, frozen where the rest is at zero."""
    rng = np.random.default_rng(5)
    zeros = np.zeros((100, N), np.uint16)
    assert first_flag(rested(rng, offset=offset), zeros, "below_rest" if offset else "frozen") <= 60


def test_slow_electronics_are_not_frozen():
    """A fast controller sees each frame of slow electronics many times; a simulator has no noise to repeat."""
    rng = np.random.default_rng(6)
    frames = np.repeat(read(rng, half_pressed(rng)[0], frames=30), 20, axis=0)
    skin = rested(rng)
    flags = {flag for k, reading in enumerate(frames) for flag in skin.update(reading, 10 + 0.001 * k).flags}
    assert flags <= {"time_jump"}
    still = sole()
    for k in range(300):
        flags = still.update(np.zeros(N), 0.01 * k).flags
        assert "frozen" not in flags and "stuck" not in flags


@pytest.mark.parametrize("wrong", [-490, "signed"])
def test_reading_below_rest_is_flagged(wrong):
    """-98 N on one taxel, and a byte above 127 that is read as signed, are no missing force."""
    rng = np.random.default_rng(7)
    skin = rested(rng, offset=20.0)
    reading = read(rng, np.where(np.arange(N) == 3, 26.0, 0.0), offset=20.0)[0]
    assert "below_rest" not in skin.update(reading, 9.99).flags
    reading = np.where(np.arange(N) == 3, wrong, reading) if wrong != "signed" else reading.astype(np.uint8).view("i1")
    assert "below_rest" in skin.update(reading, 10.0).flags


def test_below_rest_follows_a_response_that_falls():
    """Where readings fall with the force, below rest is above the reading at rest."""
    rng = np.random.default_rng(8)
    skin = sole(ResponseTable((0.0, 4095.0), (800.0, 0.0)))
    skin.tare(4000 + np.rint(2 * rng.normal(size=(250, N))).astype(int), accept=True)
    assert "below_rest" not in skin.update(np.full(N, 3900), 0.0).flags
    assert "below_rest" in skin.update(np.where(np.arange(N) == 3, 4090, 4000), 0.01).flags


@pytest.mark.parametrize("noise", [2.0, slow(0.5)])
def test_full_scale_without_a_range_is_stuck(noise):
    """A taxel at the end of its converter has no noise: flagged within 1.2 s; the live one next to it is not."""
    rng = np.random.default_rng(9)
    skin = rested(rng, noise)
    readings = read(rng, np.where(np.arange(N) < 2, 400.0, 0.0), noise, 300)
    assert first_flag(skin, readings, "stuck") is None
    readings[:, 1] = 4095
    for k, reading in enumerate(readings):
        frame = skin.update(reading, 12 + 0.004 * k)
    assert frame.stuck.nonzero()[0].tolist() == [1]


def arrays_in(record):
    """Yield the arrays of a record: of its fields, its properties, and of records and tuples in them."""
    for name in {n for n in (*vars(record), *dir(type(record))) if n[0] != "_"} - {"scratch"}:
        value = getattr(record, name, None)
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, np.ndarray):
                yield f"{type(record).__name__}.{name}", part


@pytest.mark.parametrize("learned", [False, True])
def test_frames_and_geometry_are_read_only(learned):
    """A controller that writes into a frame, or into the geometry, must not change later frames."""
    rng = np.random.default_rng(11)
    skin = rested(rng) if learned else sole()
    frame = skin.update(read(rng, half_pressed(rng)[0])[0], 0.0)
    records = [frame, frame.sets, frame.footprint, *frame.contacts, skin.geometry, skin.ground, skin.ground.plane]
    records += [skin.noise] if learned else []
    computed = {"Frame.active"}  # each time it is read
    found = {name: array for record in records for name, array in arrays_in(record)}
    assert {"Frame.forces", "Frame.zmp", "Touched.active", "Contact.position", "SkinGeometry.terms"} <= set(found)
    assert [name for name, array in found.items() if array.flags.writeable and name not in computed] == []


@pytest.mark.parametrize("side", [1, -1])
def test_skewed_noise_raises_the_level_of_the_load(side):
    """Gamma noise of shape 4 and skewness 1, common to all: the quantile of Cornish and Fisher; to the left, none."""
    from scipy.stats import gamma, norm

    rng, skin = np.random.default_rng(22), sole()
    noise = rng.permutation(gamma.ppf((np.arange(5000) + 0.5) / 5000, 4) - 4)  # of standard deviation 2
    skin.tare(np.rint(500 + 20 * side * noise[:, None] + rng.normal(size=(5000, N))), accept=True)
    quantile = norm.isf(2e-4)
    expected = quantile + (quantile**2 - 1) * (side > 0) / 6
    assert_allclose(skin.noise.load_level, expected * 40 * NEWTONS * N, rtol=0.01)


def test_silent_sensors_have_no_load_at_rest():
    """Readings that never change: the rounding of their sum is no load, but two steps of the converter are."""
    for seed in range(20):
        rest = np.random.default_rng(seed).integers(0, 4000, N)
        skin = sole(Response((0.0, 0.0123 + seed * 1e-4)))
        skin.tare(np.tile(rest, (250, 1)), accept=True)
        assert skin.update(rest, 0.0).touched is False
        assert skin.update(rest + 9 * (np.arange(N) == seed), 0.01).touched
