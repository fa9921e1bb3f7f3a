"""Which active taxels hang together."""

from functools import reduce

import numpy as np

from ..arrays import IntArray


def components(rows: IntArray, beside: IntArray, place: IntArray) -> IntArray:
    """Number of the group of each active taxel, shape (a,): groups hang together over neighbours.

    Groups are numbered from 0 by their first taxel. Each taxel takes the lowest name among its neighbours', whole trees
    of names at a time (Shiloach & Vishkin 1982): some ten rounds for a thousand taxels, whatever the shape.

    Parameters
    ----------
    rows : array, shape (a,)
        Rows of the active taxels, ascending.
    beside : array, shape (k, n)
        Rows of the neighbours of each of n taxels, n where there is none.
    place : array, shape (n + 1,)
        All -1, and left so: room to work in, so that the cost follows the active taxels.
    """
    own = np.arange(len(rows) + 1)
    none = len(rows)
    place[rows] = own[:none]
    near = place[beside[:, rows]]  # (k, a), -1 where the neighbour is none or not active
    place[rows] = -1
    name = own  # its last element, which -1 means, stays the highest
    while True:
        mine = name[:none]
        lowest = reduce(np.minimum, name[near], mine)
        moves = (lowest < mine).nonzero()[0]
        if len(moves) == 0:
            break
        name = name.copy()
        np.minimum.at(name, mine[moves], lowest[moves])
        shorter = name[name]
        while np.count_nonzero(shorter != name):
            name, shorter = shorter, shorter[shorter]
    first = (mine == own[:none]).nonzero()[0]
    return np.searchsorted(first, mine)
