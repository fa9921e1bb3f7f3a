"""Group active taxels into connected components."""

import numpy as np

from ..common.arrays import IntArray

# Jumps of the first round: enough for compact contacts. Longer contacts take more jumps from the second round on.
# Larger: more work for compact contacts; smaller: more rounds for long ones.
FIRST_ROUND_JUMPS = 3


def components(rows: IntArray, neighbours: IntArray, scratch: IntArray) -> IntArray:
    """Return the number of the connected component of each active taxel, shape (a,).

    The components have the numbers 0, 1, 2..., in the order of their first taxels. Each taxel takes the lowest label of
    its neighbours, and pointer jumping carries it through whole trees of labels (Shiloach & Vishkin 1982). A thousand
    taxels need about ten rounds, for any shape.

    Parameters
    ----------
    rows : array, shape (a,)
        Rows of the active taxels, in ascending order.
    neighbours : array, shape (k, n)
        Rows of the neighbours of each of the n taxels; n means no neighbour.
    scratch : array, shape (n + 1,)
        Working memory; -1 everywhere before and after the call. With it the cost depends on the active taxels only.
    """
    own = np.arange(len(rows) + 1)
    none = len(rows)
    scratch[rows] = own[:none]
    adjacent = scratch.take(neighbours.take(rows, axis=1))  # (k, a), -1 for no neighbour and for inactive ones
    scratch[rows] = -1
    label = own.copy()  # its last element, to which -1 refers, stays the highest
    np.minimum(own[:none], _lowest(own, adjacent), out=label[:none])
    jumps = FIRST_ROUND_JUMPS
    while True:
        for _ in range(jumps):  # each halves the distance to the lowest label of a tree
            label = label.take(label)
        current, lowest = label[:none], _lowest(label, adjacent)
        changed = (lowest < current).nonzero()[0]
        if len(changed) == 0:
            break
        np.minimum.at(label, current.take(changed), lowest.take(changed))
        jumps = none.bit_length()
    first = (current == own[:none]).nonzero()[0]
    return first.searchsorted(current)


def _lowest(label: IntArray, adjacent: IntArray) -> IntArray:
    """Return the lowest label of the neighbours of each active taxel; the highest label if it has none."""
    return np.minimum.reduce(label.take(adjacent), axis=0, initial=len(label) - 1)
