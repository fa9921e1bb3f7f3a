"""The boundary of a region: closed loops of points on the mesh, inside which surface and skins stay."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray, ranges

BLOCK = 1 << 20  # [1] pairs of a point and an edge that are tested at once. It affects memory and time only.


@dataclass(frozen=True, eq=False)
class Boundary:
    """Loops in the parameters (s, t) of a region.

    A point is inside if a line from it along s crosses the edges an odd number of times. Loops can be inside others, as
    holes, and can go round a tube. Edges take the shorter of both paths round a tube.
    """

    starts: Array  # (e, 2) s and t of the first corner of each edge
    ends: Array  # (e, 2) of the second
    period: float  # of t; infinite over a face

    @classmethod
    def of(cls, loops: list[Array], period: float) -> "Boundary":
        """Return the boundary of loops."""
        return cls(np.concatenate(loops), np.concatenate([np.roll(loop, -1, axis=0) for loop in loops]), period)

    def contains(self, points: Array) -> BoolArray:
        """Return whether points are inside."""
        flat = points.reshape(-1, 2)
        count = max(1, BLOCK // max(1, int(np.diff(self._bands[1]).max())))
        inside = [self._contains(flat[k : k + count]) for k in range(0, len(flat), count)]
        return np.concatenate(inside or [np.zeros(0, bool)]).reshape(points.shape[:-1])

    def _contains(self, points: Array) -> BoolArray:
        s, t = points[:, 0], points[:, 1]
        corners, first, edges = self._bands
        band = (np.searchsorted(corners, self._wrapped(t), side="right") - 1) % len(corners)
        count = first[band + 1] - first[band]
        point, edge = np.repeat(np.arange(len(t)), count), edges[ranges(first[band], count)]
        before, after = self._across(self.starts[edge, 1] - t[point]), self._across(self.ends[edge, 1] - t[point])
        start, end = self.starts[edge, 0], self.ends[edge, 0]
        crossed = start - (end - start) * before / (after - before) > s[point]
        odd: BoolArray = np.bincount(point[crossed], minlength=len(points)) % 2 == 1
        return odd

    @cached_property
    def _bands(self) -> tuple[Array, IntArray, IntArray]:
        """The bands of t between corners, the last one also before the first corner, with the edges across each.

        Returns t of the corners in order, shape (c,), where the edges of each band begin, shape (c + 1,), and the
        edges, one band after the other. A corner has one side for both of its edges, so that no point is between them.
        """
        before, after = self._wrapped(self.starts[:, 1]), self._wrapped(self.ends[:, 1])
        corners = np.unique(before)
        low, high = np.sort(np.searchsorted(corners, (before, after)), axis=0)
        over_zero = np.abs(after - before) > self.period / 2
        low, high = np.where(over_zero, (high, low + len(corners)), (low, high))
        band = ranges(low, high - low) % len(corners)
        edge = np.repeat(np.arange(len(low)), high - low)[np.argsort(band, kind="stable")]
        return corners, np.append(0, np.cumsum(np.bincount(band, minlength=len(corners)))), edge

    def _wrapped(self, t: Array) -> Array:
        """Return t within one period from zero."""
        return t if np.isinf(self.period) else t - self.period * np.floor(t / self.period)

    def _across(self, t: Array) -> Array:
        """Return differences of t by the shorter path."""
        return t if np.isinf(self.period) else t - self.period * np.rint(t / self.period)
