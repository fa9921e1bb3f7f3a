"""Convex hulls that are exact: points stand on an integer grid, and every decision is the sign of an integer.

With rounded cross products two corners that differ in the last bit can cost half of the area; whatever epsilon is
chosen, some points lie just beside it.
"""

import math

import numpy as np

from ..arrays import Array, BoolArray, IntArray

# Grid coordinates stay below 2**29: a grid below a nanometre for a foot, and whole numbers that floats hold exactly.
GRID_BITS = 29
GridPoint = tuple[int, int]


def grid_step(size: float) -> float:
    """The finest power of two [m] on whose grid coordinates up to ``size`` are below 2**29; under 1 nm for a foot."""
    return math.ldexp(1.0, max(math.frexp(size)[1] - GRID_BITS, -1000))


class HullTable:
    """Points of which some, other ones each time, have a convex hull; what does not change is worked out once.

    Parameters
    ----------
    points : array, shape (n, 2) or (n, k, 2)
        One point, or k, for each of n rows [m].

    Raises
    ------
    ValueError
        If a coordinate is not finite: such a point has no place.
    """

    def __init__(self, points: Array):
        points = np.asarray(points, float)
        points = points.reshape(len(points), -1, 2)
        size = float(np.abs(points).max(initial=0.0))
        if not math.isfinite(size):
            raise ValueError("a point of a convex hull must be finite")
        self.step = grid_step(size)
        whole = np.rint(points / self.step).astype(np.int64)
        places, rank = np.unique(whole.reshape(-1, 2), axis=0, return_inverse=True)
        self._places: list[GridPoint] = list(map(tuple, places.tolist()))  # sorted; points in one place are one
        self._rank = rank.reshape(points.shape[:2])
        self._y = places[:, 1].copy()
        self._among = np.zeros(len(places), bool)  # room to work in, left as it is

    @property
    def size(self) -> int:
        """How many rows there are."""
        return len(self._rank)

    def hull(self, rows: IntArray) -> list[GridPoint]:
        """Corners of the hull of some rows' points, in steps of the grid, counter-clockwise from the leftmost.

        No corner lies on the line of its neighbours. One point, or many in one place, give one corner; points on a line
        give its two ends; none give none.
        """
        self._among[self._rank[rows]] = True
        chosen = self._among.nonzero()[0]
        self._among[chosen] = False
        return hull_of_sorted([self._places[k] for k in chosen[_steps(self._y[chosen])].tolist()])


def _steps(y: IntArray) -> BoolArray:
    """Which points, sorted by x and then y, are higher or lower than all before, or than all behind them.

    A corner of the hull is the outermost point in some direction; of the two sides, on the one away from which that
    direction leans all points are lower than it, or higher. Few others are.
    """
    keep = np.ones(len(y), bool)
    before, behind = y[:-1], y[1:]
    high, low = np.maximum.accumulate(before), np.minimum.accumulate(before)
    keep[1:] = (behind > high) | (behind < low)
    high, low = np.maximum.accumulate(behind[::-1])[::-1], np.minimum.accumulate(behind[::-1])[::-1]
    keep[:-1] |= (before > high) | (before < low)
    keep[:1] = keep[-1:] = True
    return keep


def hull_of_sorted(ordered: list[GridPoint]) -> list[GridPoint]:
    """Corners of the hull of points sorted by x, then y, each once: Andrew's monotone chain (1979)."""
    if len(ordered) < 3:
        return ordered
    return _left_turns(ordered)[:-1] + _left_turns(ordered[::-1])[:-1]


def _left_turns(ordered: list[GridPoint]) -> list[GridPoint]:
    """The part of the hull that turns left from the first to the last of ordered points."""
    chain: list[GridPoint] = []
    for x, y in ordered:
        while len(chain) > 1:
            (ax, ay), (bx, by) = chain[-2], chain[-1]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0:
                break
            chain.pop()
        chain.append((x, y))
    return chain
