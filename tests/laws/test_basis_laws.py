"""What holds for any B-spline basis and any surface made from it."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.geometry.surface.bspline import (
    BSplineSurface,
    basis_functions,
    clamped_knots,
    local_basis,
    periodic_knots,
)

degrees = st.integers(2, 5)
seeds = st.integers(0, 2**32 - 1)


@st.composite
def bases(draw):
    """Degree and knots: clamped or periodic, even or not, with inner knots repeated up to the degree."""
    degree, extra = draw(degrees), draw(st.integers(0, 6))
    kind = draw(st.sampled_from(["clamped", "periodic", "uneven"]))
    if kind == "periodic":
        return degree, periodic_knots(degree + 1 + extra, degree)
    if kind == "clamped":
        return degree, clamped_knots(degree + 1 + extra, degree)
    inner = np.sort(np.array(draw(st.lists(st.integers(1, 9), max_size=6)), float)) / 10
    inner = np.array([k for i, k in enumerate(inner) if list(inner[:i]).count(k) < degree])
    return degree, np.concatenate((np.zeros(degree + 1), inner, np.ones(degree + 1)))


@st.composite
def surfaces(draw):
    """Surfaces with random nets, open or closed in v."""
    closed, seed = draw(st.booleans()), draw(seeds)
    p, q = draw(degrees), draw(degrees)
    n, m = p + 1 + draw(st.integers(0, 4)), q + 1 + draw(st.integers(0, 4))
    net = np.random.default_rng(seed).normal(size=(n, m, 3))
    if closed:
        net = np.concatenate((net, net[:, :q]), axis=1)
    return BSplineSurface(
        net, clamped_knots(n, p), (periodic_knots if closed else clamped_knots)(m, q), (p, q), (False, closed)
    )


parameters = st.lists(st.floats(0, 1), min_size=1, max_size=8).map(np.array)
pairs = st.lists(st.tuples(st.floats(-0.5, 1.5), st.floats(-2, 3)), min_size=1, max_size=8).map(np.array)


@given(basis=bases(), u=parameters)
def test_basis_is_a_partition_of_unity(basis, u):
    """At every parameter the functions are not negative and sum to one; their derivatives sum to zero."""
    degree, knots = basis
    N = basis_functions(u, knots, degree)
    assert_allclose(N.sum(axis=1), 1, rtol=1e-13)
    assert (N > -1e-14).all()
    _, values = local_basis(u, knots, degree, degree)
    sums = values.sum(axis=2)[1:]
    assert_allclose(sums, 0, rtol=0, atol=1e-12 * np.abs(values[1:]).max())


@given(basis=bases(), u=parameters)
def test_basis_is_local(basis, u):
    """Function i is zero outside of [knot i, knot i + degree + 1]."""
    degree, knots = basis
    N = basis_functions(u, knots, degree)
    i = np.arange(N.shape[1])
    outside = (u[:, None] < knots[i]) | (u[:, None] > knots[i + degree + 1])
    assert (N[outside] == 0).all()


@given(surface=surfaces(), seed=seeds, uv=pairs)
def test_surface_is_affine_invariant(surface, seed, uv):
    """Moving, stretching and shearing the control points does the same to every point, and to every derivative."""
    rng = np.random.default_rng(seed)
    A, b = rng.normal(size=(3, 3)), rng.normal(size=3)
    moved = BSplineSurface(
        surface.control_net @ A.T + b, surface.knots_u, surface.knots_v, surface.degree, surface.closed
    )
    r, s = surface.derivatives(uv, order=2), moved.derivatives(uv, order=2)
    expected = r @ A.T
    expected[0, 0] += b
    assert_allclose(s, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@given(surface=surfaces(), seed=seeds, uv=pairs)
def test_normals_turn_with_the_surface(surface, seed, uv):
    """A rotation turns every normal; a mirror turns it over."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    r = surface.derivatives(uv)
    sharp = np.linalg.norm(np.cross(r[1, 0], r[0, 1]), axis=1) > 1e-3 * (
        np.linalg.norm(r[1, 0], axis=1) * np.linalg.norm(r[0, 1], axis=1)
    )
    moved = BSplineSurface(surface.control_net @ q.T, surface.knots_u, surface.knots_v, surface.degree, surface.closed)
    expected = np.sign(np.linalg.det(q)) * surface.normals(uv) @ q.T
    assert_allclose(moved.normals(uv)[sharp], expected[sharp], rtol=0, atol=1e-9)


@given(surface=surfaces(), u=st.floats(0, 1), v=st.floats(0, 1))
def test_point_lies_in_the_hull_of_its_control_points(surface, u, v):
    """Within the box of the control points with a weight there."""
    p, q = surface.degree
    N, M = basis_functions(np.array([u]), surface.knots_u, p)[0], basis_functions(np.array([v]), surface.knots_v, q)[0]
    near = surface.control_net[np.ix_(N > 0, M > 0)].reshape(-1, 3)
    point = surface.points([[u, v]])[0]
    assert (point >= near.min(axis=0) - 1e-12).all() and (point <= near.max(axis=0) + 1e-12).all()


@given(surface=surfaces(), i=st.integers(0, 99), j=st.integers(0, 99), seed=seeds)
def test_control_point_moves_its_neighbourhood_only(surface, i, j, seed):
    """Where its two functions are zero, the surface does not move, to the bit."""
    n, m = surface.control_net.shape[:2]
    i, j = i % n, j % m
    net = surface.control_net.copy()
    net[i, j] += (1.0, -2.0, 0.5)
    moved = BSplineSurface(net, surface.knots_u, surface.knots_v, surface.degree)
    still = BSplineSurface(surface.control_net, surface.knots_u, surface.knots_v, surface.degree)
    uv = np.random.default_rng(seed).uniform(0, 1, (20, 2))
    fraction = basis_functions(uv[:, 0], surface.knots_u, surface.degree[0])[:, i]
    fraction = fraction * basis_functions(uv[:, 1], surface.knots_v, surface.degree[1])[:, j]
    step = moved.points(uv) - still.points(uv)
    assert_allclose(step, fraction[:, None] * (1.0, -2.0, 0.5), rtol=0, atol=1e-12)
    assert (step[fraction == 0] == 0).all()
