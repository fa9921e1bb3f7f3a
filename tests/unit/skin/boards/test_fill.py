"""Boards in flat regions: they do not protrude, all are there, and brute force gives no better result."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.skin.boards.fill import TOUCH_TOLERANCE, fill
from skin_calib_addon.skin.boards.region import Region
from skin_calib_addon.skin.lattice import HexLattice
from tests.examples import examples, slow
from tests.oracles import all_offsets, boards_inside, edges_of, is_inside, most_boards, points_on
from tests.unit.skin.boards.test_region import random_loops, turned

seeds = st.integers(0, 2**32 - 1)
SIDE = 0.0163
BOARDS = HexLattice(SIDE, 0.02775 - np.sqrt(3) * SIDE)  # those of the thesis: trimmed, with a negative gap
TIGHT = HexLattice(SIDE, 0.0)
LATTICES = {"boards": BOARDS, "tight": TIGHT}
SMALL = HexLattice(0.01, 0.001)
DEGREES = np.deg2rad(np.arange(60))


def rectangle(width=0.2542, height=0.1305):
    """Return a loop about zero."""
    return np.array(((-1, -1), (1, -1), (1, 1), (-1, 1))) * (width / 2, height / 2)


def ring(radius, x=0.0, y=0.0, count=8):
    """Return a loop of many points about (x, y)."""
    angle = 2 * np.pi * np.arange(count) / count
    return radius * np.column_stack((np.cos(angle), np.sin(angle))) + (x, y)


def sole(count=32, waist=0.45):
    """Return the outline of a foot, which is narrower in its middle by the fraction ``waist``."""
    angle = 2 * np.pi * (np.arange(count) + 0.3) / count
    x, y = 0.127 * np.cos(angle), 0.06 * np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** 0.7
    return np.column_stack((x, y * (1 - waist * np.exp(-(((x + 0.02) / 0.05) ** 2)))))


REGIONS = {
    "rectangle": (rectangle(),),
    "oval": (sole(waist=0),),
    "sole": (sole(),),
    "corner": (np.array(((0, 0), (0.2, 0), (0.2, 0.09), (0.1, 0.09), (0.1, 0.18), (0, 0.18))),),
    "screws": (rectangle(), *(ring(0.004, x, y) for x in (-0.09, 0.09) for y in (-0.04, 0.04)), ring(0.004)),
    "islands": (rectangle(0.11, 0.12), ring(0.06, 0.14, 0.01, 24)),
}


@cache
def filled(name, lattice):
    """Return a region by its name, and its boards."""
    region = Region(REGIONS[name])
    return region, fill(region, lattice)


def outline_is_inside(outline, loops):
    """Return whether points along the outline, a nanometre inside of it, are in the region, and no loop enters the
    outline.
    """
    middle = outline.mean(axis=0)
    inner = middle + (1 - TOUCH_TOLERANCE / SIDE) * (points_on(outline, 12) - middle)
    entered = [np.linalg.norm(points_on(loop, 200) - middle, axis=1).min() < 0.8 * SIDE for loop in loops]
    return all(is_inside(point, loops) for point in inner) and not any(entered)


@pytest.mark.parametrize(
    ("name", "lattice"),
    [
        ("rectangle", "boards"),
        ("corner", "boards"),
        ("corner", "tight"),
        *(
            slow(*case)
            for case in [("rectangle", "tight"), *((name, "boards") for name in ("oval", "sole", "screws", "islands"))]
        ),
    ],
)
def test_brute_force_gives_no_more_boards(name, lattice):
    """All offsets in steps of a millimetre and all angles in degrees, with every board cut with every edge, give no
    more.
    """
    region, placement = filled(name, LATTICES[lattice])
    most = most_boards(edges_of(region.loops), placement.lattice, all_offsets(placement.lattice, 1e-3), DEGREES)
    assert len(placement.cells) - 4 <= most <= len(placement.cells)


@pytest.mark.parametrize("name", REGIONS)
def test_boards_inside_are_those_listed(name):
    """Every board is inside point by point, and no other cell of the lattice is; they are sorted by r, then q."""
    region, placement = filled(name, TIGHT)
    assert all(outline_is_inside(outline, region.loops) for outline in placement.corners)
    r, q = (a.ravel() - 30 for a in np.indices((61, 61)))
    cells = np.column_stack((q, r))
    centres = placement.offset + turned(TIGHT.centres(cells), placement.angle)
    fits = boards_inside(centres, turned(TIGHT.corners, placement.angle), edges_of(region.loops))
    assert cells[fits].tolist() == placement.cells.tolist()
    assert_allclose(placement.centres, centres[fits], atol=1e-15)


@pytest.mark.parametrize("name", REGIONS)
def test_root_is_the_board_in_the_middle(name):
    """Cell (0, 0) has a board, and no board is nearer to the centroid."""
    region, placement = filled(name, BOARDS)
    away = np.linalg.norm(placement.centres - region.centroid, axis=1)
    assert away[placement.cells.tolist().index([0, 0])] < away.min() + 2e-6
    assert -np.pi / 6 < placement.angle < np.pi / 6 + 1e-5


@pytest.mark.parametrize(
    ("width", "height", "rows"),
    [(9, 8, [9, 8, 9, 8, 9]), (8.5, 8, [8, 8, 8, 8, 8]), (1, 2, [1]), (2, 3.5, [2, 1])],
)
def test_boards_that_fill_a_rectangle_to_its_edges_are_found(width, height, rows):
    """The boards touch all four sides, so that no step of a search meets the single pose; they do not fit in a
    micrometre less.
    """
    side = np.sqrt(2 * 691e-6 / (3 * np.sqrt(3)))
    lattice, size = HexLattice(side, 0.0), (np.sqrt(3) * side * width, side * height)
    region = Region((turned(rectangle(*size), 0.2),))
    placement = fill(region, lattice)
    assert len(placement.cells) == sum(rows)
    assert_allclose(
        region.clearances(placement.centres, placement.corners[0] - placement.centres[0]).min(), 0, atol=TOUCH_TOLERANCE
    )
    counts = [np.unique(turned(placement.centres, k)[:, 1].round(7), return_counts=True)[1] for k in (-0.2, 0.2)]
    assert rows in [c.tolist() for c in counts] or rows[::-1] in [c.tolist() for c in counts]
    if sum(rows) > 3:
        assert len(fill(Region((turned(rectangle(*size) * (1 - 1e-5), 0.2),)), lattice).cells) < sum(rows)


@pytest.mark.parametrize("size", [(0.2542, 0.1305), (0.2, 0.034), (0.05, 0.034)])
def test_boards_are_in_the_middle(size):
    """The free lengths at both sides of a rectangle are equal, also along it, where they are longer."""
    low, high = (
        getattr(fill(Region((rectangle(*size),)), TIGHT).corners, direction)(axis=(0, 1))
        for direction in ("min", "max")
    )
    assert_allclose(low, -high, atol=1e-6)


def test_smallest_rotation_of_equal_poses_is_taken():
    """A board in a ring of twelve points has the same clearance every 30 degrees; the smallest rotation is taken."""
    assert_allclose(fill(Region((turned(ring(0.025, count=12), 0.1),)), TIGHT).angle, 0.1, atol=1e-6)


@examples(4)
@given(seed=seeds, angle=st.floats(-4, 4), x=st.floats(-1, 1), y=st.floats(-1, 1))
def test_boards_move_with_the_region(seed, angle, x, y):
    """The number of boards and the clearance are the same after a rigid motion of the region."""
    loops = random_loops(seed)
    counts, clearances = zip(
        *(count_and_clearance(l) for l in (loops, [turned(loop, angle) + (x, y) for loop in loops]))
    )
    assert counts[0] == counts[1]
    assert_allclose(*clearances, atol=2e-6)


def count_and_clearance(loops, lattice=SMALL):
    """Return the number of boards that fit, and the smallest clearance; zero without a board."""
    region = Region(tuple(loops))
    try:
        placement = fill(region, lattice)
    except InvalidPlan:
        return 0, 0.0
    return len(placement.cells), region.clearances(placement.centres, placement.corners[0] - placement.centres[0]).min()


def test_boards_of_an_asymmetric_region_move_with_it():
    """With a single best placement, each board moves with the region, at any rotation."""
    loop = np.array(((0, 0), (0.13, 0.01), (0.11, 0.07), (0.03, 0.09)))
    here = fill(Region((loop,)), SMALL)
    for angle in (0.4, 2.0, -1.1):
        there = fill(Region((turned(loop, angle) + (0.3, -0.2),)), SMALL)
        expected = turned(here.centres, angle) + (0.3, -0.2)
        apart = np.linalg.norm(there.centres[:, None] - expected, axis=2).min(axis=1)
        assert len(there.cells) == len(here.cells) and apart.max() < 2e-6


@pytest.mark.slow
@examples(3)
@given(seed=seeds, growth=st.floats(1, 1.2))
def test_larger_region_never_has_fewer_boards(seed, growth):
    """A star that grows from its middle keeps every board; so does one with closed holes."""
    star, *holes = random_loops(seed)
    inside = [hole for hole in holes if all(is_inside(point, [star]) for point in points_on(hole, 20))][:1]
    counts = [count_and_clearance(loops)[0] for loops in ((star, *inside), (star,), (growth * star,))]
    assert counts == sorted(counts)


@examples(4)
@given(seed=seeds, angle=st.floats(-2, 2))
def test_given_angle_is_kept_and_brute_force_gives_no_more(seed, angle):
    """Only the offset is searched."""
    loops = (random_loops(seed)[0],)
    most = most_boards(edges_of(loops), SMALL, all_offsets(SMALL, 5e-4), [angle])
    if most:
        placement = fill(Region(loops), SMALL, angle=angle)
        assert placement.angle == angle and len(placement.cells) >= most


@examples(4)
@given(seed=seeds)
def test_given_offset_is_kept_and_brute_force_gives_no_more(seed):
    """Only the angle is searched; cell (0, 0) is at the offset, with or without a board."""
    loops = (random_loops(seed)[0],)
    offset = np.random.default_rng(seed).uniform(-0.03, 0.03, 2)
    middle = (loops[0].min(axis=0) + loops[0].max(axis=0)) / 2
    angles = np.deg2rad(np.arange(0, 60, 0.25))
    shifts = [turned((offset - middle)[None], -angle) for angle in angles]
    counts = [most_boards(edges_of(loops), SMALL, shift, [angle]) for shift, angle in zip(shifts, angles)]
    if max(counts):
        placement = fill(Region(loops), SMALL, offset=offset)
        assert placement.offset.tobytes() == offset.tobytes() and len(placement.cells) >= max(counts)


@given(seed=seeds, angle=st.floats(-2, 2), q=st.integers(-3, 3), r=st.integers(-3, 3), sixths=st.integers(-6, 6))
def test_given_offset_and_angle_place_all_that_fit(seed, angle, q, r, sixths):
    """There is no search; a step of the lattice and rotations by 60 degrees place the same boards."""
    region, rng = Region(random_loops(seed)), np.random.default_rng(seed)
    offset = rng.uniform(-0.03, 0.03, 2)
    far = turned(SMALL.centres(np.array([(x, y) for x in range(-12, 13) for y in range(-12, 13)])), angle) + offset
    fits = far[boards_inside(far, turned(SMALL.corners, angle), edges_of(region.loops))]
    if not len(fits):
        with pytest.raises(InvalidPlan, match="no board with sides of 10 mm fits completely in the region"):
            fill(region, SMALL, offset, angle)
        return
    same = offset + turned(SMALL.centres(np.array([(q, r)])), angle)[0]
    for placement in (fill(region, SMALL, offset, angle), fill(region, SMALL, same, angle + sixths * np.pi / 3)):
        order = [np.lexsort(points.round(6).T) for points in (placement.centres, fits)]
        assert_allclose(placement.centres[order[0]], fits[order[1]], atol=1e-9)


@pytest.mark.parametrize(
    ("loop", "given", "message"),
    [
        (
            rectangle(0.03, 0.03),
            {},
            "no board with sides of 16.3 mm fits completely in the region, which is 30.0 x 30.0 mm",
        ),
        (np.array(((0, 0), (0.1, 0), (0.04, 0))), {}, "no board .* 100.0 x 0.0 mm over all; extend it"),
        (rectangle(0.04, 0.04), {"offset": (0.02, 0), "angle": 0.0}, "leave offset and angle free"),
        (rectangle(), {"offset": (0, np.nan)}, "invalid offset .*nan.* or angle None of a lattice"),
        (rectangle(), {"angle": np.inf}, "invalid offset None or angle inf of a lattice"),
        (rectangle(), {"offset": (0, 0, 0)}, "invalid offset"),
        (rectangle(254.2, 130.5), {}, "extends 143 m from the middle of the lattice, too far for .* pitch of 28.2"),
        (rectangle(), {"offset": (5, 0)}, r"extends 5.13 m from the middle of the lattice.*an offset in it"),
    ],
)
def test_what_cannot_be_filled_is_refused(loop, given, message):
    """The message for a region that is too small, flat, in millimetres or far away says what to do."""
    with pytest.raises(InvalidPlan, match=message):
        fill(Region((loop,)), TIGHT, **given)
