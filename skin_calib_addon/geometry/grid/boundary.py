"""The boundary of a region: closed loops of points on the mesh, inside which surface and skins stay."""

from dataclasses import dataclass

import numpy as np

from ...common.arrays import Array, BoolArray

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
        """Return the boundary of loops.

        Parameters
        ----------
        loops : list of array, shape (k, 2)
            s and t of the corners of each loop, in order.
        period : float
            Of t; infinite over a face.

        Returns
        -------
        Boundary
        """
        return cls(np.concatenate(loops), np.concatenate([np.roll(loop, -1, axis=0) for loop in loops]), period)

    def contains(self, points: Array) -> BoolArray:
        """Return whether points are inside.

        Parameters
        ----------
        points : array, shape (..., 2)
            s and t; NaN is outside.

        Returns
        -------
        array of bool, shape (...)
        """
        flat = points.reshape(-1, 2)
        count = max(1, BLOCK // len(self.starts))
        inside = [self._contains(flat[k : k + count]) for k in range(0, len(flat), count)]
        return np.concatenate(inside or [np.zeros(0, bool)]).reshape(points.shape[:-1])

    def _contains(self, points: Array) -> BoolArray:
        s, t = points[:, 0], points[:, 1:]
        before, after = self._across(self.starts[:, 1] - t), self._across(self.ends[:, 1] - t)
        # A corner has one side for both of its edges, so that no point is between them.
        point, edge = np.nonzero((before > 0) != (after > 0))
        before, after = before[point, edge], after[point, edge]
        start, end = self.starts[edge, 0], self.ends[edge, 0]
        at = start - (end - start) * before / (after - before)
        crossed = (np.abs(after - before) < self.period / 2) & (at > s[point])
        odd: BoolArray = np.bincount(point[crossed], minlength=len(points)) % 2 == 1
        return odd

    def _across(self, t: Array) -> Array:
        """Return differences of t by the shorter path."""
        return t if np.isinf(self.period) else t - self.period * np.rint(t / self.period)
