"""B-spline bases and tensor-product surfaces: evaluation, derivatives, normals."""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from ...common.arrays import Array, IntArray, cross, freeze, product, unit
from ...common.errors import InvalidKnotVector

# Fewer sites from edge to edge, or all round, may all fall on corners of the facets, or all on their middles.
MIN_SITES = {False: 20, True: 60}  # by whether the direction is closed


def clamped_knots(n: int, degree: int) -> Array:
    """Uniform knots on [0, 1], repeated at the ends so that the spline reaches its end control points.

    Returns
    -------
    array, shape (n + degree + 1,)
    """
    return np.concatenate((np.zeros(degree), np.linspace(0.0, 1.0, n - degree + 1), np.ones(degree)))


def periodic_knots(n: int, degree: int) -> Array:
    """Uniform knots for a closed spline of ``n`` different control points, one period on [0, 1].

    Returns
    -------
    array, shape (n + 2 * degree + 1,)
        For a net whose first ``degree`` control points stand again at its end.
    """
    return np.arange(-degree, n + degree + 1) / n


def greville(knots: Array, degree: int) -> Array:
    """Abscissae at which control points of the identity map lie (Greville, 1967), shape (n,)."""
    return np.lib.stride_tricks.sliding_window_view(knots[1:-1], degree).mean(axis=1)


def sites_per_span(per_span: int, spans: int, minimum: int) -> int:
    """Sites in each of some spans: ``per_span``, or more where that would be fewer than ``fewest`` in all."""
    return max(per_span, -(-minimum // spans))


def check_knots(knots: Array, degree: int, n: int) -> None:
    """Raise InvalidKnotVector unless there are ``n + degree + 1`` knots that never decrease and span something."""
    if degree < 1:
        raise InvalidKnotVector(f"degree {degree} is no B-spline surface; use 2 to 5")
    if n < degree + 1:
        raise InvalidKnotVector(f"degree {degree} needs at least {degree + 1} control points, not {n}")
    if len(knots) != n + degree + 1:
        raise InvalidKnotVector(f"{n} control points of degree {degree} need {n + degree + 1} knots, not {len(knots)}")
    if (np.diff(knots) < 0).any():
        at = int(np.argmax(np.diff(knots) < 0))
        raise InvalidKnotVector(f"knot {at + 1} is smaller than knot {at}; knots must not decrease")
    if not knots[degree] < knots[n]:
        raise InvalidKnotVector("all knots of the domain are equal; the spline has no length")


def local_basis(u: Array, knots: Array, degree: int, order: int = 0) -> tuple[IntArray, Array]:
    """Evaluate the basis functions that are not zero at each parameter (The NURBS Book, eq. 2.5 and 2.7).

    Parameters
    ----------
    u : array, shape (m,)
        Parameters in ``[knots[degree], knots[-degree - 1]]``.
    knots : array, shape (n + degree + 1,)
    degree : int
    order : int
        Highest derivative wanted.

    Returns
    -------
    first : array of int, shape (m,)
        Index of the first function that is not zero.
    values : array, shape (order + 1, m, degree + 1)
        ``values[d, k, i]`` is the d-th derivative of function ``first[k] + i`` at ``u[k]``. Rows of ``values[0]``
        sum to one, rows of the derivatives to zero.
    """
    n = len(knots) - degree - 1
    span = np.clip(np.searchsorted(knots, u, side="right") - 1, degree, n - 1)
    # window[:, i] is knot span - degree + 1 + i: all knots that the functions of this span meet.
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
        for p in range(degree - d + 1, degree + 1):  # raise the d-th derivative back to the full degree
            ratio = p * part / (window[:, degree : degree + p] - window[:, degree - p : degree])
            part = np.zeros((len(u), p + 1))
            part[:, :-1] = -ratio
            part[:, 1:] += ratio
        values[d] = part
    return span - degree, values


def basis_functions(u: Array, knots: Array, degree: int) -> Array:
    """Every B-spline basis function at each parameter (The NURBS Book, eq. 2.5).

    Returns
    -------
    array, shape (m, n)
        ``N[k, i]`` is :math:`N_{i,p}(u_k)`. Rows sum to one.
    """
    first, values = local_basis(u, knots, degree)
    dense = np.zeros((len(u), len(knots) - degree - 1))
    np.put_along_axis(dense, first[:, None] + np.arange(degree + 1), values[0], axis=1)
    return dense


def basis_derivatives(u: Array, knots: Array, degree: int) -> tuple[Array, Array]:
    """Every B-spline basis function at each parameter, and its derivative there; shapes (m, n)."""
    first, values = local_basis(u, knots, degree, 1)
    dense = np.zeros((2, len(u), len(knots) - degree - 1))
    np.put_along_axis(dense, (first[:, None] + np.arange(degree + 1))[None], values, axis=2)
    return dense[0], dense[1]


@dataclass(frozen=True, eq=False)
class SpanPolynomials:
    """The basis functions of each knot span as polynomials of the way from its start to a parameter."""

    starts: Array  # (s,) where the spans begin
    lengths: Array  # (s,)
    first: IntArray  # (s,) index of the first basis function of each span
    coefficients: Array  # (s, degree + 1, degree + 1): function, power

    @classmethod
    def of(cls, knots: Array, degree: int) -> "SpanPolynomials":
        """Taylor expansions at the beginning of every span that is not empty."""
        inner = knots[degree : len(knots) - degree]
        starts, lengths = inner[:-1][np.diff(inner) > 0], np.diff(inner)[np.diff(inner) > 0]
        first, derivatives = local_basis(starts, knots, degree, degree)
        powers = np.arange(degree + 1)
        factorials = np.cumprod(np.maximum(powers, 1))
        return cls(starts, lengths, first, derivatives.transpose(1, 2, 0) / factorials)


@cache
def _derivatives(count: int, order: int) -> Array:
    """From ``count`` powers of a number to those and their derivatives up to ``order``, one after another."""
    blocks = [np.eye(count)]
    for _ in range(order):
        blocks.append(blocks[-1] @ np.diag(np.arange(1.0, count), 1))
    return np.concatenate(blocks, axis=1)


# Shares of a span where a surface is looked at for how it turns.
SPAN_FRACTIONS = np.array((0.0, 0.5))
MIN_LENGTH = 1e-12  # [m]


@dataclass(frozen=True, eq=False)
class BSplineSurface:
    """A tensor-product B-spline surface over (u, v) in [0, 1] x [0, 1], in the link frame [m].

    In a ``closed`` direction the net ends with copies of its first ``degree`` control points, the knots are
    periodic, and parameters wrap round. ``r_u x r_v`` points out of the robot. ``seam`` is a ray that tells on which
    side a way round begins, whatever the parameters there: a point within [m] and a unit direction.
    """

    control_net: Array  # (n_u, n_v, 3) [m]
    knots_u: Array  # (n_u + degree_u + 1,)
    knots_v: Array  # (n_v + degree_v + 1,)
    degree: tuple[int, int]
    closed: tuple[bool, bool] = (False, False)
    seam: Array | None = None  # (2, 3)

    def __post_init__(self):
        freeze(self, control_net=(None, None, 3), knots_u=(None,), knots_v=(None,))
        if self.seam is not None:
            freeze(self, seam=(2, 3))
        for knots, degree, n in zip((self.knots_u, self.knots_v), self.degree, self.control_net.shape):
            check_knots(knots, degree, n)

    def points(self, uv: Any) -> Array:
        """Points at parameters ``uv`` of shape (m, 2); shape (m, 3) [m]."""
        return self.derivatives(uv, order=0)[0, 0]

    def normals(self, uv: Any) -> Array:
        """Unit normals ``r_u x r_v`` out of the robot, shape (m, 3) (paper eq. 5, normalised)."""
        r = self.derivatives(uv, order=1)
        return unit(cross(r[1, 0], r[0, 1]))

    def derivatives(self, uv: Any, order: int = 1) -> Array:
        """Partial derivatives up to ``order``.

        Parameters
        ----------
        uv : array, shape (m, 2)
            Parameters; they wrap round where the surface is closed, and beyond an open edge it goes on straight.
        order : int

        Returns
        -------
        array, shape (order + 1, order + 1, m, 3)
            ``r[a, b]`` is :math:`\\partial^{a+b} S / \\partial u^a \\partial v^b`; those of more than ``order``
            in all are computed too.
        """
        span_u, span_v, (U, V) = self._monomials(self.wrap(uv).T, order)
        patches = self._patches[span_u, span_v]
        rows = np.matmul(U, patches).reshape(len(U), order + 1, V.shape[2], 3)
        return np.matmul(V[:, None], rows).transpose(1, 2, 0, 3)

    def _monomials(self, uv: Array, order: int) -> tuple[IntArray, IntArray, Array]:
        """Spans in which parameters (2, m) lie, and derivatives of the powers there, shape (2, m, order + 1, powers).

        Both directions at once: for few points that takes hardly longer than one. Beyond the ends of its domain a
        spline goes on along its tangent.
        """
        starts, (first, last), spans_u = self._steps
        inside = np.minimum(np.maximum(uv, first), last)
        step = np.empty(uv.shape, np.int64)
        for s, x, out in zip(self._spans, inside, step):
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
        values = product(powers.reshape(-1, count), _derivatives(count, most)).reshape(*uv.shape, most + 1, count)
        if leaves:
            values[:, :, 0] += beyond[..., None] * values[:, :, 1]
            values[beyond != 0, 2:] = 0.0
        return step[0], step[1] - spans_u, values[:, :, : order + 1]

    def wrap(self, uv: Any) -> Array:
        """Parameters with closed directions brought back into [0, 1), shape (m, 2)."""
        uv = np.array(uv, float).reshape(-1, 2)
        for axis in (0, 1):
            if self.closed[axis]:
                x = uv[:, axis]
                x -= np.floor(x)
                x[x == 1.0] = 0.0  # what lies just below zero is rounded up
        return uv

    def grid_points(self, u: Array, v: Array) -> Array:
        """Points at every pair of ``u`` and ``v``, shape (len(u), len(v), 3) [m]."""
        A = basis_functions(u, self.knots_u, self.degree[0])
        B = basis_functions(v, self.knots_v, self.degree[1])
        n, m, _ = self.control_net.shape
        rows = product(A, self.control_net.reshape(n, -1)).reshape(len(A), m, 3)
        return B @ rows  # one small product per row

    def grid_tangents(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Derivatives by u and by v at every pair of ``u`` and ``v``, shapes (len(u), len(v), 3) [m]."""
        A, along = basis_derivatives(u, self.knots_u, self.degree[0])
        B, across = basis_derivatives(v, self.knots_v, self.degree[1])
        n, m, _ = self.control_net.shape
        nets = self.control_net.transpose(0, 2, 1).reshape(n, -1)
        by_u, by_v = (
            product(product(rows, nets).reshape(-1, m), columns.T).reshape(len(u), 3, len(v)).transpose(0, 2, 1)
            for rows, columns in ((along, B), (A, across))
        )
        return by_u, by_v

    def turning(self, length: float) -> float:
        """By how much the normal turns at most on ways of this length, or less, along the coordinate lines [rad].

        What turns to and fro on less, as a surface does that follows the facets of a mesh, does not add up.
        """
        angles, per_length = self._turns
        return float(np.minimum(angles, per_length * length).max())

    @cached_property
    def _turns(self) -> tuple[Array, Array]:
        """Between points 1, 2, 4 ... half spans apart: the largest turn [rad], and the largest to its way [1/m]."""
        u, v = (spans.starts[:, None] + spans.lengths[:, None] * SPAN_FRACTIONS for spans in self._spans)
        r = self.derivatives(np.column_stack((np.repeat(u.ravel(), v.size), np.tile(v.ravel(), u.size))))
        points, normals = (x.reshape(u.size, v.size, 3) for x in (r[0, 0], unit(cross(r[1, 0], r[0, 1]))))
        turns = []
        for axis, closed in enumerate(self.closed):
            n = points.shape[axis]
            chords = np.linalg.norm(np.roll(points, -1, axis) - points, axis=2)
            done = np.cumsum(np.concatenate((np.zeros_like(chords.take([0], axis)), chords, chords), axis), axis)
            for parts in 2 ** np.arange(max(n // 2, 1).bit_length()):
                here = np.arange(n if closed else n - parts)
                there = here + parts
                cosines = (normals.take(there % n, axis) * normals.take(here, axis)).sum(axis=2)
                angles = np.arccos(np.clip(cosines, -1, 1))
                lengths = done.take(there, axis) - done.take(here, axis)
                turns.append((angles.max(), (angles / np.maximum(lengths, MIN_LENGTH)).max()))
        largest, per_length = np.transpose(turns)
        return largest, per_length

    @cached_property
    def _spans(self) -> tuple[SpanPolynomials, SpanPolynomials]:
        return SpanPolynomials.of(self.knots_u, self.degree[0]), SpanPolynomials.of(self.knots_v, self.degree[1])

    @cached_property
    def _steps(self) -> tuple[Array, Array, int]:
        """Where the spans in u and then those in v start; the ends of both domains, (2, 2, 1); how many are in u."""
        starts = np.concatenate([s.starts for s in self._spans])
        ends = np.array([(s.starts[0], s.starts[-1] + s.lengths[-1]) for s in self._spans]).T[..., None]
        return starts, ends, len(self._spans[0].starts)

    @cached_property
    def _patches(self) -> Array:
        """Polynomial coefficients of each pair of spans, shape (s_u, s_v, powers, powers * 3); both degrees alike."""
        (i, C), (j, D) = ((s.first[:, None] + np.arange(s.coefficients.shape[1]), s.coefficients) for s in self._spans)
        nets = self.control_net[i[:, None, :, None], j[None, :, None, :]]
        powers = max(self.degree) + 1
        patches = np.zeros((len(C), len(D), powers, powers, 3))
        patches[:, :, : C.shape[2], : D.shape[2]] = np.einsum("aik,abijc,bjl->abklc", C, nets, D, optimize=True)
        return patches.reshape(len(C), len(D), powers, -1)
