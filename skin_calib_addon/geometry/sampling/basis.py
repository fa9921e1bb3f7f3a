"""The tensor-product basis of a fit at its sample sites, and the least squares in it."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.linalg import circulant, eigh, solve_triangular
from scipy.sparse.linalg import LinearOperator, cg

from ...common.arrays import Array, BoolArray, product, unit
from ...common.errors import UnderdeterminedFit
from ..surface.bspline import MIN_SITES, basis_functions, clamped_knots, periodic_knots, sites_per_span
from .lines import LineGrid

SITES_PER_SPAN = 3
SCHULZ_ITERATIONS = 3  # each squares the error of an inverse
INVERSE_TOLERANCE = 0.1  # to one, that a matrix times its inverse must be
# Stiffness that says what holes leave open: with a tenth of it, what hardly any sample holds swings far out over them.
HOLE_STIFFNESS = 1e-4


@dataclass(frozen=True, eq=False)
class SplineSites:
    """The basis functions of one direction at its sample sites; control point j belongs to line j."""

    knots: Array
    values: Array  # (k, n); the repeated control points of a closed direction are folded in
    repeats: int  # control points that a closed net repeats at its end
    shift: int  # how far a closed net is rolled, so that each line's basis function is centred on it

    @cached_property
    def inverse(self) -> Array:
        """Pseudo-inverse of ``values``, shape (n, k)."""
        return product(self.gram_inverse, self.values.T) if self.repeats else pseudo_inverse(self.values)

    @cached_property
    def gram_inverse(self) -> Array:
        """Inverse of ``values.T @ values``, shape (n, n): circulant where closed, else from the pseudo-inverse."""
        if not self.repeats:
            return product(self.inverse, self.inverse.T)
        first = product(self.values[:, :1].T, self.values)[0]
        return circulant(np.fft.irfft(1 / np.fft.rfft(first).real, len(first)))


@lru_cache(maxsize=256)
def spline_sites(
    count: int, degree: int, closed: bool, per_span: int = SITES_PER_SPAN, between: bool = False
) -> SplineSites:
    """Even sites for ``count`` control points: both ends among them, or all round where ``closed``.

    With ``between`` those in the middle of as many steps.
    """
    start = 0.5 if between else 0.0
    if not closed:
        knots = clamped_knots(count, degree)
        steps = max(per_span * (count - degree), count)  # a short spline has few spans
        sites = (np.arange(steps + (not between)) + start) / steps
        return SplineSites(knots, basis_functions(sites, knots, degree), 0, 0)
    knots, shift = periodic_knots(count, degree), (degree - 1) // 2
    values = basis_functions((np.arange(per_span * count) + start) / (per_span * count), knots, degree)
    values[:, :degree] += values[:, count:]
    return SplineSites(knots, np.roll(values[:, :count], -shift, axis=1), degree, shift)


@dataclass(frozen=True, eq=False)
class TensorBasis:
    """Basis functions at the sample sites of a grid, one factor per direction.

    A surface point is ``N @ net @ M.T``; offsets of the control points move the surface by ``N @ offsets @ B.T``
    along the sample rays, for ``B`` carries the cosine between each line and the ray.
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
        between: bool = False,
    ) -> "TensorBasis":
        """Basis for the lines of a grid, at so many sites per span, more where spans are few, or ``between`` so many.

        Raises
        ------
        UnderdeterminedFit
            If there are too few planes for the degree.
        """
        n, m = lines.origins.shape[:2]
        check_counts(n, degree_u, "u-planes")
        check_counts(m, degree_v, "v-lines")
        around = m if lines.closed else m - degree_v
        u = spline_sites(n, degree_u, False, sites_per_span(per_span, n - degree_u, MIN_SITES[False]), between)
        v = spline_sites(m, degree_v, lines.closed, sites_per_span(per_span, around, MIN_SITES[lines.closed]), between)
        common = unit(lines.directions.mean(axis=0))
        return cls(u, v, v.values * (unit(v.values @ common) @ common.T), degree_u, degree_v)

    @property
    def spans(self) -> int:
        """How many pieces the surface has between its knots."""
        n, m = self.N.shape[1], self.M.shape[1]
        return (n - self.degree_u) * (m if self.v.repeats else m - self.degree_v)

    @property
    def N(self) -> Array:
        """Basis functions along u, shape (k, n)."""
        return self.u.values

    @property
    def M(self) -> Array:
        """Basis functions along v, shape (l, m)."""
        return self.v.values

    def blend(self, net: Array) -> Array:
        """Spline values at the sites, shape (k, l, 3), of a net (n, m, 3)."""
        n, m, _ = net.shape
        rows = product(self.N, net.reshape(n, -1)).reshape(-1, m, 3)
        return self.M @ rows  # one small product per row

    def close(self, net: Array) -> Array:
        """The net as surfaces store it: rolled so that it starts a period, with the repeated points at its end."""
        net = np.roll(net, self.v.shift, axis=1)
        return np.concatenate((net, net[:, : self.v.repeats]), axis=1)

    def solve(self, residuals: Array, offsets: Array, stiffness: float = 0.0) -> Array:
        """Steps of the offsets, shape (n, m), that take most of the residuals (k, l); NaN ones weigh nothing.

        Least squares, plus ``stiffness`` times the squares of the second differences of the offsets that result.
        """
        known = ~np.isnan(residuals)
        if not known.all():
            return self._solve_with_holes(
                np.where(known, residuals, 0.0), known, offsets, max(stiffness, HOLE_STIFFNESS)
            )
        if not stiffness:
            return product(product(product(self.u.inverse, residuals), self.B), self._B_gram_inverse)
        right = product(product(self.N.T, residuals), self.B) - stiffness * self._bending(offsets)
        return self._solve_modes(right, stiffness)

    @cached_property
    def _B_gram_inverse(self) -> Array:
        """Inverse of ``B.T @ B``, shape (m, m), near enough for the passes to mend the rest.

        It is that of ``M``, which comes from QR factors that all grids of a size share, improved by Newton's iteration
        (Schulz, 1933), for the cosines in ``B`` take little of what ``M`` does where lines are close. Where they are
        not, they are few, and inverted as they are.
        """
        gram, inverse = product(self.B.T, self.B), self.v.gram_inverse
        for _ in range(SCHULZ_ITERATIONS):
            inverse = 2 * inverse - product(product(inverse, gram), inverse)
        off = np.abs(product(inverse, gram) - np.eye(len(gram))).max()
        return inverse if off < INVERSE_TOLERANCE else np.linalg.inv(gram)

    @cached_property
    def _modes(self) -> tuple[Array, Array, Array]:
        """Vectors (n, n) and (m, m) that make least squares and bending diagonal at once, and the bending (n, m)."""
        modes = [
            eigh(bending_matrix(len(factor.T), closed), product(factor.T, factor), check_finite=False)
            for factor, closed in ((self.N, False), (self.B, self.v.repeats > 0))
        ]
        (bend_u, U), (bend_v, V) = modes
        return U, V, bend_u[:, None] + bend_v

    def modes(self, offsets: Array) -> tuple[Array, Array]:
        """Offsets as amplitudes of modes of even weight in the residuals, and how much each bends; shapes (n, m)."""
        U, V, bend = self._modes
        gram_u, gram_v = product(self.N.T, self.N), product(self.B.T, self.B)
        return product(product(product(U.T, gram_u), offsets), product(gram_v, V)), bend

    def _solve_modes(self, right: Array, stiffness: float) -> Array:
        """Solve the normal equations of the whole, stiffness included."""
        U, V, bend = self._modes
        return product(product(U, product(product(U.T, right), V) / (1 + stiffness * bend)), V.T)

    def _bending(self, net: Array) -> Array:
        """Gradient of the squares of second differences, each direction weighted by the samples of the other."""
        bend_u, bend_v = bending_matrix(len(net), False), bending_matrix(net.shape[1], self.v.repeats > 0)
        by_v = product(product(bend_u, net), product(self.B.T, self.B))
        return by_v + product(product(product(self.N.T, self.N), net), bend_v)

    def _solve_with_holes(self, residuals: Array, known: BoolArray, offsets: Array, stiffness: float) -> Array:
        """Conjugate gradients on the weighted normal equations, in modes: there those of the whole are diagonal.

        They precondition, and only the rows and columns of sites that miss some are left to multiply.
        """
        U, V, bend = self._modes
        rows, columns = ((~known).any(axis=axis) for axis in (1, 0))
        hole = ~known[rows][:, columns]
        P, Q = product(self.N[rows], U), product(self.B[columns], V)
        whole = 1 + stiffness * bend

        def normal(step: Array) -> Array:
            amplitude = step.reshape(bend.shape)
            lost = hole * product(product(P, amplitude), Q.T)
            return (whole * amplitude - product(product(P.T, lost), Q)).ravel()

        def precondition(gradient: Array) -> Array:
            return (gradient.reshape(bend.shape) / whole).ravel()

        A, M = (LinearOperator((bend.size, bend.size), f, dtype=float) for f in (normal, precondition))
        right = product(product(self.N.T, residuals), self.B) - stiffness * self._bending(offsets)
        # What only the slight stiffness holds is the last to settle: to the same nanometre on every machine.
        amplitude = cg(A, product(product(U.T, right), V).ravel(), M=M, rtol=1e-12, maxiter=500)[0]
        return product(product(U, amplitude.reshape(bend.shape)), V.T)


def pseudo_inverse(matrix: Array) -> Array:
    """Of a matrix (k, n) of full column rank, through its QR factors; shape (n, k)."""
    q, r = np.linalg.qr(matrix)
    return solve_triangular(r, q.T, check_finite=False)


@lru_cache(maxsize=256)
def bending_matrix(count: int, closed: bool) -> Array:
    """Matrix of the sum of squared second differences of ``count`` values, all round where ``closed``."""
    bend: Array = np.eye(count)
    bend -= 2 * np.roll(np.eye(count), 1, axis=1)
    bend += np.roll(np.eye(count), 2, axis=1)
    bend = bend if closed else bend[:-2]
    return product(bend.T, bend)


def check_counts(count: int, degree: int, what: str) -> None:
    """Raise UnderdeterminedFit unless ``count`` planes carry a spline of this degree."""
    if not 2 <= degree <= 5:
        raise UnderdeterminedFit(f"degree {degree} is not available; use 2 to 5", degree=degree)
    if count < degree + 1:
        raise UnderdeterminedFit(
            f"degree {degree} needs at least {degree + 1} {what}, the grid has {count}; add planes or lower the degree",
            count=count,
            degree=degree,
        )
