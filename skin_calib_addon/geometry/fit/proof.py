"""Confirm that a surface is within a tolerance: bounds of its distances, made exact only where necessary."""

from collections.abc import Callable

import numpy as np

from ...common.arrays import Array, IntArray

MIN_DISTANCE = 1e-300  # [m] lower bound of a distance in a denominator or a logarithm
# [1] exact distances that the first round computes. Larger: a better estimate of the other distances, more time.
FIRST_BATCH = 256


def confirmed_error(
    bounds: Array, areas: Array, exact: Callable[[IntArray], Array], measure: str, tolerance: float
) -> float:
    """Return the mean or largest distance: an upper bound if it is within the tolerance, else an estimate [m].

    The bounds of the distances are replaced by exact distances, first for a sample of all sizes, then from the largest
    bound on. This stops when the tolerance is confirmed. It also stops when the other distances would have to be
    smaller, relative to their bounds, than those of the sample.

    Parameters
    ----------
    bounds : array, shape (k,)
        Upper bounds of the distances [m]; infinite where nothing is known.
    areas : array, shape (k,)
        Area of each sample [m^2].
    exact : function
        Returns the exact distances of indices (i,), shape (i,) [m].
    measure : "mean" or "max"
        The statistic.
    tolerance : float
        [m]

    Returns
    -------
    float
        [m]
    """
    if len(bounds) == 0:
        return np.inf
    weights = areas / areas.sum()

    def statistic(distances: Array) -> float:
        return float((weights * distances).sum() if measure == "mean" else distances.max())

    bounds, order = bounds.copy(), np.argsort(-bounds, kind="stable")
    first = np.isinf(bounds[order])
    first[:: max(len(bounds) // FIRST_BATCH, 1)] = True  # of all sizes, to estimate the ratio of distances to bounds
    order, batch, done = np.concatenate((order[first], order[~first])), int(first.sum()), 0
    error, shrunk = statistic(bounds), 1.0
    while error > tolerance and done < len(order):
        chosen = order[done : done + batch]
        before = bounds[chosen]
        bounds[chosen] = exact(chosen)
        if done == 0:
            finite = np.isfinite(before)
            shrunk = bounds[chosen][finite].sum() / max(before[finite].sum(), MIN_DISTANCE)
        done, batch, error = done + len(chosen), 2 * batch, statistic(bounds)
        likely = bounds.copy()
        likely[order[done:]] *= shrunk
        if statistic(likely) > tolerance:
            return statistic(likely)
    return error
