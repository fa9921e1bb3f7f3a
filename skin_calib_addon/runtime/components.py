"""Which active taxels hang together."""

import numpy as np

from ..common.arrays import IntArray

USUAL = 3  # as many jumps take round contacts to their lowest names; what is longer takes more from the second round on


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
    name = own.copy()  # its last element, which -1 means, stays the highest
    np.minimum(own[:none], _lowest(own, near), out=name[:none])
    jumps = USUAL
    while True:
        for _ in range(jumps):  # each halves the way to the lowest name of a tree
            name = name.take(name)
        mine, lowest = name[:none], _lowest(name, near)
        moves = (lowest < mine).nonzero()[0]
        if len(moves) == 0:
            break
        np.minimum.at(name, mine.take(moves), lowest.take(moves))
        jumps = none.bit_length()
    first = (mine == own[:none]).nonzero()[0]
    return first.searchsorted(mine)


def _lowest(name: IntArray, near: IntArray) -> IntArray:
    """The lowest name among the neighbours of each active taxel; the highest of all where it has none."""
    return np.minimum.reduce(name.take(near), axis=0, initial=len(name) - 1)
