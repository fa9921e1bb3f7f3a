"""The tensor-product basis of a fit at its sample sites, and the least squares in this basis."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.linalg import circulant, eigh, solve_triangular, solveh_banded

from ...common.arrays import Array, BoolArray, IntArray, unit
from ...common.errors import UnderdeterminedFit
from ..surface.bspline import MIN_SITES, basis_functions, clamped_knots, local_basis, periodic_knots, sites_per_span
from .lines import LineGrid

# [1] sample sites in each span, per direction. Larger: less aliasing with facets, more time.
SITES_PER_SPAN = 3
# [1] Newton-Schulz iterations; each squares the error of an inverse matrix. Larger: no effect after convergence.
SCHULZ_ITERATIONS = 3
# [1] largest deviation of a matrix times its approximate inverse from the identity. Above it, the exact inverse is
# computed. Larger: fewer exact inverses, more iterations of the fit.
INVERSE_TOLERANCE = 0.1
# [1] stiffness that regularizes the surface over holes. Ten times less lets control points with few samples drift;
# larger flattens the surface over holes.
HOLE_STIFFNESS = 1e-4
# [fraction of the largest diagonal element] added to the normal equations with holes, so that there is a solution where
# hardly any sample is known. Larger: surfaces move towards where they were.
RIDGE = 1e-13


@dataclass(frozen=True, eq=False)
class SplineSites:
    """The basis functions of one direction at its sample sites; control point j belongs to line j."""

    knots: Array
    values: Array  # (k, n); the repeated control points of a closed direction are folded in
    repeats: int  # number of control points that a closed net repeats at its end
    shift: int  # columns by which a closed net is rolled, so that each basis function is centred on its line

    @cached_property
    def inverse(self) -> Array:
        """Return the pseudo-inverse of ``values``, shape (n, k)."""
        return pseudo_inverse(self.values)

    @cached_property
    def gram_inverse(self) -> Array:
        """Return the inverse of ``values.T @ values``, shape (n, n); it is circulant if the direction is closed."""
        if not self.repeats:
            return self.inverse @ self.inverse.T
        first = self.values[:, 0] @ self.values
        return circulant(np.fft.irfft(1 / np.fft.rfft(first).real, len(first)))


@lru_cache(maxsize=256)
def spline_sites(count: int, degree: int, closed: bool, per_span: int = SITES_PER_SPAN) -> SplineSites:
    """Return even sites for the control points of one direction."""
    if not closed:
        knots = clamped_knots(count, degree)
        steps = max(per_span * (count - degree), count)  # a short spline has few spans
        sites = np.arange(steps + 1) / steps
        return SplineSites(knots, basis_functions(sites, knots, degree), 0, 0)
    knots, shift = periodic_knots(count, degree), (degree - 1) // 2
    values = basis_functions(np.arange(per_span * count) / (per_span * count), knots, degree)
    values[:, :degree] += values[:, count:]
    return SplineSites(knots, np.roll(values[:, :count], -shift, axis=1), degree, shift)


@dataclass(frozen=True, eq=False)
class TensorBasis:
    r"""Basis functions at the sample sites of a grid, one factor per direction.

    The points of the surface are ``N @ net @ M.T``. Changes of the offsets move the surface along the sample rays by
    ``N @ changes @ B.T``, where ``B`` contains the cosine between each line and the ray:

    .. math::

        B_{lj} = M_j(v_l)\, (\mathbf{d}_j \cdot \mathbf{r}_l)
    """

    u: SplineSites
    v: SplineSites
    B: Array  # (l, m)
    degree_u: int
    degree_v: int

    @classmethod
    def of(
        cls,
        lines: LineGrid,
        degree_u: int,
        degree_v: int,
        per_span: int = SITES_PER_SPAN,
    ) -> "TensorBasis":
        """Return the basis for the lines of a grid."""
        n, m = lines.origins.shape[:2]
        check_counts(n, degree_u, "u-planes")
        check_counts(m, degree_v, "v-lines")
        around = m if lines.closed else m - degree_v
        u = spline_sites(n, degree_u, False, sites_per_span(per_span, n - degree_u, MIN_SITES[False]))
        v = spline_sites(m, degree_v, lines.closed, sites_per_span(per_span, around, MIN_SITES[lines.closed]))
        common = unit(lines.directions.mean(axis=0))
        return cls(u, v, v.values * (unit(v.values @ common) @ common.T), degree_u, degree_v)

    @property
    def is_closed(self) -> bool:
        """Return whether the surface is closed along v."""
        return self.v.repeats > 0

    @property
    def spans_by_axis(self) -> tuple[int, int]:
        """Return the number of polynomial pieces along u and along v."""
        n, m = self.N.shape[1], self.M.shape[1]
        return n - self.degree_u, m if self.is_closed else m - self.degree_v

    @property
    def spans(self) -> int:
        """Return the number of polynomial pieces of the surface."""
        along_u, along_v = self.spans_by_axis
        return along_u * along_v

    @property
    def N(self) -> Array:
        """Return the basis functions along u, shape (k, n)."""
        return self.u.values

    @property
    def M(self) -> Array:
        """Return the basis functions along v, shape (l, m)."""
        return self.v.values

    def blend(self, net: Array) -> Array:
        """Return the spline values at the sites, shape (k, l, 3), of a net (n, m, 3)."""
        n, m, _ = net.shape
        rows = (self.N @ net.reshape(n, -1)).reshape(-1, m, 3)
        return self.M @ rows  # one small product per row

    def close(self, net: Array) -> Array:
        """Return the net as surfaces store it: rolled to the start of a period, with the repeated points at its end."""
        net = np.roll(net, self.v.shift, axis=1)
        return np.concatenate((net, net[:, : self.v.repeats]), axis=1)

    def at(self, sites: Array) -> tuple[IntArray, Array]:
        """Return the control points (k, c) with an influence at sites (k, 2), and values and derivatives (3, k, c)."""
        first, parts = [], []
        for axis, (direction, degree) in enumerate(((self.u, self.degree_u), (self.v, self.degree_v))):
            count, spans = len(direction.values), self.spans_by_axis[axis]
            steps = count if direction.repeats else count - 1
            x = sites[:, axis] / steps
            x = x % 1.0 if direction.repeats else np.clip(x, -0.5 / spans, 1 + 0.5 / spans)
            start, (values, slopes) = local_basis(x, direction.knots, degree, 1)
            first.append(start[:, None] + np.arange(degree + 1))
            parts.append((values, slopes / steps))
        m = self.M.shape[1]
        columns = (first[1] - self.v.shift) % m
        index = (first[0][:, :, None] * m + columns[:, None]).reshape(len(sites), -1)
        (N, by_u), (M, by_v) = parts
        pairs = (N, M), (by_u, M), (N, by_v)
        return index, np.stack([(a[:, :, None] * b[:, None]).reshape(len(sites), -1) for a, b in pairs])

    def solve(self, residuals: Array, offsets: Array, stiffness: float = 0.0) -> Array:
        r"""Return the least-squares step of the offsets.

        With the residuals :math:`E` [m] and the basis matrices :math:`N` and :math:`B`, the step without stiffness is

        .. math::

            \min_{\delta X} \lVert N\, \delta X\, B^{T} - E \rVert^2
            \quad\Rightarrow\quad
            \delta X = N^{+} E\, (B^{+})^{T}

        A stiffness :math:`\lambda` adds the squared second differences of the resulting offsets :math:`X + \delta X`:

        .. math::

            \lambda \left( \lVert D_u (X + \delta X) B^{T} \rVert^2 + \lVert N (X + \delta X) D_v^{T} \rVert^2 \right)
        """
        known = ~np.isnan(residuals)
        if not known.all():
            return self._solve_with_holes(
                np.where(known, residuals, 0.0), known, offsets, max(stiffness, HOLE_STIFFNESS)
            )
        if not stiffness:
            return self.u.inverse @ residuals @ self.B @ self._B_gram_inverse
        right = self.N.T @ residuals @ self.B - stiffness * self._bending(offsets)
        return self._solve_modes(right, stiffness)

    @cached_property
    def _B_gram_inverse(self) -> Array:
        """Return the inverse of ``B.T @ B``, shape (m, m), with an error that the iterations of the fit correct.

        The start is the inverse for ``M``, which all grids of a size have in common. The cosines in ``B`` change it
        little if the lines are close to each other. Newton-Schulz iterations ``X <- 2 X - X A X`` (Schulz, 1933)
        correct it. If the lines are far from each other, they are few, and the exact inverse is computed.
        """
        gram, inverse = self.B.T @ self.B, self.v.gram_inverse
        for _ in range(SCHULZ_ITERATIONS):
            inverse = 2 * inverse - inverse @ gram @ inverse
        off = np.abs(inverse @ gram - np.eye(len(gram))).max()
        return inverse if off < INVERSE_TOLERANCE else np.linalg.inv(gram)

    @cached_property
    def _modes(self) -> tuple[Array, Array, Array]:
        """Return the vectors (n, n) and (m, m) that diagonalize least squares and bending, and the bending (n, m)."""
        modes = [
            eigh(bending_matrix(len(factor.T), closed), factor.T @ factor, check_finite=False)
            for factor, closed in ((self.N, False), (self.B, self.v.repeats > 0))
        ]
        (bend_u, U), (bend_v, V) = modes
        return U, V, bend_u[:, None] + bend_v

    def modes(self, offsets: Array) -> tuple[Array, Array]:
        """Return the offsets as amplitudes of modes with equal weight in the residuals, and the bending; (n, m)."""
        U, V, bend = self._modes
        gram_u, gram_v = self.N.T @ self.N, self.B.T @ self.B
        return U.T @ gram_u @ offsets @ (gram_v @ V), bend

    def leverages(self, stiffness: float) -> tuple[Array, Array, Array]:
        """Return the variances (k, l) of height, step along u, step along v, for samples with noise of variance one."""
        U, V, bend = self._modes
        P, Q = self.N @ U, self.B @ V
        step_v = (np.roll(Q, -1, axis=0) - np.roll(Q, 1, axis=0)) / 2 if self.is_closed else np.gradient(Q, axis=0)
        pairs = (P, Q), (np.gradient(P, axis=0), Q), (P, step_v)
        height, step_u, step_v = (a**2 @ (1 / (1 + stiffness * bend)) @ (b**2).T for a, b in pairs)
        return height, step_u, step_v

    def _solve_modes(self, right: Array, stiffness: float) -> Array:
        """Solve the normal equations without holes, including stiffness."""
        U, V, bend = self._modes
        return U @ (U.T @ right @ V / (1 + stiffness * bend)) @ V.T

    def _bending(self, net: Array) -> Array:
        """Return the gradient of the squared second differences, weighted by the samples of the other direction."""
        bend_u, bend_v = bending_matrix(len(net), False), bending_matrix(net.shape[1], self.v.repeats > 0)
        by_v = bend_u @ net @ (self.B.T @ self.B)
        return by_v + self.N.T @ self.N @ net @ bend_v

    def _solve_with_holes(self, residuals: Array, known: BoolArray, offsets: Array, stiffness: float) -> Array:
        r"""Solve the weighted normal equations directly: plane by plane their matrix has a narrow band.

        The block of the planes i and j, which have common sites only if they differ by at most the degree, is

        .. math::

            A_{ij} = \sum_k N_{ki} N_{kj}\, B^T W_k B + \lambda \left( (D_u^T D_u)_{ij}\, B^T B
                + (N^T N)_{ij}\, D_v^T D_v \right)

        with the known samples of each row k on the diagonal of :math:`W_k`.
        """
        (n, m), B = offsets.shape, self.B
        bend_u, bend_v = bending_matrix(n, False), bending_matrix(m, self.is_closed)
        gram_u, gram_v = self.N.T @ self.N, B.T @ B
        of_rows = np.stack([B.T @ (row[:, None] * B) for row in known.astype(float)]).reshape(len(known), -1)
        band, (a, b) = np.zeros(((self.degree_u + 1) * m, n * m)), np.indices((m, m))
        for step in range(min(self.degree_u + 1, n)):
            pairs = ((self.N[:, : n - step] * self.N[:, step:]).T @ of_rows).reshape(-1, m, m)
            pairs += stiffness * np.diagonal(bend_u, step)[:, None, None] * gram_v
            pairs += stiffness * np.diagonal(gram_u, step)[:, None, None] * bend_v
            below = step * m + a - b
            columns = m * np.arange(n - step)[:, None] + b[below >= 0]
            band[np.broadcast_to(below[below >= 0], columns.shape), columns] = pairs[:, below >= 0]
        band[0] += RIDGE * band[0].max()
        right = self.N.T @ residuals @ B - stiffness * self._bending(offsets)
        return np.asarray(solveh_banded(band, right.ravel(), lower=True, check_finite=False)).reshape(n, m)


def pseudo_inverse(matrix: Array) -> Array:
    """Return the pseudo-inverse of a matrix (k, n) of full column rank, from its QR factors; shape (n, k)."""
    q, r = np.linalg.qr(matrix)
    return solve_triangular(r, q.T, check_finite=False)


@lru_cache(maxsize=256)
def bending_matrix(count: int, closed: bool) -> Array:
    """Return the matrix (count, count) of the sum of squared second differences of some values."""
    bend: Array = np.eye(count)
    bend -= 2 * np.roll(np.eye(count), 1, axis=1)
    bend += np.roll(np.eye(count), 2, axis=1)
    bend = bend if closed else bend[:-2]
    return bend.T @ bend


def check_counts(count: int, degree: int, what: str) -> None:
    """Check that a number of planes or lines is enough for a spline of a degree."""
    if not 2 <= degree <= 5:
        raise UnderdeterminedFit(f"Degree {degree} is not available. Use 2 to 5.", degree=degree)
    if count < degree + 1:
        raise UnderdeterminedFit(
            f"Degree {degree} needs at least {degree + 1} {what}, but the grid has {count}. "
            f"Add {what}, or lower the degree.",
            count=count,
            degree=degree,
        )
