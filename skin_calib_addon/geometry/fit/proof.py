"""Whether a surface keeps within a tolerance: bounds of its distances, made exact only as far as the proof needs."""

from collections.abc import Callable

import numpy as np

from ...common.arrays import Array, IntArray

MIN_DISTANCE = 1e-300  # [m]
FIRST_BATCH, BATCH_GROWTH = (
    256,
    2,
)  # distances that are made exact in a first round, and by what that grows from round to round


def confirmed_error(
    bounds: Array, areas: Array, exact: Callable[[IntArray], Array], measure: str, tolerance: float
) -> float:
    """A mean or largest distance: proved not to be exceeded if within the tolerance, else about what it is [m].

    Distances are made exact, a few of all sizes first and then from the largest bound on, until the proof stands or the
    others would have to shrink more than those few did.

    Parameters
    ----------
    bounds : array, shape (k,)
        What the distances do not exceed [m]; infinite where nothing is known.
    areas : array, shape (k,)
        That each stands for.
    exact : function
        Of indices (i,): the distances themselves, shape (i,) [m].
    measure : "mean" or "max"
    """
    if len(bounds) == 0:
        return np.inf
    weights = areas / areas.sum()

    def statistic(distances: Array) -> float:
        return float((weights * distances).sum() if measure == "mean" else distances.max())

    bounds, order = bounds.copy(), np.argsort(-bounds, kind="stable")
    first = np.isinf(bounds[order])
    first[:: max(len(bounds) // FIRST_BATCH, 1)] = True  # large and small ones, which tell how much others may shrink
    order, batch, done = np.concatenate((order[first], order[~first])), int(first.sum()), 0
    error, shrunk = statistic(bounds), 1.0
    while error > tolerance and done < len(order):
        chosen = order[done : done + batch]
        before = bounds[chosen]
        bounds[chosen] = exact(chosen)
        if done == 0:
            finite = np.isfinite(before)
            shrunk = bounds[chosen][finite].sum() / max(before[finite].sum(), MIN_DISTANCE)
        done, batch, error = done + len(chosen), BATCH_GROWTH * batch, statistic(bounds)
        likely = bounds.copy()
        likely[order[done:]] *= shrunk
        if statistic(likely) > tolerance:
            return statistic(likely)
    return error
