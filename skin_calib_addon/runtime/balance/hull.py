"""Convex hulls that are exact: points stand on an integer grid, and every decision is the sign of an integer.

With rounded cross products two corners that differ in the last bit can cost half of the area; whatever epsilon is
chosen, some points lie just beside it.
"""

import math

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray

# Grid coordinates stay below 2**29: a grid below a nanometre for a foot, and whole numbers that floats hold exactly.
GRID_BITS = 29
SMALLEST = -1074  # the exponent of the smallest number: on that grid every float lies exactly
FEW = 12  # points that came since the last hull and are sooner put to its corners than found among all
GridPoint = tuple[int, int]


def grid_step(size: float) -> float:
    """The finest power of two [m] on whose grid coordinates up to ``size`` are below 2**29; under 1 nm for a foot."""
    step = math.ldexp(1.0, max(math.frexp(size)[1] - GRID_BITS, SMALLEST))
    return step if round(size / step) < 2**GRID_BITS else 2 * step


class HullTable:
    """Points of which some, other ones each time, have a convex hull; what does not change is worked out once.

    The last hull is remembered: a contact that moves wins and loses a few cells in a cycle, and mostly no corner.

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
        points = points.reshape(len(points), points.size // (2 * len(points)) if len(points) else 1, 2)
        size = float(np.abs(points).max(initial=0.0))
        if not math.isfinite(size):
            raise ValueError("a point of a convex hull must be finite")
        self.step = grid_step(size)
        whole = np.rint(points / self.step).astype(np.int64)
        places, rank = np.unique(whole.reshape(-1, 2), axis=0, return_inverse=True)
        self._places: list[GridPoint] = list(map(tuple, places.tolist()))  # sorted; points in one place are one
        self._rank = rank.reshape(points.shape[:2])
        self._y = places[:, 1].copy()
        self._last: tuple[BoolArray, list[GridPoint]] = np.zeros(len(places), bool), []  # which, and their hull

    @property
    def size(self) -> int:
        """How many rows there are."""
        return len(self._rank)

    def hull(self, rows: IntArray) -> list[GridPoint]:
        """Corners of the hull of some rows' points, in steps of the grid, counter-clockwise from the leftmost.

        No corner lies on the line of its neighbours. One point, or many in one place, give one corner; points on a line
        give its two ends; none give none.
        """
        among = np.zeros(len(self._places), bool)
        among[self._rank.take(rows, axis=0)] = True
        before, corners = self._last
        came = (among > before).nonzero()[0].tolist()
        if len(came) > FEW or any(self._places[k] in corners for k in (before > among).nonzero()[0].tolist()):
            corners = self._hull(among.nonzero()[0])
        elif came:  # what goes and was no corner changes no hull
            ordered = sorted([*corners, *(self._places[k] for k in came)])
            corners = _joined(ordered, ordered[::-1])
        self._last = among, corners
        return corners.copy()

    def _hull(self, chosen: IntArray) -> list[GridPoint]:
        """Corners of the hull of some places, which ascend."""
        if len(chosen) < 2:
            return [self._places[k] for k in chosen.tolist()]
        first, last = int(chosen[0]), int(chosen[-1])
        y, between = self._y.take(chosen), chosen[1:-1]
        low, high = (between[_steps(heights)].tolist() for heights in (-y, y))
        below = [self._places[k] for k in (first, *low, last)]
        above = [self._places[k] for k in (last, *high[::-1], first)]
        return _joined(below, above)


def _joined(below: list[GridPoint], above: list[GridPoint]) -> list[GridPoint]:
    """The hull of points of which the lower half is among the first ones, ordered, the upper half among the others."""
    return below if len(below) < 2 else _left_turns(below)[:-1] + _left_turns(above)[:-1]


def _steps(heights: IntArray) -> BoolArray:
    """Which of n points, sorted by x and then y, can be corners of the upper half of their hull: (n - 2,) bool.

    A corner of the upper half is the outermost point in some direction that leans to one side; on the other side all
    points are lower than it. Few others are higher than all before, or than all behind them. The first and the last
    point, which are corners of both halves, are not asked.
    """
    before, behind = np.maximum.accumulate(heights), np.maximum.accumulate(heights[::-1])[::-1]
    return heights[1:-1] > np.minimum(before[:-2], behind[2:])


def _left_turns(ordered: list[GridPoint]) -> list[GridPoint]:
    """The part of the hull that turns left from the first to the last of ordered points."""
    chain: list[GridPoint] = []
    for x, y in ordered:
        while len(chain) > 1:
            bx, by = chain[-1]
            ax, ay = chain[-2]
            if (bx - ax) * (y - ay) > (by - ay) * (x - ax):
                break
            del chain[-1]
        chain.append((x, y))
    return chain
