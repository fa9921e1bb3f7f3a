"""Values between rows and columns of nodes, for the preview of a fine sheet."""

from functools import lru_cache

import numpy as np
from scipy.interpolate import make_interp_spline

from ...common.arrays import Array, locked
from .net import Lines

DEGREE = 3  # of the splines through the nodes; fewer nodes than four have the largest degree that they allow


@lru_cache(maxsize=32)  # rows and columns change one at a time
def spline_matrix(kept: Lines, sites: Lines, derivative: int = 0) -> Array:
    """Return the matrix that maps values at some lines of nodes to those of their spline, shape (sites, kept)."""
    spline = make_interp_spline(kept, np.eye(len(kept)), k=min(DEGREE, len(kept) - 1))
    return locked(np.ascontiguousarray(spline(np.asarray(sites, float), nu=derivative)))


def between(values: Array, rows: Array, columns: Array) -> Array:
    """Return values between lines of nodes, shape (a, b, c)."""
    p, q, c = values.shape
    across = (rows @ values.reshape(p, -1)).reshape(-1, q, c)
    parts = [np.ascontiguousarray(across[..., k]) @ columns.T for k in range(c)]
    return np.stack(parts, axis=2)
