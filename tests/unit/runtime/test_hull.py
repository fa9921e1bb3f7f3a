"""Convex hulls on an integer grid: all comparisons are of integers, without a tolerance."""

from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from skin_calib_addon.runtime.hull import HullTable, grid_step
from skin_calib_addon.runtime.polygon import PolygonTable, from_grid
from tests.oracles import hull_corners

unit_floats = st.floats(-1, 1)
unit_points = st.tuples(unit_floats, unit_floats)
steps = st.integers(-3, 3)


@st.composite
def clouds(draw):
    """Draw points of a difficult kind, at any size."""
    n = draw(st.integers(0, 16))
    x, y = (np.array(draw(st.lists(unit_floats, min_size=n, max_size=n))) for _ in range(2))
    whole = np.array(draw(st.lists(st.tuples(steps, steps), min_size=n, max_size=n)), float).reshape(-1, 2)
    start, along = (np.array(draw(unit_points)) for _ in range(2))
    points = {
        "random": np.stack((x, y), axis=1),
        "clustered": start + 1e-8 * np.stack((x, y), axis=1),
        "on a line": start + x[:, None] * along,
        "in one place": np.repeat(start[None], n, axis=0),
        "one bit apart": start + whole * 2.0**-29,
        "near a line": start + x[:, None] * along + whole * 2.0**-29,
        "grid": 0.01 * whole,
    }
    return points[draw(st.sampled_from(sorted(points)))] * draw(st.sampled_from([1.0, 0.1, 1e300, 1e-300, 1e-308, 0.0]))


def on_grid(points, step):
    """Return points in whole steps, computed with fractions."""
    return [tuple(round(Fraction(float(c)) / Fraction(step)) for c in point) for point in points]


@given(clouds())
def test_hull_equals_the_oracle(points):
    """It is the hull of the points on the grid, and equals a search over all pairs of points in every bit."""
    table = HullTable(points)
    corners = table.hull(np.arange(len(points)))
    whole = on_grid(points, table.step)
    assert corners == hull_corners(whole)


@given(clouds(), st.integers(1, 2), st.data())
def test_hull_of_rows_that_change_is_that_of_their_points(points, k, data):
    """A few or many rows change at a time; rows have common points, so that a removed point can still be there."""
    rows_of = points[: len(points) // k * k].reshape(-1, k, 2)
    table, chosen = HullTable(rows_of), set()
    polygons = PolygonTable(table)
    whole = on_grid(rows_of.reshape(-1, 2), table.step)
    some = st.sets(st.integers(0, len(rows_of) - 1), max_size=3) if len(rows_of) else st.just(set())
    for _ in range(8):
        chosen ^= data.draw(st.one_of(some, some, st.just(set(range(len(rows_of))))))
        corners = table.hull(np.array(sorted(chosen), np.int64))
        assert corners == hull_corners([whole[row * k + j] for row in chosen for j in range(k)])
        corners.clear()  # what is done to an answer changes no later one
        which = np.isin(np.arange(len(rows_of)), list(chosen))
        expected = from_grid(table.hull(which.nonzero()[0]), table.step).corners
        assert (polygons.hull(which).corners == expected).all()


@given(st.floats(5e-324, allow_infinity=False))
def test_grid_is_the_finest_that_fits(size):
    """The step is a power of two.

    The size is at most 2**29 steps and more than half as many, or the step is the smallest.
    """
    step = grid_step(size)
    assert np.frexp(step)[0] == 0.5
    assert Fraction(size) / Fraction(step) < 2**29
    assert step == 5e-324 or Fraction(size) / Fraction(step) > 2**28 - 1


def test_corners_that_differ_in_the_last_bit_keep_the_area():
    """With rounded cross products, a second point next to each corner of a square removed half of the area."""
    square = np.array([(-0.1, -0.05), (0.1, -0.05), (0.1, 0.05), (-0.1, 0.05)])
    points = np.concatenate([square, np.nextafter(square, 0), np.nextafter(square, 1)])
    table = HullTable(points)
    corners = table.hull(np.arange(len(points)))
    assert corners == [tuple(np.rint(corner / table.step).astype(int)) for corner in square]


def test_hull_is_exact_for_a_turn_of_one_step():
    """The cross product of three lattice points is 1, while rounded products differ by 128."""
    points = [(0, 0), (267914296, 165580141), (433494437, 267914296)]
    table = HullTable(np.array(points) * 2.0**-31)
    assert table.hull(np.arange(3)) == hull_corners(points)
