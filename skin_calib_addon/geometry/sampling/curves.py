"""The curves of one section: chains of segments, which of them is the outer one, and the order of its crossings."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...common.arrays import Array, BoolArray, IntArray

# A curve that rays meet last at least this often is the outer one; where it is not, several parts make the outside.
OUTER_RAY_FRACTION = 0.8
# A fold that more than this share of the rays meet is a wall behind a wall, and its outermost branch counts.
MAX_FOLD_FRACTION = 0.05


def curves(ends: Array) -> IntArray:
    """Number of the curve that each segment of a section belongs to, shape (s,): chains over ends equal to the bit.

    Parameters
    ----------
    ends : array, shape (s, 2, 2)
        [m]
    """
    _, node = np.unique(ends.reshape(-1, 2) @ np.array((1, 1j)), return_inverse=True)
    a, b = node.reshape(-1, 2).T
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(2 * len(ends),) * 2)
    return connected_components(graph, directed=False)[1][a].astype(np.int64)


def outer_curve(ends: Array, ray: IntArray, segment: IntArray, distance: Array) -> BoolArray | None:
    """Which segments make the outer curve of a section: the one that most rays meet last.

    Parameters
    ----------
    ends : array, shape (s, 2, 2)
        [m]
    ray, segment, distance : array, shape (c,)
        Crossings of even rays with the segments.

    Returns
    -------
    array of bool, shape (s,), or None
        None where several parts make the outside, or most rays cross the curve an even number of times: it does not
        go round the axis, and has an inner side that is as long as the outer one.
    """
    if len(ray) == 0:
        return None
    curve = curves(ends)
    order = np.lexsort((distance, ray))
    last = order[np.append(ray[order][1:] != ray[order][:-1], True)]
    outer = np.bincount(curve[segment[last]]).argmax()
    often = (curve[segment[last]] == outer).mean()
    crossings = np.bincount(ray[curve[segment] == outer])
    odd = (crossings % 2 == 1).sum() / len(last)
    return curve == outer if often > OUTER_RAY_FRACTION and odd > OUTER_RAY_FRACTION else None


def fold_distances(ray: IntArray, distance: Array, rays: int) -> tuple[IntArray, Array]:
    """Distance along the rays that cross a fold of a curve: out and back again over the crossings, in order.

    Out to the first crossing, back to the second, out to the third: that runs on from one branch of the fold to the
    other without a jump, and leaves as much area on its one side as on its other.

    Parameters
    ----------
    ray, distance : array, shape (c,)
        All crossings with one curve; ``ray`` ascends.
    rays : int
        How many rays there are, the first being the neighbour of the last.

    Returns
    -------
    folded : array of int, shape (f,)
        Which rays cross a fold.
    distance : array, shape (f,)
        [m]
    """
    count = np.bincount(ray, minlength=rays)
    folded = short_runs((count > 1) & (count % 2 == 1), int(MAX_FOLD_FRACTION * rays))
    order = np.lexsort((distance, ray))
    rank = np.arange(len(ray)) - np.searchsorted(ray, ray)  # ``ray`` is sorted, and stays so in this order
    signed = np.bincount(ray, np.where(rank % 2 == 0, 1.0, -1.0) * distance[order], minlength=rays)
    return folded, np.asarray(signed[folded], np.float64)


def short_runs(chosen: BoolArray, longest: int) -> IntArray:
    """Indices of the chosen that stand in runs of at most ``most``, the last being a neighbour of the first."""
    if chosen.all() or not chosen.any():
        return np.empty(0, np.int64)
    start = int(np.argmin(chosen))  # one that is not chosen, so that no run crosses the end
    rolled = np.roll(chosen, -start)
    run = np.cumsum(~rolled)
    narrow = rolled & (np.bincount(run, rolled)[run] <= longest)
    return (np.flatnonzero(narrow) + start) % len(chosen)
