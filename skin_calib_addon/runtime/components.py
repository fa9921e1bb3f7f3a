"""Which active taxels hang together."""

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
    near = place.take(beside.take(rows, axis=1))  # (k, a), -1 where the neighbour is none or not active
    place[rows] = -1
    name = own  # its last element, which -1 means, stays the highest
    while True:
        mine = name[:none]
        lowest = np.minimum.reduce(name.take(near), axis=0, initial=none)
        moves = (lowest < mine).nonzero()[0]
        if len(moves) == 0:
            break
        name = name.copy()
        np.minimum.at(name, mine.take(moves), lowest.take(moves))
        for _ in range(none.bit_length()):  # each halves the way to the lowest name of a tree
            name = name.take(name)
    first = (mine == own[:none]).nonzero()[0]
    return first.searchsorted(mine)
