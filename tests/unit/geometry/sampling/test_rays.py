"""Rays on sections: bisection against comparison with every segment."""

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.geometry.sampling.rays import RayCaster
from tests.oracles import cast_on_segments

seeds = st.integers(0, 2**32 - 1)
CENTRE = np.zeros((1, 2))


def polygon(seed, corners=12, radius=1.0):
    """Corners of a star-shaped polygon about the origin, counter-clockwise."""
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * (np.arange(corners) + rng.uniform(-0.4, 0.4, corners)) / corners
    return radius * rng.uniform(0.7, 1.3, corners)[:, None] * np.column_stack((np.cos(angle), np.sin(angle)))


def sides(corners):
    """Segments between neighbouring corners, the last one back to the first."""
    return np.stack((corners, np.roll(corners, -1, axis=0)), axis=1)


def fan(seed, count=40):
    """Unit vectors of random directions."""
    angle = np.random.default_rng(seed).uniform(0, 2 * np.pi, count)
    return np.column_stack((np.cos(angle), np.sin(angle)))


def cast_all(row, ends, origins, directions, **order):
    """Cast with the order of the rays, and without it; both must give the same result."""
    rows = len(origins)
    distance, hit = RayCaster(row, ends, rows, **order).cast(origins, directions)
    plain, _ = RayCaster(row, ends, rows).cast(origins, directions)
    assert_allclose(distance, plain, rtol=1e-9, atol=0)
    met = ~np.isnan(distance)
    assert (np.broadcast_to(np.arange(rows)[:, None], hit.shape)[met] == np.asarray(row)[hit[met]]).all()
    return distance, hit


def expected(row, ends, origins, directions):
    """The oracle's distances."""
    return [
        [cast_on_segments(o, d, ends[np.asarray(row) == i]) for o, d in zip(*rays)]
        for i, rays in enumerate(zip(origins, directions))
    ]


def in_random_order(seed, ends):
    """The same segments shuffled, each from either end."""
    rng = np.random.default_rng(seed)
    ends = ends[rng.permutation(len(ends))]
    return np.where(rng.random(len(ends))[:, None, None] < 0.5, ends, ends[:, ::-1])


@given(seed=seeds)
def test_fan_is_the_comparison_with_every_segment(seed):
    """Rays from the centre of star-shaped polygons, three rows at once, one of them empty; the hit is the segment."""
    ends = [in_random_order(seed + i, sides(polygon(seed + i))) for i in (0, 2)]
    row, ends = np.repeat((0, 2), [len(e) for e in ends]), np.concatenate(ends)
    directions = np.stack([fan(seed + i) for i in range(3)])
    origins = np.zeros_like(directions)
    distance, hit = cast_all(row, ends, origins, directions, centres=np.zeros((3, 2)))
    assert_allclose(distance, expected(row, ends, origins, directions), rtol=1e-12)
    assert np.isnan(distance[1]).all() and not np.isnan(distance[[0, 2]]).any()
    points = (distance[..., None] * directions)[[0, 2]]
    start, stop = ends[hit[[0, 2]]].transpose(2, 0, 1, 3)
    along, off = stop - start, points - start
    assert np.abs(along[..., 0] * off[..., 1] - along[..., 1] * off[..., 0]).max() < 1e-12


@given(seed=seeds, shift=st.tuples(st.floats(-5, 5), st.floats(-5, 5)))
def test_fan_may_start_anywhere(seed, shift):
    """The centre of a row need not be the origin of its frame."""
    ends, directions = sides(polygon(seed)) + shift, fan(seed)[None]
    origins = np.broadcast_to(np.array(shift), directions.shape)
    there, _ = cast_all(np.zeros(len(ends), int), ends, origins, directions, centres=np.array([shift]))
    here, _ = cast_all(np.zeros(len(ends), int), ends - shift, 0 * origins, directions, centres=CENTRE)
    assert_allclose(there, here, rtol=1e-9)


@given(seed=seeds, width=st.sampled_from((0.0, 1e-300, 1e-17, 1e-14, 1e-12, 1e-10, 1e-7)))
def test_closed_section_is_met_by_every_ray(seed, width):
    """Rays exactly through the corners of a closed polygon hit it, also where the cut left a segment of no length."""
    corners = polygon(seed)
    split = np.repeat(corners, 2, axis=0)
    split[1::2] += width * (np.roll(corners, -1, axis=0) - corners)
    ends = in_random_order(seed, sides(split))
    through = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    angle = np.arctan2(corners[:, 1], corners[:, 0])
    directions = np.concatenate((through, np.column_stack((np.cos(angle), np.sin(angle)))))[None]
    distance, _ = RayCaster(np.zeros(len(ends), int), ends, 1, centres=CENTRE).cast(0 * directions, directions)
    assert_allclose(distance[0], np.tile(np.linalg.norm(corners, axis=1), 2), rtol=1e-6)


@given(seed=seeds)
def test_axis_parallel_rays_hit_axis_parallel_corners(seed):
    """A square whose corners and sides lie where the angle's formula changes its branch."""
    rng = np.random.default_rng(seed)
    corners = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)], float)
    corners *= rng.uniform(0.5, 2)
    directions = (corners / np.linalg.norm(corners, axis=1, keepdims=True))[None]
    ends = in_random_order(seed, sides(corners))
    distance, _ = cast_all(np.zeros(8, int), ends, 0 * directions, directions, centres=CENTRE)
    assert_allclose(distance[0], np.linalg.norm(corners, axis=1), rtol=1e-12)


@given(seed=seeds)
def test_outermost_of_overlapping_shells_counts(seed):
    """An inner polygon, whole or in parts, is never hit; the outer one hides it, in each row its own."""
    rng = np.random.default_rng(seed)
    outer = [sides(polygon(seed + i, radius=3.0)) for i in range(3)]
    inner = [sides(polygon(seed + 9, corners=7))[rng.random(7) < fraction] for fraction in (0.5, 0.0, 1.0)]
    ends = np.concatenate([in_random_order(seed, np.concatenate(pair)) for pair in zip(outer, inner)])
    row = np.repeat(np.arange(3), [len(a) + len(b) for a, b in zip(outer, inner)])
    directions = np.stack([fan(seed + i, 15) for i in range(3)])
    distance, hit = cast_all(row, ends, 0 * directions, directions, centres=np.zeros((3, 2)))
    expected_ones = [[cast_on_segments(np.zeros(2), d, o) for d in fan_] for o, fan_ in zip(outer, directions)]
    assert_allclose(distance, expected_ones, rtol=1e-12)
    assert np.linalg.norm(ends[hit], axis=-1).min() > 1.5  # the ends of the outer ones


@given(seed=seeds)
def test_folded_section_is_met_where_it_is_furthest(seed):
    """Segments of any kind, crossing each other: always the furthest crossing."""
    rng = np.random.default_rng(seed)
    ends = rng.normal(size=(9, 2, 2))
    directions = fan(seed)[None]
    row = np.zeros(9, int)
    distance, _ = cast_all(row, ends, 0 * directions, directions, centres=CENTRE)
    assert_allclose(distance, expected(row, ends, 0 * directions, directions), rtol=1e-9)


@given(seed=seeds, missing=st.sets(st.integers(0, 11), min_size=1, max_size=12))
def test_rays_through_gaps_meet_nothing(seed, missing):
    """NaN exactly where sides are missing, also in a row that has lost its first, last or every side."""
    whole = sides(polygon(seed))
    ends = np.delete(whole, sorted(missing), axis=0)
    directions = fan(seed)[None]
    row = np.zeros(len(ends), int)
    distance, _ = cast_all(row, ends, 0 * directions, directions, centres=CENTRE)
    free = [
        [not np.isnan(cast_on_segments(np.zeros(2), d, side[None])) for side in whole[sorted(missing)]]
        for d in directions[0]
    ]
    assert_array_equal(np.isnan(distance[0]), np.any(free, axis=1))
    assert_allclose(distance, expected(row, ends, 0 * directions, directions), rtol=1e-12)


@given(seed=seeds, turn=st.floats(0, 6.3), low=st.floats(-3, 3))
def test_parallel_rays_are_the_comparison_with_every_segment(seed, turn, low):
    """Rays of one direction on a height field with gaps; NaN next to it and in the gaps."""
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(0, 4, 12)) + low
    assume(np.diff(x).min() > 1e-3)
    profile = np.column_stack((x, rng.uniform(1, 2, 12)))
    ends = np.stack((profile[:-1], profile[1:]), axis=1)[rng.random(11) < 0.8]
    rotation = np.array(((np.cos(turn), -np.sin(turn)), (np.sin(turn), np.cos(turn))))
    ends, up = in_random_order(seed, ends) @ rotation.T, rotation @ (0, 1)
    starts = np.column_stack((rng.uniform(low - 0.5, low + 4.5, 40), np.zeros(40)))
    origins = (starts @ rotation.T)[None]
    directions = np.broadcast_to(up, origins.shape)
    row = np.zeros(len(ends), int)
    distance, _ = cast_all(row, ends, origins, directions, direction=up)
    if len(ends):
        assert_allclose(distance, expected(row, ends, origins, directions), rtol=1e-9)


@given(seed=seeds)
def test_parallel_rays_meet_the_ends_of_segments(seed):
    """Rays exactly through the joints and both ends of a profile hit it."""
    rng = np.random.default_rng(seed)
    profile = np.column_stack((np.cumsum(rng.uniform(0.1, 1, 9)), rng.uniform(1, 2, 9)))
    ends = in_random_order(seed, np.stack((profile[:-1], profile[1:]), axis=1))
    origins = (profile * (1, 0))[None]
    directions = np.broadcast_to((0.0, 1.0), origins.shape)
    distance, _ = cast_all(np.zeros(8, int), ends, origins, directions, direction=np.array((0.0, 1.0)))
    assert_allclose(distance[0], profile[:, 1], rtol=1e-9)


@given(seed=seeds)
def test_parallel_rays_take_the_outermost_of_two_sheets(seed):
    """A cover over a cover: the upper one."""
    rng = np.random.default_rng(seed)
    x = np.linspace(0, 1, 6)
    lower, upper = (np.column_stack((x, h + 0.3 * rng.random(6))) for h in (1, 2))
    ends = np.concatenate([np.stack((p[:-1], p[1:]), axis=1) for p in (lower, upper)])
    origins = np.column_stack((rng.uniform(0, 1, 20), np.zeros(20)))[None]
    directions = np.broadcast_to((0.0, 1.0), origins.shape)
    distance, _ = cast_all(np.zeros(10, int), ends, origins, directions, direction=np.array((0.0, 1.0)))
    assert_allclose(distance[0], np.interp(origins[0, :, 0], upper[:, 0], upper[:, 1]), rtol=1e-12)


def test_surface_behind_the_start_of_a_ray_is_not_met():
    """Rays have one direction: a wall behind the centre is no hit."""
    ends = np.array([[(-1.0, -1.0), (-1.0, 1.0)]])
    directions = np.array([[(1.0, 0.0), (-1.0, 0.0)]])
    for order in ({"centres": CENTRE}, {}):
        distance, _ = RayCaster(np.zeros(1, int), ends, 1, **order).cast(0 * directions, directions)
        assert np.isnan(distance[0, 0]) and distance[0, 1] == 1.0


def test_cast_on_nothing_meets_nothing():
    """No segments at all."""
    directions = fan(0)[None]
    for order in ({"centres": CENTRE}, {"direction": np.array((0.0, 1.0))}, {}):
        caster = RayCaster(np.empty(0, int), np.empty((0, 2, 2)), 1, **order)
        assert np.isnan(caster.cast(0 * directions, directions)[0]).all()


def test_ray_a_hair_below_zero_stays_in_its_row():
    """An angle of minus 1e-17 is a whole turn by rounding, and minus 1e-16 is one where the row's number is added."""
    corners = [radius * np.array([(1, -1e-17), (0, 1), (-1, 0), (0, -1)]) for radius in np.arange(1.0, 9.0)]
    ends = np.concatenate([sides(c) for c in corners])
    for turn in (-1e-17, -3e-16, -0.0, 1e-17):
        directions = np.tile((1.0, turn), (8, 1, 1))
        caster = RayCaster(np.repeat(np.arange(8), 4), ends, 8, centres=np.zeros((8, 2)))
        distance, hit = caster.cast(0 * directions, directions)
        assert_allclose(distance[:, 0], np.arange(1.0, 9.0), rtol=1e-12)
        assert_array_equal(hit[:, 0] // 4, np.arange(8))


def test_segments_that_are_points_leave_a_curve_clean():
    """A plane through corners of the mesh cuts some faces in a point: no second curve, and the same hits."""
    corners, rays = polygon(0), fan(1)[None]
    points = np.stack((corners, corners), axis=1)
    plain, dotted = (
        RayCaster(np.zeros(len(ends), np.int64), ends, 1, centres=CENTRE)
        for ends in (sides(corners), np.concatenate((sides(corners), points)))
    )
    assert dotted.clean.all() and not dotted.followed.any()
    for ours, theirs in zip(dotted.cast(0 * rays, rays), plain.cast(0 * rays, rays)):
        assert_array_equal(ours, theirs)
