"""Group active taxels into connected components."""

import numpy as np

from ..common.arrays import BoolArray, IntArray

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


def component_counts(active: BoolArray, neighbours: IntArray) -> IntArray:
    """Return the numbers (T,) of connected components of many sets of active taxels.

    All sets are flooded at once, one component of each at a time: one whole number has a bit for each set.

    Parameters
    ----------
    active : array of bool, shape (T, n)
        Which taxels are active in each set.
    neighbours : array, shape (k, n)
        See :func:`components`.
    """
    count, n = active.shape
    packed = np.packbits(active.T, axis=1)
    left = [int.from_bytes(row.tobytes(), "big") for row in packed]  # bit t: active in set t, and not yet counted
    near = [[j for j in column if j < n] for column in neighbours.T.tolist()]
    counts = np.zeros(count, np.int64)
    while any(left):
        component, seen = [0] * n, 0
        for i, bits in enumerate(left):  # the first taxel that is left in each set
            component[i] = bits & ~seen
            seen |= bits
        before = None
        while before != component:
            before = component.copy()
            for i in (*range(n), *range(n - 1, -1, -1)):
                if left[i]:
                    grown = component[i]
                    for j in near[i]:
                        grown |= component[j]
                    component[i] = grown & left[i]
        left = [bits & ~found for bits, found in zip(left, component)]
        counts += np.unpackbits(np.frombuffer(seen.to_bytes(packed.shape[1], "big"), np.uint8), count=count)
    return counts


def _lowest(label: IntArray, adjacent: IntArray) -> IntArray:
    """Return the lowest label of the neighbours of each active taxel; the highest label if it has none."""
    return np.minimum.reduce(label.take(adjacent), axis=0, initial=len(label) - 1)
