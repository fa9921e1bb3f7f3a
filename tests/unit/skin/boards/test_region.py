"""Flat regions: points inside, and clearances of boards."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.skin.boards.region import Region
from skin_calib_addon.skin.lattice import HexLattice
from tests.examples import examples
from tests.oracles import clearance_of, is_inside

seeds = st.integers(0, 2**32 - 1)
BOARD = HexLattice(0.0163, 0.0).corners
SQUARE = 0.1 * np.array(((0, 0), (1, 0), (1, 1), (0, 1.0)))


def random_loops(seed):
    """Return a star with three to nine points, and up to two loops near it; they may cross."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 10)))
    star = rng.uniform(0.02, 0.1, (len(angle), 1)) * np.column_stack((np.cos(angle), np.sin(angle)))
    return (star, *(rng.uniform(-0.06, 0.06, (rng.integers(3, 6), 2)) for _ in range(rng.integers(0, 3))))


def turned(points, angle):
    """Return points rotated about zero."""
    return points @ np.array(((np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))))


@given(seed=seeds)
def test_region_follows_the_parity_rule(seed):
    """Outlines, holes, islands and crossing loops of either orientation are counted edge by edge."""
    loops = random_loops(seed)
    points = np.random.default_rng(seed).uniform(-0.1, 0.1, (50, 2))
    region = Region(tuple(loop[:: (-1) ** k] for k, loop in enumerate(loops)))
    assert region.contains(points).tolist() == [is_inside(point, loops) for point in points]


@given(seed=seeds)
def test_region_does_not_depend_on_the_form_of_its_loops(seed):
    """Doubled points, points on an edge, another start and a bridge give the same inside and the same clearances."""
    loops, rng = random_loops(seed), np.random.default_rng(seed)
    a, b = loops[0][0], loops[0][1]
    bridge = np.concatenate((loops[0][:1], rng.uniform(-0.1, 0.1, (1, 2)), loops[0][:1]))
    first = np.concatenate((bridge, [a, a, (a + b) / 2], loops[0][1:]))
    centres = rng.uniform(-0.1, 0.1, (30, 2))
    plain, other = Region(loops), Region((*loops[1:], np.roll(first, 3, axis=0), np.zeros((0, 2)), np.ones((1, 2))))
    assert other.contains(centres).tolist() == plain.contains(centres).tolist()
    assert_allclose(other.clearances(centres, BOARD), plain.clearances(centres, BOARD), atol=1e-11)


def test_triangles_of_a_flat_mesh_are_a_region():
    """Common edges of two triangles have no effect: the outline and a hole remain."""
    hole = 0.05 + turned(0.01 * SQUARE / 0.1 - 0.005, 0.3)
    ring = [
        np.array(triangle)
        for k in range(4)
        for a, b, c, d in [(SQUARE[k - 1], SQUARE[k], hole[k], hole[k - 1])]
        for triangle in ((a, b, c), (a, c, d))
    ]
    assert_allclose(Region(tuple(ring)).edges, Region((SQUARE, hole)).edges, atol=1e-12)


@examples(25)
@given(seed=seeds)
def test_clearances_are_those_between_the_outlines(seed):
    """Clearances agree with all corners and with points along the edges, which are up to half a step from the deepest
    one.
    """
    loops, rng = random_loops(seed), np.random.default_rng(seed)
    region, outline = Region(loops), turned(BOARD, rng.uniform(0, 1))
    centres = rng.uniform(-0.08, 0.08, (3, 2))
    step = np.linalg.norm(np.diff(region.edges, axis=1), axis=2).max() / 30
    for centre, clearance in zip(centres, region.clearances(centres, outline)):
        slow = clearance_of(centre + outline, loops, 30)
        assert slow - 0.5 * step - 1e-12 < clearance < slow + 1e-12


@given(seed=seeds)
def test_clearances_change_by_no_more_than_the_move(seed):
    """Clearances are continuous from inside to outside and over holes."""
    rng = np.random.default_rng(seed)
    region, start = Region(random_loops(seed)), rng.uniform(-0.08, 0.08, (1, 2))
    path = start + np.arange(40)[:, None] * turned(np.array((0.001, 0)), rng.uniform(0, 7))
    assert np.abs(np.diff(region.clearances(path, BOARD))).max() < 0.001 + 1e-12


@pytest.mark.parametrize(
    ("centre", "clearance"),
    [
        ((0.05, 0.05), 0.05 - 0.0163),  # a corner is nearest to the upper and the lower side
        ((0.05, 0.0163), 0.0),
        ((0.05, 0.0163 - 0.002), -0.002),
        ((0.05, -1.0), -1.0163),
    ],
)
def test_clearance_of_a_board_in_a_square(centre, clearance):
    """Inside it is the distance of the outlines, outside the protrusion of the board."""
    assert_allclose(Region((SQUARE,)).clearances(np.array([centre]), BOARD), clearance, atol=1e-15)


@pytest.mark.parametrize(
    ("thorn", "clearance"),
    [
        ([(0.049, 0), (0.05, 0.04), (0.051, 0)], 0.01 - np.sqrt(0.75) * 0.0163),
        ([(0, 0.0499), (0.1, 0.0499), (0.1, 0.0501), (0, 0.0501)], 0.0001 - np.sqrt(0.75) * 0.0163),
    ],
)
def test_clearance_of_a_board_with_a_penetration(thorn, clearance):
    """A thorn, and a slit without a corner of either in the other: the clearance is the depth of the penetration."""
    region = Region((SQUARE, np.array(thorn)))
    assert_allclose(region.clearances(np.array([(0.05, 0.05)]), turned(BOARD, np.pi / 6)), clearance, atol=1e-15)


def test_centroid_and_reflex_points_of_a_region():
    """The centroid of a square with a square hole in one corner moves to the other side."""
    region = Region((SQUARE, (SQUARE / 5)[::-1] + 0.02))
    assert_allclose(region.centroid, (0.05 * 100 - 0.03 * 4) / 96 * np.ones(2), rtol=1e-12)
    assert sorted(map(tuple, region.points[region.is_reflex].round(6))) == [
        (0.02, 0.02),
        (0.02, 0.04),
        (0.04, 0.02),
        (0.04, 0.04),
    ]


@pytest.mark.parametrize(
    ("loops", "message"),
    [
        ((), "the region is empty"),
        ((np.zeros((5, 2)),), "the region is empty"),
        ((SQUARE, SQUARE), "the region is empty"),
        ((SQUARE[:2],), "the region is empty"),
        ((SQUARE, np.zeros((4, 3))), r"loop 1 of the region has shape \(4, 3\)"),
        ((SQUARE + (0, np.nan),), "loop 0 of the region has a number that is not finite"),
    ],
)
def test_region_without_area_is_refused(loops, message):
    """The message for an empty or invalid loop says which loop."""
    with pytest.raises(InvalidPlan, match=message):
        Region(loops)
