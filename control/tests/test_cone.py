"""The wrench cone of a contact, compared with linear programs over forces at its corners, and with Qhull."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from skin_calib_addon.runtime import Polygon, convex_hull
from skin_control.cone import margin, rectangle_cone, wrench_cone, wrench_rays
from tests.examples import examples
from tests.polygons import polygons, round_polygons, size_of

frictions = st.sampled_from([0.1, 0.5, 0.7, 1.0, 3.0])
LOW, HIGH = (-0.05, 0.02), (0.11, 0.09)  # a sole whose origin lies outside of it
seeds = st.integers(0, 10**6)


def rectangle(low, high):
    """Return the polygon of a rectangle, with corners that are not on a grid."""
    (x, y), (u, v) = low, high
    return Polygon(np.array([(x, y), (u, y), (u, v), (x, v)]))


def is_feasible(rays, wrench):
    """Return whether non-negative forces at corners can make a wrench, by a linear program."""
    return linprog(np.zeros(len(rays)), A_eq=rays.T, b_eq=wrench, method="highs").status == 0


def formula_rows(low, high, mu):
    """Return the corrected rows of the thesis, one by one, for wrenches [fx fy fz tx ty tz]."""
    (xm, ym), (xM, yM) = low, high
    rows = [(1, 0, -mu, 0, 0, 0), (-1, 0, -mu, 0, 0, 0), (0, 1, -mu, 0, 0, 0), (0, -1, -mu, 0, 0, 0)]
    rows += [(0, 0, ym, -1, 0, 0), (0, 0, -yM, 1, 0, 0), (0, 0, -xM, 0, -1, 0), (0, 0, xm, 0, 1, 0)]
    least = [
        (-yM, xm, mu * (xm - yM), mu, mu),
        (-yM, xM, -mu * (xM + yM), mu, -mu),
        (-ym, xm, mu * (xm + ym), -mu, mu),
        (-ym, xM, mu * (ym - xM), -mu, -mu),
    ]
    most = [
        (-yM, xm, mu * (yM - xm), -mu, -mu),
        (-yM, xM, mu * (xM + yM), -mu, mu),
        (-ym, xm, -mu * (xm + ym), mu, -mu),
        (-ym, xM, mu * (xM - ym), mu, mu),
    ]
    rows += [(*row, -1) for row in least] + [(*(-c for c in row), 1) for row in most]
    return np.array(rows, float)


def by_length(rows):
    """Return rows of length one, sorted."""
    rows = rows / np.linalg.norm(rows, axis=1, keepdims=True) + 0.0
    return rows[np.lexsort(np.round(rows, 9).T)]


@pytest.mark.parametrize("mu", [0.3, 1.0, 2.0])
@pytest.mark.parametrize(("low", "high"), [(LOW, HIGH), ((-1.0, -2.0), (1.0, 2.0)), ((3.0, -4.0), (5.0, -1.0))])
def test_rectangle_rows_are_those_of_the_formulas(low, high, mu):
    """This is true at any position; the rows of a general polygon are the same, in the same order."""
    rows = rectangle_cone(low, high, mu)
    assert rows.shape == (16, 6)
    assert_allclose(by_length(rows), by_length(formula_rows(low, high, mu)), rtol=0, atol=1e-15)
    assert_allclose(wrench_cone(rectangle(low, high), mu), rows, rtol=0, atol=1e-14)


def test_rays_are_forces_at_corners():
    """Each ray is a force at an edge of the pyramid, with the torque p x f."""
    rays = wrench_rays(Polygon(np.array([(0.1, 0.2)])), 0.5)
    expected = [(sx / 2, sy / 2, 1.0, 0.2, -0.1, 0.1 * sy / 2 - 0.2 * sx / 2) for sx in (1, -1) for sy in (1, -1)]
    assert_allclose(by_length(rays), by_length(np.array(expected)), rtol=1e-15)
    assert wrench_rays(convex_hull([]), 0.5).shape == (0, 6)
    assert wrench_rays(rectangle(LOW, HIGH), 0.5).shape == (16, 6)


def test_feasible_corner_forces_are_accepted():
    """All of 9349 wrenches of feasible corner forces are accepted."""
    rng = np.random.default_rng(0)
    normal = rng.exponential(size=(9349, 4))
    tangent = rng.uniform(-0.6, 0.6, size=(9349, 4, 2)) * normal[:, :, None]
    corners = rectangle(LOW, HIGH).corners
    forces = np.concatenate((tangent, normal[:, :, None]), axis=2)
    wrenches = np.hstack((forces.sum(axis=1), np.cross(np.hstack((corners, np.zeros((4, 1)))), forces).sum(axis=1)))
    assert (wrenches @ rectangle_cone(LOW, HIGH, 0.6).T).max() <= 1e-14 * wrenches.max()


@examples(15)
@given(round_polygons, frictions, seeds)
def test_cone_is_what_corner_forces_can_do(polygon, mu, seed):
    """Rows and linear program agree for wrenches inside, outside and near the border."""
    rows, rays = wrench_cone(polygon, mu), wrench_rays(polygon, mu)
    assert (rays @ rows.T).max() <= 1e-14 * np.abs(rays).max()
    rng = np.random.default_rng(seed)
    inner = rays.mean(axis=0)
    for _ in range(6):
        outside = inner + rng.normal(size=6) * np.abs(rays).max(axis=0) * 3
        outside[2] = inner[2]  # with the same normal force all else is bounded
        fraction = 1 / (rows @ (outside - inner) / -(rows @ inner)).max()  # where the line leaves the cone
        for t, feasible in ((0.5, True), (1 - 1e-5, True), (1 + 1e-5, False), (2.0, False)):
            wrench = inner + t * fraction * (outside - inner)
            assert (margin(rows, wrench) >= 0) == feasible == is_feasible(rays, wrench)
    assert not is_feasible(rays, -inner) and margin(rows, -inner) < 0


@examples(15)
@given(round_polygons, frictions)
def test_cone_has_exactly_the_rows_of_the_hull(polygon, mu):
    """The rows are the facets that Qhull finds for the rays in five dimensions."""
    rows = wrench_cone(polygon, mu)
    facets = ConvexHull(np.delete(wrench_rays(polygon, mu), 2, axis=1)).equations
    facets = np.insert(facets[:, :5], 2, facets[:, 5], axis=1)
    facets /= np.linalg.norm(facets, axis=1, keepdims=True)
    gaps = np.linalg.norm(facets[:, None] - rows[None], axis=2)
    assert gaps.min(axis=0).max() <= 1e-7 and gaps.min(axis=1).max() <= 1e-7


@given(polygons(), frictions)
def test_rays_are_on_enough_rows_of_the_cone(polygon, mu):
    """For any polygon no ray is outside, each ray is on at least five rows, and rows have length one."""
    rows, rays = wrench_cone(polygon, mu), wrench_rays(polygon, mu)
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    assert np.isfinite(rows).all()
    assert_allclose(np.linalg.norm(rows, axis=1), 1, rtol=1e-14)
    depth = -(rows @ rays.T)
    off = 1e-14 * (1 + size_of(polygon))
    assert depth.min() >= -off
    assert depth.min(axis=0).max() <= off and (depth <= off).sum(axis=0).min() >= 5
    assert (wrench_cone(Polygon(polygon.corners.copy()), mu) == rows).all()


def test_margin_is_the_distance_to_the_border():
    """The margin is positive inside, zero on the border, negative outside, and -inf for NaN."""
    rows = rectangle_cone((-1, -1), (1, 1), 1.0)
    assert margin(rows, (0, 0, 1, 0, 0, 0)) == pytest.approx(2 / 3)
    assert margin(rows, (1, 0, 1, 0, 0, 0)) == pytest.approx(0, abs=1e-15)
    assert margin(rows, (3, 0, 1, 0, 0, 0)) == pytest.approx(-(2**0.5))
    assert margin(rows, (0, np.nan, 1, 0, 0, 0)) == -np.inf


@pytest.mark.parametrize("friction", [0.0, -0.5, np.nan, np.inf])
def test_friction_must_be_positive(friction):
    """Without friction the cone has no inside."""
    for call in (lambda: wrench_rays(rectangle(LOW, HIGH), friction), lambda: rectangle_cone(LOW, HIGH, friction)):
        with pytest.raises(ValueError, match="friction .* must be a positive number"):
            call()
    with pytest.raises(ValueError, match="friction .* must be a positive number"):
        wrench_cone(rectangle(LOW, HIGH), friction)


@pytest.mark.parametrize(
    ("low", "high"), [((0, 0), (0, 1)), ((0, 1), (1, 0)), ((0, np.nan), (1, 1)), ((0, 0), (np.inf, 1))]
)
def test_rectangles_need_an_area(low, high):
    """Limits in the wrong order, equal or not finite raise an error."""
    with pytest.raises(ValueError, match="has no area"):
        rectangle_cone(low, high, 0.5)


@pytest.mark.parametrize("points", [[], [(1, 2)], [(1, 2), (3, 4)]])
def test_what_has_no_area_has_no_cone(points):
    """A polygon without an area has no rows, and no wrench is feasible there, as in the air."""
    rows = wrench_cone(convex_hull(points), 0.5)
    assert rows is None and margin(rows, np.zeros(6)) == -np.inf
