"""The tensor-product basis of a fit at its sample sites, and the least squares in it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.sparse.linalg import LinearOperator, cg

from ..arrays import Array, BoolArray, unit
from ..errors import UnderdeterminedFit
from .bspline import basis_functions, clamped_knots, periodic_knots
from .lines import LineGrid

SITES_PER_SPAN = 3
# Weight of the net's second differences beside 1 for a sample: they only say what holes leave open.
SMOOTHING = 1e-5


@dataclass(frozen=True, eq=False)
class TensorBasis:
    """Basis functions at the sample sites, one factor per direction.

    A surface point is ``N @ net @ M.T``; offsets of the control points move the surface by ``N @ offsets @ B.T``
    along the sample rays, for ``B`` carries the cosine between each line and the ray.
    """

    knots_u: Array
    knots_v: Array
    N: Array  # (k, n)
    M: Array  # (l, m); the repeated control points of a closed direction are folded in
    B: Array  # (l, m)
    repeats: int  # control points that a closed net repeats at its end
    shift: int  # how far a closed net is rolled, so that each line's basis function is centred on it

    @classmethod
    def of(cls, lines: LineGrid, degree_u: int, degree_v: int) -> "TensorBasis":
        """Basis for the lines of a grid, three sites per span.

        Raises
        ------
        UnderdeterminedFit
            If there are too few planes for the degree.
        """
        n, m = lines.origins.shape[:2]
        check_counts(n, degree_u, "u-planes")
        check_counts(m, degree_v, "v-lines")
        knots_u = clamped_knots(n, degree_u)
        N = basis_functions(np.linspace(0, 1, SITES_PER_SPAN * (n - degree_u) + 1), knots_u, degree_u)
        repeats = shift = 0
        if lines.closed:
            repeats, shift = degree_v, (degree_v - 1) // 2
            knots_v = periodic_knots(m, degree_v)
            M = basis_functions(np.arange(SITES_PER_SPAN * m) / (SITES_PER_SPAN * m), knots_v, degree_v)
            M[:, :degree_v] += M[:, m:]
            M = np.roll(M[:, :m], -shift, axis=1)
        else:
            knots_v = clamped_knots(m, degree_v)
            M = basis_functions(np.linspace(0, 1, SITES_PER_SPAN * (m - degree_v) + 1), knots_v, degree_v)
        common = unit(lines.directions.mean(axis=0))
        B = M * (unit(M @ common) @ common.T)
        return cls(knots_u, knots_v, N, M, B, repeats, shift)

    def blend(self, net: Array) -> Array:
        """Spline values at the sites, shape (k, l, 3), of a net (n, m, 3)."""
        n, m, _ = net.shape
        rows = (self.N @ net.reshape(n, -1)).reshape(-1, m, 3)
        return self.M @ rows

    def close(self, net: Array) -> Array:
        """The net as surfaces store it: rolled so that it starts a period, with the repeated points at its end."""
        net = np.roll(net, self.shift, axis=1)
        return np.concatenate((net, net[:, : self.repeats]), axis=1)

    @cached_property
    def _pseudo_inverses(self) -> tuple[Array, Array]:
        return pseudo_inverse(self.N), pseudo_inverse(self.B)

    def solve(self, residuals: Array, offsets: Array) -> Array:
        """Steps of the offsets, shape (n, m), that take most of the residuals (k, l); NaN ones weigh nothing."""
        known = ~np.isnan(residuals)
        if known.all():
            N_inverse, B_inverse = self._pseudo_inverses
            return N_inverse @ residuals @ B_inverse.T
        return self._solve_with_holes(np.where(known, residuals, 0.0), known, offsets)

    def _solve_with_holes(self, residuals: Array, known: BoolArray, offsets: Array) -> Array:
        """Conjugate gradients on the weighted normal equations; the factors of the whole precondition them.

        What the samples leave open is bent as little as may be.
        """
        n, m = offsets.shape
        N_inverse, B_inverse = self._pseudo_inverses
        bend_u, bend_v = second_differences(n, False), second_differences(m, self.repeats > 0)
        bend_u, bend_v = bend_u.T @ bend_u, bend_v.T @ bend_v

        def bending(net: Array) -> Array:
            return SMOOTHING * (bend_u @ net + net @ bend_v)

        def normal(step: Array) -> Array:
            net = step.reshape(n, m)
            return (self.N.T @ (known * (self.N @ net @ self.B.T)) @ self.B + bending(net)).ravel()

        def precondition(gradient: Array) -> Array:
            return (N_inverse @ (N_inverse.T @ gradient.reshape(n, m) @ B_inverse) @ B_inverse.T).ravel()

        A, P = (LinearOperator((n * m, n * m), f, dtype=float) for f in (normal, precondition))
        right = (self.N.T @ residuals @ self.B - bending(offsets)).ravel()
        return cg(A, right, M=P, rtol=1e-8, maxiter=500)[0].reshape(n, m)


def pseudo_inverse(matrix: Array) -> Array:
    """Of a matrix (k, n) of full column rank, through its QR factors; shape (n, k)."""
    q, r = np.linalg.qr(matrix)
    return solve_triangular(r, q.T, check_finite=False)


def second_differences(count: int, closed: bool) -> Array:
    """Matrix of second differences of ``count`` values, all round where ``closed``."""
    bend = np.eye(count) - 2 * np.roll(np.eye(count), 1, axis=1) + np.roll(np.eye(count), 2, axis=1)
    return bend if closed else bend[:-2]


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
