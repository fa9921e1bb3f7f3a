"""Splines through the nodes of lines: for the first guess of a sheet, and for the preview of a fine one."""

from functools import lru_cache

import numpy as np

from ...common.arrays import Array, locked
from ...geometry.surface.bspline import local_basis
from .net import Lines

DEGREE = 3  # of the splines through the nodes; fewer nodes than four have the largest degree that they allow


@lru_cache(maxsize=32)  # rows and columns change one at a time
def spline_matrix(kept: Lines, sites: Lines, derivative: int = 0) -> Array:
    """Return the matrix that maps values at some lines of nodes to those of their spline, shape (sites, kept)."""
    return locked(interpolation(np.asarray(kept, float), np.asarray(sites, float), derivative))


def interpolation(nodes: Array, sites: Array, derivative: int = 0) -> Array:
    """Return the matrix (m, n) from values at ``nodes`` (n,) to their spline, or a derivative of it, at ``sites`` (m,).

    The second and the last but one node are no knots ("not a knot"): no condition at the ends is needed.
    """
    degree = min(DEGREE, len(nodes) - 1)
    knots = np.concatenate((np.repeat(nodes[0], degree + 1), nodes[2:-2], np.repeat(nodes[-1], degree + 1)))

    def basis(at: Array, order: int) -> Array:
        first, values = local_basis(at, knots, degree, order)
        dense = np.zeros((len(at), len(nodes)))
        np.put_along_axis(dense, first[:, None] + np.arange(degree + 1), values[order], axis=1)
        return dense

    return np.ascontiguousarray(np.linalg.solve(basis(nodes, 0).T, basis(sites, derivative).T).T)


def between(values: Array, rows: Array, columns: Array) -> Array:
    """Return values between lines of nodes, shape (a, b, c)."""
    p, q, c = values.shape
    across = (rows @ values.reshape(p, -1)).reshape(-1, q, c)
    parts = [np.ascontiguousarray(across[..., k]) @ columns.T for k in range(c)]
    return np.stack(parts, axis=2)
