"""The curves of one section: chains of segments, the outer curve, and the order of its intersections with rays."""

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray
from ..components import components

# [fraction of the rays] that must hit a curve last, and this fraction must also intersect it 1, 3, 5 ... times, for it
# to be the outer curve. Below, the outside consists of several parts. Larger: fewer sections with one outer curve.
OUTER_RAY_FRACTION = 0.8
# [fraction of the rays] A fold that more rays hit is a wall behind a wall; there the outermost branch counts. Larger:
# wider folds are followed.
MAX_FOLD_FRACTION = 0.05


def curves(ends: Array, row: IntArray | int = 0) -> IntArray:
    """Return the curve (s,) of each segment; ends (s, 2, 2) in one row that are equal to the bit are connected."""
    x, y = ends.reshape(-1, 2).T
    rows = np.repeat(np.broadcast_to(row, len(ends)), 2)
    order = np.lexsort((y, x, rows))
    new = [np.diff(values[order]) != 0 for values in (rows, x, y)]
    node = np.zeros(len(x), np.int64)
    node[order[1:]] = np.cumsum(np.logical_or.reduce(new))
    a, b = node.reshape(-1, 2).T
    return components(2 * len(ends), a, b)[a]


def outer_curve(curve: IntArray, ray: IntArray, segment: IntArray, distance: Array) -> BoolArray | None:
    """Return which segments form the outer curve of a section: the curve that most rays hit last."""
    if len(ray) == 0:
        return None
    order = np.lexsort((distance, ray))
    last = order[np.append(ray[order][1:] != ray[order][:-1], True)]
    numbers, counts = np.unique(curve[segment[last]], return_counts=True)
    outer = numbers[counts.argmax()]
    often = (curve[segment[last]] == outer).mean()
    crossings = np.bincount(ray[curve[segment] == outer])
    leaving = (crossings % 2 == 1).sum() / len(last)
    return curve == outer if often > OUTER_RAY_FRACTION and leaving > OUTER_RAY_FRACTION else None


def fold_distances(ray: IntArray, distance: Array, rays: int) -> tuple[IntArray, Array]:
    """Return the distance along the rays that intersect a fold of a curve: the alternating sum of their intersections.

        d = d_1 - d_2 + d_3 - ...

    This continues from one branch of the fold to the other without a jump, and has equal areas on both of its sides.
    """
    count = np.bincount(ray, minlength=rays)
    folded = short_runs((count > 1) & (count % 2 == 1), int(MAX_FOLD_FRACTION * rays))
    order = np.lexsort((distance, ray))
    rank = np.arange(len(ray)) - np.searchsorted(ray, ray)  # ``order`` keeps ``ray`` sorted
    signed = np.bincount(ray, np.where(rank % 2 == 0, 1.0, -1.0) * distance[order], minlength=rays)
    return folded, np.asarray(signed[folded], np.float64)


def short_runs(chosen: BoolArray, longest: int) -> IntArray:
    """Return the indices of the chosen elements of a circle in runs of limited length."""
    if chosen.all() or not chosen.any():
        return np.empty(0, np.int64)
    start = int(np.argmin(chosen))  # an element that is not chosen, so that no run crosses the end
    rolled = np.roll(chosen, -start)
    run = np.cumsum(~rolled)
    narrow = rolled & (np.bincount(run, rolled)[run] <= longest)
    return (np.flatnonzero(narrow) + start) % len(chosen)
