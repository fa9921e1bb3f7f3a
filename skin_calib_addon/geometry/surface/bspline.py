"""B-spline basis functions and tensor-product surfaces: evaluation, derivatives, normals."""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from ...common.arrays import Array, IntArray, cross, freeze, unit
from ...common.errors import InvalidKnotVector

# Least number of sites [1] in a direction, by whether it is closed. With fewer, all of them may be at the corners of
# the facets, or all at their centres. Larger: coarse nets have a more accurate error, and small fits take longer.
MIN_SITES = {False: 20, True: 60}


def clamped_knots(n: int, degree: int) -> Array:
    """Return uniform knots (n + degree + 1,) on [0, 1], repeated at the ends: the spline ends at its control points."""
    return np.concatenate((np.zeros(degree), np.linspace(0.0, 1.0, n - degree + 1), np.ones(degree)))


def periodic_knots(n: int, degree: int) -> Array:
    """Return the knots (n + 2 degree + 1,) of a closed spline with ``n`` control points, one period on [0, 1]."""
    return np.arange(-degree, n + degree + 1) / n


def greville(knots: Array, degree: int) -> Array:
    r"""Return the Greville abscissae: the control points of the identity map (Greville, 1967).

    .. math::

        \xi_i = \frac{1}{p} \sum_{k=1}^{p} t_{i+k}
    """
    return np.lib.stride_tricks.sliding_window_view(knots[1:-1], degree).mean(axis=1)


def sites_per_span(per_span: int, spans: int, minimum: int) -> int:
    """Return the number of sites in each span: ``per_span``, or more for ``minimum`` sites in all spans."""
    return max(per_span, -(-minimum // spans))


def check_knots(knots: Array, degree: int, n: int) -> None:
    """Check that there are ``n + degree + 1`` knots, which never decrease, and that their domain has a length."""
    if degree < 1:
        raise InvalidKnotVector(f"A B-spline surface of degree {degree} is not available. Use 2 to 5.")
    if n < degree + 1:
        raise InvalidKnotVector(f"Degree {degree} needs at least {degree + 1} control points, but there are {n}.")
    if len(knots) != n + degree + 1:
        raise InvalidKnotVector(
            f"{n} control points of degree {degree} need {n + degree + 1} knots, but there are {len(knots)}."
        )
    if (np.diff(knots) < 0).any():
        at = int(np.argmax(np.diff(knots) < 0))
        raise InvalidKnotVector(f"Knot {at + 1} is smaller than knot {at}. Knots must not decrease.")
    if not knots[degree] < knots[n]:
        raise InvalidKnotVector("All knots of the domain are equal, so the spline has no length.")


def local_basis(u: Array, knots: Array, degree: int, order: int = 0) -> tuple[IntArray, Array]:
    r"""Evaluate the basis functions that are not zero at each parameter (The NURBS Book, eq. 2.5 and 2.9).

    .. math::

        N_{i,0}(u) = \begin{cases} 1 & t_i \le u < t_{i+1} \\ 0 & \text{otherwise} \end{cases}, \qquad
        N_{i,p}(u) = \frac{u - t_i}{t_{i+p} - t_i} N_{i,p-1}(u)
    + \frac{t_{i+p+1} - u}{t_{i+p+1} - t_{i+1}} N_{i+1,p-1}(u)

    .. math::

        N_{i,p}^{(d)}(u) = p \left( \frac{N_{i,p-1}^{(d-1)}(u)}{t_{i+p} - t_i}
        - \frac{N_{i+1,p-1}^{(d-1)}(u)}{t_{i+p+1} - t_{i+1}} \right)
    """
    n = len(knots) - degree - 1
    span = np.clip(np.searchsorted(knots, u, side="right") - 1, degree, n - 1)
    # window[:, i] is knot span - degree + 1 + i: all knots of the functions that are not zero in this span.
    window = knots[span[:, None] + np.arange(1 - degree, degree + 1)]
    tables = [np.ones((len(u), 1))]
    for p in range(1, degree + 1):
        left, right = window[:, degree - p : degree], window[:, degree : degree + p]
        ratio = tables[-1] / (right - left)
        value = np.zeros((len(u), p + 1))
        value[:, :-1] = (right - u[:, None]) * ratio
        value[:, 1:] += (u[:, None] - left) * ratio
        tables.append(value)
    values = np.zeros((order + 1, len(u), degree + 1))
    values[0] = tables[degree]
    for d in range(1, min(order, degree) + 1):
        part = tables[degree - d]
        for p in range(degree - d + 1, degree + 1):  # the d-th derivative, from the lower degree to the full degree
            ratio = p * part / (window[:, degree : degree + p] - window[:, degree - p : degree])
            part = np.zeros((len(u), p + 1))
            part[:, :-1] = -ratio
            part[:, 1:] += ratio
        values[d] = part
    return span - degree, values


def basis_functions(u: Array, knots: Array, degree: int) -> Array:
    """Evaluate every B-spline basis function at each parameter (The NURBS Book, eq. 2.5)."""
    return basis_derivatives(u, knots, degree, 0)[0]


def basis_derivatives(u: Array, knots: Array, degree: int, order: int = 1) -> Array:
    """Return every B-spline basis function and its derivatives at parameters (m,), shape (order + 1, m, n)."""
    first, values = local_basis(u, knots, degree, order)
    dense = np.zeros((order + 1, len(u), len(knots) - degree - 1))
    np.put_along_axis(dense, (first[:, None] + np.arange(degree + 1))[None], values, axis=2)
    return dense


@dataclass(frozen=True, eq=False)
class SpanPolynomials:
    """The basis functions of each knot span, as polynomials of the parameter relative to the start of the span."""

    starts: Array  # (s,) starts of the spans
    lengths: Array  # (s,)
    first: IntArray  # (s,) index of the first basis function of each span
    coefficients: Array  # (s, degree + 1, degree + 1): function, power

    @classmethod
    def of(cls, knots: Array, degree: int) -> "SpanPolynomials":
        """Return the Taylor expansions at the start of every span that is not empty."""
        inner = knots[degree : len(knots) - degree]
        starts, lengths = inner[:-1][np.diff(inner) > 0], np.diff(inner)[np.diff(inner) > 0]
        first, derivatives = local_basis(starts, knots, degree, degree)
        powers = np.arange(degree + 1)
        factorials = np.cumprod(np.maximum(powers, 1))
        return cls(starts, lengths, first, derivatives.transpose(1, 2, 0) / factorials)


@cache
def _derivatives(count: int, order: int) -> Array:
    """Return the matrix from ``count`` powers of a number to their derivatives up to ``order``, side by side."""
    blocks = [np.eye(count)]
    for _ in range(order):
        blocks.append(blocks[-1] @ np.diag(np.arange(1.0, count), 1))
    return np.concatenate(blocks, axis=1)


MIN_LENGTH = 1e-12  # [m] lower bound of a length in a denominator, where points of the surface coincide


@dataclass(frozen=True, eq=False)
class BSplineSurface:
    r"""A tensor-product B-spline surface over (u, v) in [0, 1] x [0, 1], in the link frame [m].

    .. math::

        \mathbf{S}(u, v) = \sum_i \sum_j N_{i,p}(u)\, N_{j,q}(v)\, \mathbf{p}_{ij}

    (The NURBS Book, eq. 3.11.) In a ``closed`` direction the net ends with copies of its first ``degree`` control
    points, the knots are periodic, and parameters wrap around. ``r_u x r_v`` points out of the robot.

    ``centre`` is the point of the mesh at the middle of the region. The centre of the surface is the point next to it.
    """

    control_net: Array  # (n_u, n_v, 3) [m]
    knots_u: Array  # (n_u + degree_u + 1,)
    knots_v: Array  # (n_v + degree_v + 1,)
    degree: tuple[int, int]
    closed: tuple[bool, bool] = (False, False)
    centre: Array | None = None  # (3,) [m]

    def __post_init__(self):
        freeze(self, control_net=(None, None, 3), knots_u=(None,), knots_v=(None,))
        if self.centre is not None:
            freeze(self, centre=(3,))
        for knots, degree, n in zip((self.knots_u, self.knots_v), self.degree, self.control_net.shape):
            check_knots(knots, degree, n)

    def points(self, uv: Any) -> Array:
        """Return the points at parameters ``uv`` of shape (m, 2); shape (m, 3) [m]."""
        return self.derivatives(uv, order=0)[0, 0]

    def normals(self, uv: Any) -> Array:
        r"""Return the unit normals out of the robot, shape (m, 3) (paper eq. 5, normalized).

        .. math::

            \mathbf{n} = \frac{\mathbf{S}_u \times \mathbf{S}_v}{\lVert \mathbf{S}_u \times \mathbf{S}_v \rVert}
        """
        r = self.derivatives(uv, order=1)
        return unit(cross(r[1, 0], r[0, 1]))

    def derivatives(self, uv: Any, order: int = 1) -> Array:
        r"""Return the partial derivatives up to ``order``.

        Parameters
        ----------
        uv : array, shape (m, 2)
            Parameters. They wrap around where the surface is closed. Beyond an open edge the surface continues along
            its tangent.
        order : int
            Highest derivative.

        Returns
        -------
        array, shape (order + 1, order + 1, m, 3)
            ``r[a, b]`` is :math:`\partial^{a+b} S / \partial u^a \partial v^b` [m]. Derivatives of a total order above
            ``order`` are computed too.
        """
        span_u, span_v, (U, V) = self._monomials(self.wrap(uv).T, order)
        patches = self.patches[span_u, span_v]
        rows = np.matmul(U, patches).reshape(len(U), order + 1, V.shape[2], 3)
        return np.matmul(V[:, None], rows).transpose(1, 2, 0, 3)

    def _monomials(self, uv: Array, order: int) -> tuple[IntArray, IntArray, Array]:
        """Return the spans of parameters (2, m), and derivatives of the powers there, shape (2, m, order + 1, powers).

        Both directions are computed at once, because for few points this takes little more time than one direction.
        Beyond the ends of its domain a spline continues along its tangent.
        """
        starts, (first, last), spans_u = self._steps
        inside = np.minimum(np.maximum(uv, first), last)
        step = np.empty(uv.shape, np.int64)
        for s, x, out in zip(self.spans, inside, step):
            out[:] = s.starts.searchsorted(x, "right")
        step -= 1
        step[1] += spans_u
        powers = np.empty((*uv.shape, max(self.degree) + 1))
        powers[..., 0] = 1.0
        powers[..., 1:] = (inside - starts[step])[..., None]
        np.multiply.accumulate(powers, axis=2, out=powers)
        beyond = uv - inside
        leaves = bool(beyond.any())
        count, most = powers.shape[2], max(order, leaves)
        values = (powers.reshape(-1, count) @ _derivatives(count, most)).reshape(*uv.shape, most + 1, count)
        if leaves:
            values[:, :, 0] += beyond[..., None] * values[:, :, 1]
            values[beyond != 0, 2:] = 0.0
        return step[0], step[1] - spans_u, values[:, :, : order + 1]

    def wrap(self, uv: Any) -> Array:
        """Return parameters with closed directions mapped into [0, 1), shape (m, 2)."""
        uv = np.array(uv, float).reshape(-1, 2)
        for axis in (0, 1):
            if self.closed[axis]:
                x = uv[:, axis]
                x -= np.floor(x)
                x[x == 1.0] = 0.0  # a negative number near zero is rounded to one
        return uv

    def grid_points(self, u: Array, v: Array) -> Array:
        """Return the points at every pair of ``u`` and ``v``.

        Parameters
        ----------
        u : array, shape (k,)
            Parameters.
        v : array, shape (l,)
            Parameters.

        Returns
        -------
        array, shape (k, l, 3)
            [m]
        """
        A = basis_functions(u, self.knots_u, self.degree[0])
        B = basis_functions(v, self.knots_v, self.degree[1])
        n, m, _ = self.control_net.shape
        rows = (A @ self.control_net.reshape(n, -1)).reshape(len(A), m, 3)
        return B @ rows  # one small product per row

    def grid_tangents(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Return the derivatives by u and by v at every pair of ``u`` and ``v``.

        Parameters
        ----------
        u : array, shape (k,)
            Parameters.
        v : array, shape (l,)
            Parameters.

        Returns
        -------
        by_u, by_v : array, shape (k, l, 3)
            [m]
        """
        A, along = basis_derivatives(u, self.knots_u, self.degree[0])
        B, across = basis_derivatives(v, self.knots_v, self.degree[1])
        n, m, _ = self.control_net.shape
        nets = self.control_net.transpose(0, 2, 1).reshape(n, -1)
        by_u, by_v = (
            ((rows @ nets).reshape(-1, m) @ columns.T).reshape(len(u), 3, len(v)).transpose(0, 2, 1)
            for rows, columns in ((along, B), (A, across))
        )
        return by_u, by_v

    @cached_property
    def spans(self) -> tuple[SpanPolynomials, SpanPolynomials]:
        """Return the polynomials of the knot spans along u and v."""
        return SpanPolynomials.of(self.knots_u, self.degree[0]), SpanPolynomials.of(self.knots_v, self.degree[1])

    @cached_property
    def _steps(self) -> tuple[Array, Array, int]:
        """Return the starts of the spans in u, then in v; the ends of both domains (2, 2, 1); the spans in u."""
        starts = np.concatenate([s.starts for s in self.spans])
        ends = np.array([(s.starts[0], s.starts[-1] + s.lengths[-1]) for s in self.spans]).T[..., None]
        return starts, ends, len(self.spans[0].starts)

    @cached_property
    def patches(self) -> Array:
        """Return the coefficients [m] of each pair of spans, shape (s_u, s_v, powers, powers * 3), zero-padded."""
        (i, C), (j, D) = ((s.first[:, None] + np.arange(s.coefficients.shape[1]), s.coefficients) for s in self.spans)
        nets = self.control_net[i[:, None, :, None], j[None, :, None, :]]
        powers = max(self.degree) + 1
        patches = np.zeros((len(C), len(D), powers, powers, 3))
        patches[:, :, : C.shape[2], : D.shape[2]] = np.einsum("aik,abijc,bjl->abklc", C, nets, D, optimize=True)
        return patches.reshape(len(C), len(D), powers, -1)
