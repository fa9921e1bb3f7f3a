"""Convex polygons: decisions are exact; lengths are compared with fractions."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.runtime.hull import grid_step
from skin_calib_addon.runtime.polygon import Polygon, convex_hull, from_grid, turn
from tests import oracles
from tests.polygons import THIN, polygons, size_of, unit_floats
from tests.unit.runtime.test_hull import clouds, on_grid

SQUARE = convex_hull([(0, 0), (2, 0), (2, 2), (0, 2)])
SIZES = [1.0, 1e300, 1e-300, 1e-310]


def assert_convex(polygon):
    """Check with fractions that the polygon turns left at each corner and goes around once."""
    corners = oracles.exact(polygon.corners)
    assert set(corners) == set(oracles.hull_corners(corners)) and len(set(corners)) == len(corners)
    for i, corner in enumerate(corners if len(corners) > 2 else []):
        assert oracles.turn(corners[i - 2], corners[i - 1], corner) > 0


@given(clouds())
def test_convex_hull_is_that_of_the_grid(points):
    """All bits are equal; the kind follows from the number of corners."""
    polygon = convex_hull(points)
    step = grid_step(np.abs(points).max(initial=0.0))
    expected = oracles.hull_corners(on_grid(points, step))
    assert oracles.exact(polygon.corners) == [(Fraction(step) * x, Fraction(step) * y) for x, y in expected]
    assert polygon.kind == {0: "empty", 1: "point", 2: "segment"}.get(len(expected), "area")
    assert polygon.corners.shape == (len(expected), 2) and polygon.corners.dtype == float


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_hull_of_points_that_are_not_finite_is_refused(wrong):
    """NaN and infinity raise an error."""
    with pytest.raises(ValueError, match="must be finite"):
        convex_hull([(0, 0), (1, wrong), (1, 1)])


numbers = st.one_of(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from([0.0, 1.0, 2.0**-60, 1e-320]))
points_anywhere = st.tuples(numbers, numbers)


@given(points_anywhere, points_anywhere, points_anywhere, st.booleans(), unit_floats)
def test_turn_has_the_right_sign(a, b, c, on_line, t):
    """This is for any floats, also those that overflow or underflow, and those near the line of the others."""
    if on_line:
        c = (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]))
        assume(all(map(math.isfinite, c)))
    exactly = oracles.turn(*oracles.exact((a, b, c)))
    assert np.sign(turn(a, b, c)) == (exactly > 0) - (exactly < 0)


@given(polygons())
def test_area_and_centroid_are_those_of_fractions(polygon):
    """They agree to nine digits, also for polygons so thin that rounded cross products are noise."""
    corners = oracles.exact(polygon.corners)
    assert polygon.area == pytest.approx(float(oracles.fraction_area(corners)), rel=1e-9, abs=0)
    middle = [float(c) for c in oracles.fraction_centroid(corners)]
    extent = np.ptp(polygon.corners, axis=0).max()
    assert_allclose(polygon.centroid, middle, rtol=0, atol=1e-9 * extent + 4e-16 * size_of(polygon))


def test_area_of_a_sliver_is_exact():
    """The cross product of three lattice points is 1; rounded, it would be zero or a hundred."""
    step = 2.0**-31
    sliver = from_grid(oracles.hull_corners(THIN), step)
    assert sliver.kind == "area" and sliver.area == 0.5 * step**2
    assert_allclose(sliver.centroid, sliver.corners.mean(axis=0), rtol=1e-15)
    assert all(sliver.contains(corner) for corner in sliver.corners)


def test_corners_on_a_line_have_no_area():
    """A polygon with corners on a line has the mean of its corners as centroid."""
    flat = Polygon(np.array([(1.0, 1.0), (2.0, 2.0), (4.5, 4.5), (2.5, 2.5)]))
    assert flat.area == 0 and flat.centroid.tolist() == [2.5, 2.5]


@pytest.mark.parametrize("size", SIZES)
def test_polygons_work_at_any_size(size):
    """This includes sizes whose squares overflow or underflow."""
    polygon = Polygon(size * SQUARE.corners)
    assert polygon.area == 4 * size * size
    assert_allclose(polygon.centroid / size, (1, 1), rtol=1e-12)
    assert polygon.contains((size, 2 * size)) and not polygon.contains((size, 2.1 * size))
    assert_allclose(polygon.closest((3 * size, 4 * size)) / size, (2, 2), rtol=1e-12)
    assert polygon.margin((0.5 * size, size)) / size == pytest.approx(0.5, rel=1e-12)
    assert polygon.margin((5 * size, 6 * size)) / size == pytest.approx(-5, rel=1e-12)
    assert_allclose(polygon.half_planes[1] / size, (0, 2, 2, 0), rtol=1e-12)
    assert_allclose(polygon.inset(0.5 * size).corners / size, 0.5 + SQUARE.corners / 2, rtol=1e-12)


@given(clouds())
def test_bounds_are_those_of_the_points(points):
    """They are those of the points on the grid; None for an empty polygon."""
    polygon = convex_hull(points)
    if len(points) == 0:
        assert polygon.bounds is None
        return
    step = grid_step(np.abs(points).max())
    low, high = polygon.bounds
    whole = on_grid(points, step)
    assert [Fraction(c) / Fraction(step) for c in low] == [min(c) for c in zip(*whole)]
    assert [Fraction(c) / Fraction(step) for c in high] == [max(c) for c in zip(*whole)]


@given(polygons())
def test_half_planes_hold_the_polygon(polygon):
    """Normals have length one; each corner is on two half-planes and in all."""
    normals, offsets = polygon.half_planes
    assert_allclose(np.hypot(*normals.T), 1, rtol=1e-15)
    heights = polygon.corners @ normals.T - offsets
    off = 4e-16 * size_of(polygon)
    assert heights.max() <= 4 * off
    assert np.abs(np.diagonal(heights)).max() <= 4 * off
    assert np.abs(np.diagonal(np.roll(heights, -1, axis=0))).max() <= 4 * off


@st.composite
def polygons_and_points(draw):
    """Draw a polygon of any kind and a point: near, far, a corner, or on an edge up to rounding."""
    polygon = draw(polygons()) if draw(st.booleans()) else convex_hull(draw(clouds()))
    corners = polygon.corners
    if not len(corners):
        return polygon, (draw(unit_floats), draw(unit_floats))
    i, t = draw(st.integers(0, len(corners) - 1)), draw(st.one_of(st.just(0.0), unit_floats))
    on_edge = corners[i] + t * (corners[i - 1] - corners[i])
    distance = draw(st.sampled_from([0.0, 0.0, 1e-12, 1.0, 10.0])) * np.ptp(corners, axis=0).max()
    return polygon, tuple((on_edge + distance * np.array((draw(unit_floats), draw(unit_floats)))).tolist())


@given(polygons_and_points())
def test_contains_is_exact(case):
    """It agrees with fractions for corners, points on edges, and points one bit next to them."""
    polygon, point = case
    corners = oracles.exact(polygon.corners)
    assert polygon.contains(point) == (bool(corners) and oracles.is_in_convex(*oracles.exact([point]), corners))
    assert all(polygon.contains(corner) for corner in polygon.corners)


@given(polygons_and_points())
def test_closest_and_margin_are_those_of_fractions(case):
    """It is the nearest point of all edges, or the point itself; the sign of the margin agrees with ``contains``."""
    polygon, point = case
    corners = oracles.exact(polygon.corners)
    if not corners:
        assert polygon.closest(point) is None and polygon.margin(point) == -math.inf
        return
    (exact_point,) = oracles.exact([point])
    near = oracles.nearest_in_convex(exact_point, corners)
    off = 1e-15 * max(size_of(polygon), *map(abs, point)) + 1e-322
    assert_allclose(polygon.closest(point), [float(c) for c in near], rtol=0, atol=4 * off)
    scale = Fraction(max(size_of(polygon), 5e-324))  # for squares that floats hold
    if polygon.contains(point):
        assert (polygon.closest(point) == point).all() and polygon.margin(point) >= 0
        depth = Fraction(0)
        if len(corners) > 2:
            lines = oracles.moved_lines(corners, [0] * len(corners))
            depth = min(
                (dx * (exact_point[1] - y) - dy * (exact_point[0] - x)) / oracles.fraction_root(dx * dx + dy * dy)
                for (x, y), (dx, dy) in lines
            )
        assert abs(Fraction(polygon.margin(point)) - depth) <= 4 * off
    else:
        gap = math.hypot(*(float((a - b) / scale) for a, b in zip(near, exact_point)))
        assert polygon.margin(point) <= 0
        assert -polygon.margin(point) / float(scale) == pytest.approx(gap, rel=1e-12, abs=8 * off / float(scale))


@pytest.mark.parametrize("t", [-0.3, 0.0, 0.4, 1.0, 1.3])
def test_closest_distinguishes_corners_at_equal_distances(t):
    """For two corners a few nanometres from each other, the rounded distances are equal."""
    first, second = np.array((1.0, 1.0)), np.array((1 - 2.0**-27, 1 + 2.0**-27))
    polygon = convex_hull([(-1, -1), first, second])
    foot = first + t * (second - first)
    clamped = first + min(max(t, 0.0), 1.0) * (second - first)
    assert_allclose(polygon.closest(foot + 1.0), clamped, rtol=0, atol=1e-15)


@pytest.mark.parametrize("point", [(np.nan, 0.0), (0.0, np.inf), (-np.inf, np.nan)])
@pytest.mark.parametrize("polygon", [SQUARE, convex_hull([(0, 0), (1, 1)]), convex_hull([(0, 0)]), convex_hull([])])
def test_point_that_is_not_finite_is_outside(point, polygon):
    """A ZMP of NaN is not in the polygon, and its margin is -inf."""
    assert not polygon.contains(point) and polygon.closest(point) is None and polygon.margin(point) == -math.inf


def test_degenerate_kinds_have_all_answers():
    """All results of an empty polygon, a point and a segment are defined; their area is zero."""
    empty, point, segment = (convex_hull(p) for p in ([], [(1, 2)] * 3, [(0, 0), (1, 1), (4, 4), (3, 3)]))
    assert [p.kind for p in (empty, point, segment)] == ["empty", "point", "segment"]
    assert [p.area for p in (empty, point, segment)] == [0, 0, 0]
    assert empty.centroid is None and empty.closest((0, 0)) is None and not empty.contains((0, 0))
    assert point.centroid.tolist() == [1, 2] and segment.centroid.tolist() == [2, 2]
    assert point.closest((5, 2)).tolist() == [1, 2] and point.margin((5, 2)) == -4 and point.margin((1, 2)) == 0
    assert_allclose(segment.closest((0, 2)), (1, 1), rtol=1e-15)
    assert segment.margin((4, 7)) == -3
    assert segment.contains((2, 2)) and not segment.contains((5, 5)) and segment.margin((2, 2)) == 0
    for polygon in (empty, point, segment):
        normals, offsets = polygon.half_planes
        assert normals.shape == (0, 2) and offsets.shape == (0,)
        assert polygon.inset(0.0) is polygon and polygon.inset(0.1).kind == "empty"


def assert_moved_in(polygon, distances, result):
    """Check with fractions that the result is between those of slightly larger and slightly smaller distances."""
    corners = oracles.exact(polygon.corners)
    slack = Fraction(4e-15 * size_of(polygon))
    lines = oracles.moved_lines(corners, [Fraction(d) - slack for d in distances])
    for x, y in oracles.exact(result.corners):
        for start, (dx, dy) in lines:
            assert dx * (y - start[1]) - dy * (x - start[0]) >= 0
    inner = oracles.clipped(corners, oracles.moved_lines(corners, [Fraction(d) + slack for d in distances]))
    if inner:
        held = oracles.exact(result.corners)
        assert held
        for corner in inner:
            foot = oracles.nearest_in_convex(corner, held)
            assert (foot[0] - corner[0]) ** 2 + (foot[1] - corner[1]) ** 2 <= slack**2
    assert_convex(result)


@given(polygons(), st.data())
def test_moved_in_is_what_fractions_leave(polygon, data):
    """Each edge has its own distance: zero, until the edge vanishes, or until the polygon is empty."""
    extent = np.ptp(polygon.corners, axis=0).min() * data.draw(st.sampled_from([1e-6, 0.1, 0.5, 1.0, 2.0]))
    fractions = st.one_of(st.just(0.0), st.floats(0, 1))
    count = len(polygon.corners)
    distances = [extent * t for t in data.draw(st.lists(fractions, min_size=count, max_size=count))]
    assert_moved_in(polygon, distances, polygon.moved_in(distances))


def test_inset_of_a_square_is_known():
    """The result is a smaller square, then its centre, then empty; that of a rectangle is a segment."""
    assert_allclose(SQUARE.inset(0.25).corners, [(0.25, 0.25), (1.75, 0.25), (1.75, 1.75), (0.25, 1.75)], rtol=1e-15)
    assert SQUARE.inset(1.0).corners.tolist() == [[1, 1]]
    assert convex_hull([(0, 0), (4, 0), (4, 2), (0, 2)]).inset(1.0).corners.tolist() == [[1, 1], [3, 1]]
    assert SQUARE.inset(0.0) is SQUARE
    for distance in (1.0000001, 1e300, math.inf):
        assert SQUARE.inset(distance).kind == "empty" and SQUARE.inset(distance).corners.shape == (0, 2)


def test_edges_that_hardly_turn_are_moved_as_well():
    """The cross product of two edges is 1, while rounding errors are 128; the result is not empty."""
    far = (433494437, 0)
    polygon = from_grid(oracles.hull_corners([*THIN, far]), 2.0**-31)
    assert len(polygon.corners) == 4
    for distances in ([0.0] * 4, [1e-3] * 4, [0.0, 1e-3, 0.0, 1e-3]):
        result = polygon.moved_in(distances)
        assert result.area > 0.9 * polygon.area
        assert_moved_in(polygon, distances, result)


@pytest.mark.parametrize(
    ("corners", "distances"),
    [
        ([(-14, 1), (15, -17), (19, -6), (20, 13)], [0.5, 1e-16, 0.5, 1e-16]),
        ([(-17, -15), (17, 19), (-14, 13)], [0.0, 1e-17, 0.5]),
    ],
)
def test_edges_that_hardly_move_let_the_others_move(corners, distances):
    """The distance is less than rounding: only one end of the edge seems to be removed."""
    polygon = Polygon(np.array(corners, float))
    assert_moved_in(polygon, distances, polygon.moved_in(distances))


@pytest.mark.parametrize("distance", [-0.1, math.nan])
def test_polygons_move_in_only(distance):
    """A negative distance or NaN raises an error."""
    with pytest.raises(ValueError, match="must be 0 or more"):
        SQUARE.inset(distance)
    with pytest.raises(ValueError, match="4 edges need as many distances"):
        SQUARE.moved_in([0.0, 0.0, 0.0, distance])


@pytest.mark.parametrize("points", [np.zeros((2, 3)), np.zeros(4), np.zeros((2, 2, 2))])
def test_points_that_are_not_of_a_plane_are_refused(points):
    """Points with three coordinates raise an error."""
    with pytest.raises(ValueError, match=r"points of a plane must have shape \(n, 2\), not "):
        convex_hull(points)


def test_corners_cannot_be_changed():
    """Results that are kept would be wrong."""
    with pytest.raises(ValueError, match="read-only"):
        convex_hull([(0, 0), (1, 0), (0, 1)]).corners[0] = 5


@pytest.mark.parametrize("kind", ["random", "lattice", "round", "thin"])
def test_erosion_keeps_the_points_at_which_the_cell_is_inside(kind):
    """With its centre at a corner the reflected cell touches an edge, and is inside; the area is that of the cut."""
    rng, areas = np.random.default_rng(1), []
    for _ in range(100):
        angle, points = rng.uniform(0, 2 * np.pi, 24), rng.normal(size=(24, 2))
        if kind == "lattice":
            points = rng.integers(0, 8, (24, 2)) * 0.01
        elif kind == "round":
            points = np.column_stack((np.cos(angle), np.sin(angle)))
        elif kind == "thin":
            points *= (1.0, 1e-7)
        hull = convex_hull(points)
        size = float(np.ptp(hull.corners, axis=0).max())
        cell = rng.normal(size=(5, 2)) * np.ptp(hull.corners, axis=0) * 10.0 ** rng.uniform(-3, -0.5)
        normals, offsets = hull.half_planes
        extents = np.maximum((-normals @ cell.T).max(axis=1), 0.0)
        eroded, cut = hull.eroded(cell), hull.moved_in(extents)
        depths = offsets - extents - eroded.corners @ normals.T
        assert np.abs(depths.min(axis=1)).max(initial=0.0) < 1e-12 * size
        assert abs(eroded.area - cut.area) < 1e-11 * hull.area
        areas.append(eroded.area)
    assert 0 in areas and max(areas) > 0


@pytest.mark.parametrize("start", range(8))
def test_erosion_of_short_edges_leaves_the_diamond(start):
    """The edges along the axes vanish, whichever is first: |x| + |y| <= 10.5 less 2 is what a square leaves."""
    corners = np.array([(10, -0.5), (10, 0.5), (0.5, 10), (-0.5, 10), (-10, 0.5), (-10, -0.5), (-0.5, -10), (0.5, -10)])
    square = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
    eroded = Polygon(np.roll(corners, start, axis=0)).eroded(square).corners
    diamond = np.array([(-8.5, 0.0), (0.0, -8.5), (8.5, 0.0), (0.0, 8.5)])
    first = np.lexsort((eroded[:, 1], eroded[:, 0]))[0]
    assert_allclose(np.roll(eroded, -first, axis=0), diamond, atol=1e-12)
