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
    a = len(rows)
    place[rows] = np.arange(a)
    near = place[beside[:, rows]]  # (k, a), -1 where the neighbour is none or not active
    place[rows] = -1
    name = np.arange(a + 1)  # its last element, which -1 means, stays a: no name is higher
    while True:
        mine = name[:a]
        lowest = np.minimum.reduce(name[near], axis=0, initial=a)
        moves = lowest < mine
        if not np.count_nonzero(moves):
            break
        np.minimum.at(name, mine[moves], lowest[moves])
        shorter = name[name]
        while np.count_nonzero(shorter != name):
            name, shorter = shorter, shorter[shorter]
    return np.cumsum(mine == np.arange(a))[mine] - 1
