"""Simple shapes around and in convex polygons, compared with slow independent searches."""

from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import example, given
from numpy.testing import assert_allclose
from scipy.optimize import minimize

from skin_calib_addon.runtime import Polygon, convex_hull
from skin_calib_addon.runtime.polygon import from_grid
from skin_control.inscribed import (
    largest_box,
    largest_parallelogram,
    largest_triangle,
    smallest_parallelogram,
    smallest_rectangle,
)
from tests import oracles
from tests.examples import examples
from tests.polygons import THIN as SLIVER
from tests.polygons import polygons, round_polygons, size_of

ROUND = (smallest_rectangle, smallest_parallelogram)
WITHIN = (largest_triangle, largest_box, largest_parallelogram)
SQUARE = convex_hull([(1, 1), (3, 1), (3, 3), (1, 3)])
DIAMOND = convex_hull([(1, 0), (0, 1), (-1, 0), (0, -1)])
TRIANGLE = convex_hull([(0, 0), (4, 0), (0, 3)])
HEXAGON = convex_hull([(np.cos(a), np.sin(a)) for a in np.arange(6) * np.pi / 3])


def rounding(polygon):
    """Return the area by which rounded coordinates can change a shape in or around a polygon."""
    return 1e-14 * size_of(polygon) * np.ptp(polygon.corners, axis=0).max()


def is_same_area(shape, area, polygon):
    """Return whether a shape has an area, to nine digits and the rounding of its coordinates."""
    return abs(shape.area - float(area)) <= 1e-9 * float(area) + rounding(polygon)


@pytest.mark.parametrize("function", ROUND + WITHIN)
@pytest.mark.parametrize("points", [[], [(1, 2)], [(1, 2), (3, 4)], [(0, 0), (1, 1), (2, 2)]])
def test_what_has_no_area_has_no_shapes(function, points):
    """An empty polygon, a point and a segment have no shapes."""
    assert function(convex_hull(points)) is None


AREAS = [  # of the square, the diamond, the triangle with sides 3, 4, 5, the hexagon with sides 1
    (smallest_rectangle, (4, 2, 12, 2 * 3**0.5)),
    (smallest_parallelogram, (4, 2, 12, 2 * 3**0.5)),
    (largest_triangle, (2, 1, 6, 0.75 * 3**0.5)),
    (largest_box, (4, 1, 3, 3**0.5)),
    (largest_parallelogram, (4, 2, 3, 3**0.5)),
]


@pytest.mark.parametrize(("function", "areas"), AREAS)
def test_known_shapes_have_known_answers(function, areas):
    """The shape of the square is the square; those of the triangle have half or twice its area."""
    for polygon, area in zip((SQUARE, DIAMOND, TRIANGLE, HEXAGON), areas):
        assert function(polygon).area == pytest.approx(area, rel=1e-9)


def test_rectangles_are_their_own_shapes():
    """The box is exact to the last bits, not only to the tolerance of the search.

    So is the parallelogram of a rotated one.
    """
    assert_allclose(largest_box(SQUARE).corners, SQUARE.corners, rtol=1e-15)
    turned = convex_hull(SQUARE.corners @ np.array([(np.cos(0.3), np.sin(0.3)), (-np.sin(0.3), np.cos(0.3))]))
    assert largest_parallelogram(turned).area == pytest.approx(turned.area, rel=1e-12)


@pytest.mark.parametrize("function", ROUND + WITHIN)
@given(polygon=polygons())
def test_shapes_are_polygons(function, polygon):
    """They are counter-clockwise, with three or four corners.

    Those inside are inside in every bit, the others up to rounding.
    """
    shape = function(polygon)
    assert isinstance(shape, Polygon) and shape.corners.shape == (3 if function is largest_triangle else 4, 2)
    assert shape.area > -rounding(polygon)
    if function in WITHIN:
        assert all(polygon.contains(corner) for corner in shape.corners)
        assert shape.area <= polygon.area * (1 + 1e-12)
    else:
        for a, b in zip(shape.corners, np.roll(shape.corners, -1, axis=0)):
            normal = np.array((a[1] - b[1], b[0] - a[0])) / np.hypot(*(b - a))
            assert ((polygon.corners - a) @ normal).min() >= -1e-14 * size_of(polygon)


@pytest.mark.parametrize("function", ROUND + WITHIN)
@given(polygon=polygons())
def test_shapes_are_reproducible(function, polygon):
    """A second call gives the same bits, and four times the size gives four times the corners in every bit."""
    corners = function(polygon).corners
    assert (function(Polygon(polygon.corners.copy())).corners == corners).all()
    assert_allclose(function(Polygon(4 * polygon.corners)).corners, 4 * corners, rtol=0, atol=0)


@pytest.mark.parametrize("function", ROUND + WITHIN)
@pytest.mark.parametrize("size", [2.0**-31, 2.0**90])
def test_slivers_have_shapes(function, size):
    """A triangle thinner than rounding gives no error, and no corner outside."""
    sliver = from_grid(oracles.hull_corners(SLIVER), size)
    shape = function(sliver)
    assert np.isfinite(shape.corners).all()
    if function in WITHIN:
        assert all(sliver.contains(corner) for corner in shape.corners) and shape.area <= sliver.area


@given(polygons())
def test_smallest_rectangle_is_the_smallest(polygon):
    """It is the best of those on each edge, in fractions, and of those at a thousand angles; its angles are right."""
    shape = smallest_rectangle(polygon)
    corners = oracles.exact(polygon.corners)
    areas = []
    for a, b in zip(corners, corners[1:] + corners[:1]):
        dx, dy = b[0] - a[0], b[1] - a[1]
        along, across = [x * dx + y * dy for x, y in corners], [y * dx - x * dy for x, y in corners]
        areas.append((max(along) - min(along)) * (max(across) - min(across)) / (dx * dx + dy * dy))
    assert is_same_area(shape, min(areas), polygon)
    for angle in np.linspace(0, np.pi / 2, 1000):
        turned = polygon.corners @ np.array([(np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))])
        assert shape.area <= np.prod(np.ptp(turned, axis=0)) * (1 + 1e-9) + rounding(polygon)
    a, b, c, d = shape.corners
    assert abs((b - a) @ (d - a)) <= rounding(polygon) and abs((c - b) @ (d - c)) <= rounding(polygon)


@given(polygons())
def test_smallest_parallelogram_is_the_smallest(polygon):
    """It is the best of those on each pair of edges, in fractions, and of those at many pairs of angles."""
    shape = smallest_parallelogram(polygon)
    corners = oracles.exact(polygon.corners)
    strips = []
    for a, b in zip(corners, corners[1:] + corners[:1]):
        dx, dy = b[0] - a[0], b[1] - a[1]
        across = [y * dx - x * dy for x, y in corners]
        strips.append((dx, dy, max(across) - min(across)))
    pairs = [(w * v, abs(dx * ey - dy * ex)) for (dx, dy, w), (ex, ey, v) in combinations(strips, 2)]
    assert is_same_area(shape, min(area / cross for area, cross in pairs if cross), polygon)
    angles = np.arange(90) * np.pi / 90
    widths = np.ptp(np.stack((-np.sin(angles), np.cos(angles)), axis=1) @ polygon.corners.T, axis=1)
    sines = np.abs(np.sin(angles[:, None] - angles)) + np.eye(90) * 1e-9
    assert shape.area <= (widths[:, None] * widths / sines).min() * (1 + 1e-9) + rounding(polygon)
    a, b, c, d = shape.corners
    assert_allclose(a + c, b + d, rtol=0, atol=1e-14 * np.abs(shape.corners).max())


@given(polygons())
def test_largest_triangle_is_the_largest(polygon):
    """It is the best of all triples of corners, in fractions; its corners are those of the polygon in every bit."""
    shape = largest_triangle(polygon)
    corners = oracles.exact(polygon.corners)
    assert set(oracles.exact(shape.corners)) <= set(corners)
    best = max(oracles.turn(*triple) for triple in combinations(corners, 3)) / 2
    assert shape.area == pytest.approx(float(best), rel=1e-9)


def searched(rows, offsets, log_area, starts):
    """Return the largest area that sequential quadratic programming finds in half-planes ``rows @ z <= offsets``."""
    best = 0.0
    inside = {"type": "ineq", "fun": lambda z: offsets - rows @ z, "jac": lambda z: -rows}
    for start in starts:
        with np.errstate(all="ignore"):
            found = minimize(
                lambda z: -log_area(z), start, constraints=[inside], method="SLSQP", options={"ftol": 1e-14}
            )
        slack = (rows @ found.x - offsets).max()
        if np.isfinite(found.fun) and slack <= 1e-12:
            best = max(best, np.exp(-found.fun))
    return best


def golden(value, low, high):
    """Return the maximum of a function with one peak, by golden section."""
    fraction = (5**0.5 - 1) / 2
    for _ in range(48):
        left, right = high - fraction * (high - low), low + fraction * (high - low)
        low, high = (low, right) if value(left) > value(right) else (left, high)
    return value((low + high) / 2)


@examples(10)
@given(round_polygons)
def test_largest_box_is_the_largest(polygon):
    """A nested search over both ends along x finds the same area; the sides are along the axes."""
    shape = largest_box(polygon)
    (low, _), (high, _) = polygon.bounds
    normals, offsets = (part.tolist() for part in polygon.half_planes)
    above = [(c / b, a / b) for (a, b), c in zip(normals, offsets) if b > 0]
    below = [(c / b, a / b) for (a, b), c in zip(normals, offsets) if b < 0]

    def area(x, u):
        top = min(c - a * z for c, a in above for z in (x, u))
        return (u - x) * (top - max(c - a * z for c, a in below for z in (x, u)))

    def signed_root(x, u):  # concave where it is positive, and no plateau elsewhere
        height = area(x, u) / (u - x) if u > x else -1.0
        return ((u - x) * height) ** 0.5 if height > 0 else height

    found = golden(lambda x: golden(lambda u: signed_root(x, u), x, high), low, high) ** 2
    assert shape.area == pytest.approx(found, rel=1e-7) and shape.area >= found * (1 - 1e-9)
    (x, y), (u, v) = shape.corners[[0, 2]]
    assert_allclose(shape.corners, [(x, y), (u, y), (u, v), (x, v)], rtol=0, atol=1e-15 * size_of(polygon))


@given(polygons())
def test_largest_box_cannot_grow(polygon):
    """If two sides move, all boxes in the polygon near it are smaller."""
    shape = largest_box(polygon)
    low, high = polygon.bounds
    unit_box, unit_polygon = (shape.corners - low) / (high - low), Polygon((polygon.corners - low) / (high - low))
    normals, offsets = unit_polygon.half_planes
    (x, y), (u, v) = unit_box[[0, 2]]
    is_thick = rounding(polygon) < 1e-12 * polygon.area
    for shift in permutations((1e-3, -1e-3, 0.0, 0.0)):
        a, b, c, d = np.array((x, y, u, v)) + np.array(shift) * np.array((u - x, v - y, u - x, v - y))
        corners = np.array([(a, b), (c, b), (c, d), (a, d)])
        slack = (offsets - corners @ normals.T).min()
        if is_thick and slack >= 0:
            assert (c - a) * (d - b) <= (u - x) * (v - y) * (1 + 1e-9)


@given(round_polygons)
def test_largest_parallelogram_is_the_largest(polygon):
    """No search from a dozen starts finds a larger one."""
    shape = largest_parallelogram(polygon)
    normals, offsets = polygon.half_planes
    rows = np.concatenate([np.hstack((normals, normals * s, normals * t)) for s, t in np.ndindex(2, 2)])

    def log_area(z):
        cross = z[2] * z[5] - z[3] * z[4]
        return np.log(cross) if cross > 0 else -1e3

    rng, starts = np.random.default_rng(0), []
    while len(starts) < 12:
        a, b, c = rng.dirichlet(np.ones(len(polygon.corners)), 3) @ polygon.corners
        middle, ab, ac = polygon.centroid, 0.2 * (b - a), 0.2 * (c - a)
        if ab[0] * ac[1] > ab[1] * ac[0]:
            starts.append(np.concatenate((middle - (ab + ac) / 2, ab, ac)))
    found = searched(rows, np.tile(offsets, 4), log_area, starts)
    assert found > 0 and shape.area >= found * (1 - 1e-9)
    a, b, c, d = shape.corners
    assert_allclose(a + c, b + d, rtol=0, atol=1e-14 * size_of(polygon))


@given(round_polygons)
@example(convex_hull(np.random.default_rng(12).normal(size=(9, 2))))  # two maxima between directions of edges
def test_largest_parallelogram_of_a_symmetric_polygon_is_known(polygon):
    """The parallelogram of a symmetric polygon is symmetric, and its diagonals end at corners."""
    corners = polygon.corners - polygon.centroid
    symmetric = convex_hull(np.concatenate([corners, -corners]))
    x, y = symmetric.corners.T
    best = 2 * (x[:, None] * y - y[:, None] * x).max()
    assert largest_parallelogram(symmetric).area == pytest.approx(best, rel=1e-8)  # as symmetric as the grid


@pytest.mark.parametrize("thin", [1e-2, 1e-5])
@given(polygon=round_polygons)
def test_parallelograms_and_triangles_are_affine(thin, polygon):
    """A linear map does not change their fractions of the area."""
    turned = Polygon(polygon.corners @ np.array([(0.8, 0.6), (-0.6, 0.8)]) @ np.array([(1.0, 0.0), (0.3, thin)]))
    for function in (smallest_parallelogram, largest_triangle, largest_parallelogram):
        fraction = function(turned).area / turned.area
        assert fraction == pytest.approx(function(polygon).area / polygon.area, rel=2e-9)
