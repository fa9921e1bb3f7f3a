"""Group active taxels into connected components."""

import heapq

import numpy as np

from ..common.arrays import BoolArray, IntArray


def components(rows: IntArray, neighbours: IntArray, scratch: IntArray) -> IntArray:
    """Return the number of the connected component of each active taxel, shape (a,).

    The components have the numbers 0, 1, 2..., in the order of their first taxels. Each taxel takes the lowest label of
    its neighbours, and pointer jumping carries it through whole trees of labels (Shiloach & Vishkin 1982). A thousand
    taxels need about ten rounds, for any shape.
    """
    own = np.arange(len(rows) + 1)
    none = len(rows)
    scratch[rows] = own[:none]
    adjacent = scratch.take(neighbours.take(rows, axis=1))  # (k, a), -1 for no neighbour and for inactive ones
    scratch[rows] = -1
    label = own.copy()  # its last element, to which -1 refers, stays the highest
    np.minimum(own[:none], _lowest(own, adjacent), out=label[:none])
    while True:
        for _ in range(none.bit_length()):  # each halves the distance to the lowest label of a tree
            label = label.take(label)
        current, lowest = label[:none], _lowest(label, adjacent)
        changed = (lowest < current).nonzero()[0]
        if len(changed) == 0:
            break
        np.minimum.at(label, current.take(changed), lowest.take(changed))
    first = (current == own[:none]).nonzero()[0]
    return first.searchsorted(current)


def component_counts(active: BoolArray, neighbours: IntArray) -> IntArray:
    """Return the numbers (T,) of connected components of many sets of active taxels.

    Taxels are removed one by one. The neighbours of a removed one become neighbours of each other, so that no component
    falls apart. A taxel without neighbours is the last one of its component. All sets are processed at once: one whole
    number has a bit for each set. Removing the taxel with the fewest neighbours first keeps their number low.
    """
    count, n = active.shape
    packed = np.packbits(active.T, axis=1)
    width = packed.shape[1]
    bits = [int.from_bytes(row.tobytes(), "big") for row in packed]
    links: list[dict[int, int]] = [  # in which sets two taxels are neighbours
        {j: bits[i] & bits[j] for j in column if j < n and bits[i] & bits[j]}
        for i, column in enumerate(neighbours.T.tolist())
    ]
    queue = [(len(others), i) for i, others in enumerate(links)]
    heapq.heapify(queue)
    last = []
    while queue:
        degree, i = heapq.heappop(queue)
        others, left = links[i], bits[i]  # sets in which it has had no neighbour so far
        if len(others) > degree:
            heapq.heappush(queue, (len(others), i))
            continue
        while others:
            j, near = others.popitem()
            del links[j][i]
            first, left = near & left, left & ~near
            if first:  # in these sets all other neighbours of i become neighbours of j
                for k, near in others.items():
                    if first & near:
                        links[j][k] = links[k][j] = links[j].get(k, 0) | (first & near)
        if left:
            last.append(left.to_bytes(width, "big"))
    table = np.frombuffer(b"".join(last), np.uint8).reshape(len(last), width)
    return np.unpackbits(table, axis=1, count=count).sum(axis=0, dtype=np.int64)


def _lowest(label: IntArray, adjacent: IntArray) -> IntArray:
    """Return the lowest label (a,) of the neighbours (k, a) of active taxels; the highest label if it has none."""
    return np.minimum.reduce(label.take(adjacent), axis=0, initial=len(label) - 1)
