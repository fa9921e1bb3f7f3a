"""B-splines against their definition, against SciPy, and at their seams and edges."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline

from skin_calib_addon.common.errors import InvalidKnotVector
from skin_calib_addon.geometry.surface.bspline import (
    BSplineSurface,
    basis_functions,
    check_knots,
    clamped_knots,
    greville,
    local_basis,
    periodic_knots,
)

degrees = st.integers(2, 5)
seeds = st.integers(0, 2**32 - 1)


@st.composite
def knot_vectors(draw):
    """Degree and clamped knots on [0, 1] with uneven spans and inner knots of any multiplicity up to the degree."""
    degree = draw(degrees)
    inner = draw(st.lists(st.integers(1, 19), max_size=5, unique=True))
    times = [draw(st.integers(1, degree)) for _ in inner]
    knots = np.sort(np.repeat(np.array(inner) / 20, times)) if inner else np.empty(0)
    return degree, np.concatenate((np.zeros(degree + 1), knots, np.ones(degree + 1)))


def net_of(seed, n, m, repeats=0):
    """A random control net; the first ``repeats`` columns stand again at its end."""
    net = np.random.default_rng(seed).normal(size=(n, m, 3))
    return np.concatenate((net, net[:, :repeats]), axis=1)


def open_surface(seed=0, degree=(3, 3), n=7, m=8):
    """Clamped in both directions."""
    return BSplineSurface(net_of(seed, n, m), clamped_knots(n, degree[0]), clamped_knots(m, degree[1]), degree)


def closed_surface(seed=0, degree=(3, 3), n=7, m=9):
    """Clamped in u, periodic in v."""
    knots = clamped_knots(n, degree[0]), periodic_knots(m, degree[1])
    return BSplineSurface(net_of(seed, n, m, degree[1]), *knots, degree, (False, True))


@given(spline=knot_vectors(), seed=seeds)
def test_basis_is_that_of_scipy(spline, seed):
    """A second opinion, with its derivatives."""
    degree, knots = spline
    u = np.random.default_rng(seed).uniform(0, 1, 9)
    first, values = local_basis(u, knots, degree, degree)
    for order in range(degree + 1):
        dense = np.zeros((len(u), len(knots) - degree - 1))
        np.put_along_axis(dense, first[:, None] + np.arange(degree + 1), values[order], axis=1)
        expected = BSpline(knots, np.eye(len(knots) - degree - 1), degree)(u, nu=order)
        assert_allclose(dense, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@given(degree=degrees, extra=st.integers(0, 8))
def test_greville_abscissae_make_the_identity(degree, extra):
    """Control points at the abscissae give a spline that is its own parameter; periodic ones too."""
    for knots in (clamped_knots(degree + 1 + extra, degree), periodic_knots(degree + 1 + extra, degree)):
        u = np.linspace(0, 1, 23)
        assert_allclose(basis_functions(u, knots, degree) @ greville(knots, degree), u, rtol=0, atol=1e-13)


@pytest.mark.parametrize("make", [open_surface, closed_surface])
def test_grids_are_the_points_and_their_tangents(make):
    """Both methods of evaluation agree, also at the ends of the domain."""
    surface, u, v = make(3), np.linspace(0, 1, 9), np.linspace(0, 1, 11)
    uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    assert_allclose(surface.grid_points(u, v).reshape(-1, 3), surface.points(uv), rtol=0, atol=1e-14)
    by_u, by_v = (tangents.reshape(-1, 3) for tangents in surface.grid_tangents(u, v))
    r = surface.derivatives(uv)
    assert_allclose(by_u, r[1, 0], rtol=0, atol=1e-12)
    assert_allclose(by_v, r[0, 1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("make", [open_surface, closed_surface])
@pytest.mark.parametrize("degree", [(2, 3), (3, 4), (5, 2)])
def test_derivatives_are_those_of_scipy(make, degree):
    """All mixed partial derivatives up to the third, on spans of any kind."""
    surface = make(4, degree)
    uv = np.random.default_rng(5).uniform(0, 1, (20, 2))
    r = surface.derivatives(uv, order=3)
    for a in range(4):
        for b in range(4):
            along_u = BSpline(surface.knots_u, surface.control_net, degree[0])(uv[:, 0], nu=a)
            expected = [BSpline(surface.knots_v, row, degree[1])(v, nu=b) for row, v in zip(along_u, uv[:, 1])]
            assert_allclose(r[a, b], expected, rtol=0, atol=1e-11 * max(np.abs(expected).max(), 1))


@pytest.mark.parametrize("make", [open_surface, closed_surface])
def test_derivatives_are_slopes(make):
    """Central differences of each order give the next one; also beyond the open edges and over the seam."""
    surface, h = make(6), 1e-6
    uv = np.concatenate((np.random.default_rng(7).uniform(0.01, 0.99, (20, 2)), [[-0.3, 0.4], [1.2, 0.6], [0.5, 0.0]]))
    if not surface.closed[1]:
        uv = np.concatenate((uv[:-1], [[0.5, -0.2], [1.3, 1.4]]))
    r = surface.derivatives(uv, order=2)
    for step, pairs in (((h, 0), ((0, 0, 1, 0), (0, 1, 1, 1), (1, 0, 2, 0))), ((0, h), ((0, 0, 0, 1), (0, 1, 0, 2)))):
        up, down = (surface.derivatives(uv + s * np.array(step), order=1) for s in (1, -1))
        for a, b, c, d in pairs:
            slope = (up[a, b] - down[a, b]) / (2 * h)
            assert_allclose(r[c, d], slope, rtol=0, atol=1e-5 * np.abs(slope).max())


@given(seed=seeds, degree=degrees)
def test_seam_is_exact(seed, degree):
    """The left and right limits of point, normal, and derivatives below the degree agree to the rounding."""
    closed = closed_surface(seed, (3, degree), m=degree + 4)
    cut = BSplineSurface(closed.control_net, closed.knots_u, closed.knots_v, closed.degree)  # v = 1 is not v = 0 here
    u = np.linspace(0, 1, 9)
    right, left = (cut.derivatives(np.column_stack((u, np.full(9, v))), order=degree - 1) for v in (0.0, 1.0))
    assert_allclose(left[0, 0], right[0, 0], rtol=0, atol=1e-14)
    for order in range(1, degree):
        assert_allclose(left[0, order], right[0, order], rtol=0, atol=1e-12 * np.abs(right[0, order]).max())
    normals = [np.cross(r[1, 0], r[0, 1]) for r in (left, right)]
    jump = np.linalg.norm(np.cross(*normals), axis=1) / np.linalg.norm(normals[0], axis=1) ** 2
    assert jump.max() < 1e-11


@given(v=st.floats(-3, 3), turns=st.integers(-3, 3))
def test_closed_parameters_wrap_round(v, turns):
    """Every v stands for the same place as v and any number of turns, and comes back into [0, 1)."""
    surface = closed_surface()
    wrapped = surface.wrap([[0.4, v], [0.4, v + turns]])
    assert (wrapped[:, 1] >= 0).all() and (wrapped[:, 1] < 1).all()
    assert_allclose(*surface.points([[0.4, v], [0.4, v + turns]]), rtol=0, atol=1e-12)


@given(seed=seeds, limit=st.floats(0, 2), v=st.floats(0, 1))
def test_surface_goes_on_straight_beyond_an_open_edge(seed, limit, v):
    """Beyond u = 0 and u = 1: the tangent there, the same normal along it in a closed surface's v, no curvature."""
    surface = closed_surface(seed)
    for edge, sign in ((0.0, -1), (1.0, 1)):
        at, beyond = [[edge, v]], [[edge + sign * limit, v]]
        r, s = surface.derivatives(at, order=2), surface.derivatives(beyond, order=2)
        assert_allclose(s[0, 0], r[0, 0] + sign * limit * r[1, 0], rtol=0, atol=1e-12)
        assert_allclose(s[1, 0], r[1, 0], rtol=0, atol=1e-12)
        if beyond != at:
            assert (s[2, 0] == 0).all()


def test_surface_goes_on_as_a_plane_beyond_a_corner():
    """Beyond two edges at once: bilinear in what lies beyond, and smooth across the edge."""
    surface = open_surface(9)
    r = surface.derivatives([[1.0, 0.0]], order=2)
    far = surface.points([[1.25, -0.5]])
    expected = r[0, 0] + 0.25 * r[1, 0] - 0.5 * r[0, 1] - 0.125 * r[1, 1]
    assert_allclose(far, expected, rtol=0, atol=1e-13)
    near, beyond = surface.points([[1.0 - 1e-9, 0.4], [1.0 + 1e-9, 0.4]])
    assert np.abs(near - beyond).max() < 1e-6


def test_normals_are_unit_and_follow_the_right_hand():
    """r_u x r_v of length one: of a plane, exactly up."""
    surface = closed_surface(10)
    uv = np.random.default_rng(11).uniform(0, 1, (50, 2))
    normals, r = surface.normals(uv), surface.derivatives(uv)
    assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=1e-14)
    assert ((np.cross(r[1, 0], r[0, 1]) * normals).sum(axis=1) > 0).all()
    knots = clamped_knots(4, 3)
    i, j = np.meshgrid(np.arange(4.0), np.arange(4.0), indexing="ij")
    plane = BSplineSurface(np.stack((i, j, 0 * i), axis=-1), knots, knots, (3, 3))
    assert_allclose(plane.normals(uv), np.tile((0, 0, 1), (50, 1)), rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("knots", "degree", "n", "message"),
    [
        ([0, 0, 1, 1], 0, 3, "A B-spline surface of degree 0 is not available"),
        ([0, 0, 0, 1, 1, 1], 3, 2, "Degree 3 needs at least 4 control points, but there are 2"),
        ([0, 0, 0, 0.5, 1, 1], 2, 4, "4 control points of degree 2 need 7 knots, but there are 6"),
        ([0, 0, 0, 0.7, 0.3, 1, 1, 1], 2, 5, "Knot 4 is smaller than knot 3. Knots must not decrease"),
        ([0, 0, 0, 0, 0, 0], 2, 3, "All knots of the domain are equal"),
    ],
)
def test_knots_that_carry_no_spline_are_refused(knots, degree, n, message):
    """Degree, number of control points, number of knots, order, length: each on its own, and through a surface."""
    with pytest.raises(InvalidKnotVector, match=message):
        check_knots(np.array(knots, float), degree, n)
    with pytest.raises(InvalidKnotVector, match=message):
        BSplineSurface(np.zeros((4, n, 3)), clamped_knots(4, 3), np.array(knots, float), (3, degree))
