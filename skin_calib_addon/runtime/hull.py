"""Compute exact convex hulls: points are rounded to an integer grid, and every decision is the sign of an integer.

With rounded cross products, two corners that differ in the last bit can remove half of the area. A tolerance does not
help: for every tolerance there are points just below it.
"""

import math

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray

# Bits of a grid coordinate. Derived: products of two coordinates must be exact in 64 bits. The grid of a foot is finer
# than a nanometre.
GRID_BITS = 29
MIN_EXPONENT = -1074  # Derived: exponent of the smallest double-precision number; every number is on that grid
GridPoint = tuple[int, int]


def grid_step(size: float) -> float:
    """Return the smallest power of two [m] with which coordinates up to ``size`` are below 2**29 steps."""
    step = math.ldexp(1.0, max(math.frexp(size)[1] - GRID_BITS, MIN_EXPONENT))
    return step if round(size / step) < 2**GRID_BITS else 2 * step


class HullTable:
    """A set of points that computes the convex hull of some of them."""

    def __init__(self, points: Array):
        points = np.asarray(points, float)
        points = points.reshape(len(points), points.size // (2 * len(points)) if len(points) else 1, 2)
        size = float(np.abs(points).max(initial=0.0))
        if not math.isfinite(size):
            raise ValueError("a point of a convex hull must be finite; check the coordinates for NaN and infinity")
        self.step = grid_step(size)
        whole = np.rint(points / self.step).astype(np.int64)
        distinct, rank = np.unique(whole.reshape(-1, 2), axis=0, return_inverse=True)
        self._points: list[GridPoint] = list(map(tuple, distinct.tolist()))  # sorted; equal points are one
        self._rank = rank.reshape(points.shape[:2])
        self._heights = np.stack((-distinct[:, 1], distinct[:, 1]))  # for the lower and the upper half of a hull

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self._rank)

    def hull(self, rows: IntArray) -> list[GridPoint]:
        """Return the corners of the hull of the points of rows (k,), in grid steps, counter-clockwise from the left.

        No three neighbouring corners are on a line. Equal points give one corner, points on a line two, no rows none.
        """
        is_chosen = np.zeros(len(self._points), bool)
        is_chosen[self._rank.take(rows, axis=0)] = True
        chosen = is_chosen.nonzero()[0]
        if len(chosen) < 3:
            return [self._points[k] for k in chosen.tolist()]
        low, high = (chosen[mask].tolist() for mask in _upper_candidates(self._heights.take(chosen, axis=1)))
        below, above = ([self._points[k] for k in half] for half in (low, high[::-1]))
        return _left_turns(below)[:-1] + _left_turns(above)[:-1]


def _upper_candidates(heights: IntArray) -> BoolArray:
    """Return which points (..., n), sorted by x and then y, can be corners of the upper hull.

    A corner of the upper hull is higher than all points before it, or than all points after it. Few other points are.
    The first and the last point are corners.
    """
    before = np.maximum.accumulate(heights, axis=-1)
    after = np.maximum.accumulate(heights[..., ::-1], axis=-1)[..., ::-1]
    can_be = np.ones(heights.shape, bool)
    np.greater(heights[..., 1:-1], np.minimum(before[..., :-2], after[..., 2:]), out=can_be[..., 1:-1])
    return can_be


def _left_turns(ordered: list[GridPoint]) -> list[GridPoint]:
    """Return the chain that turns left from the first to the last of sorted points (Andrew's monotone chain)."""
    chain: list[GridPoint] = []
    for point in ordered:
        x, y = point
        while len(chain) > 1:
            bx, by = chain[-1]
            ax, ay = chain[-2]
            if (bx - ax) * (y - ay) > (by - ay) * (x - ax):
                break
            del chain[-1]
        chain.append(point)
    return chain
