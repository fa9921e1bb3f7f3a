"""Cast fans of rays on mesh sections: how far along each ray the outermost surface lies."""

import numpy as np

from ..arrays import Array, BoolArray, IntArray

TURN = 2 * np.pi
DIAMOND_TURN = 4.0
# A ray through the end that two segments share may miss both by rounding; it counts as a hit within this share.
ROUNDING = 1e-9


class RayCaster:
    """Segments in planes, sorted once so that many fans of rays can be cast on them.

    Where the rays of a row all start at its centre, or all run in one direction, the segment under a ray is found by
    bisection of an abscissa: a measure of the angle about the centre, or the position across the direction. Rows in
    which segments lie over each other (inner shells, folds), and rays of no such order, are compared with all segments.

    Parameters
    ----------
    row : array of int, shape (s,)
        Row of each segment, ascending.
    ends : array, shape (s, 2, 2)
        Ends of each segment in the frame of its row [m].
    rows : int
    centres : array, shape (rows, 2), optional
        Where all rays of a row start.
    direction : array, shape (2,), optional
        Where all rays run to.
    """

    def __init__(
        self, row: IntArray, ends: Array, rows: int, centres: Array | None = None, direction: Array | None = None
    ):
        self.ends = ends
        self.bounds = np.searchsorted(row, np.arange(rows + 1))
        self.centres, self.across = centres, None
        begin: Array
        sweep: Array
        if centres is not None:
            angle = diamond_angle(ends - centres[row][:, None] if centres.any() else ends)
            sweep = angle[:, 1] - angle[:, 0]
            sweep -= DIAMOND_TURN * np.rint(sweep / DIAMOND_TURN)
            begin, sweep = np.minimum(angle[:, 0], angle[:, 0] + sweep), np.abs(sweep)
            begin += DIAMOND_TURN * (begin < 0)
            self.low, self.width = 0.0, DIAMOND_TURN
        elif direction is not None and len(ends):
            self.across = np.array((direction[1], -direction[0]))
            x = ends[..., 0] * self.across[0] + ends[..., 1] * self.across[1]
            begin, sweep = x.min(axis=1), x.max(axis=1) - x.min(axis=1)
            self.low = float(begin.min())
            self.width = 2 * float((begin + sweep).max() - self.low) or 1.0  # twice, so that rows keep apart
            begin = begin - self.low
        else:
            self.clean: BoolArray = np.zeros(rows, bool)
            return
        key = row * self.width + begin
        self.order: IntArray = np.argsort(key, kind="stable")
        self.key: Array = key[self.order]
        self.clean = self._clean(row, self.key + sweep[self.order], rows)

    def _clean(self, row: IntArray, stop: Array, rows: int) -> BoolArray:
        """Which rows have at most one segment over each abscissa; there the first hit is the only one."""
        following = np.append(self.key[1:], np.inf)
        first, last = self.bounds[:-1], self.bounds[1:] - 1
        filled = last >= first
        # The last segment of a row is followed by its first, one turn on; by nothing where the rays are parallel.
        following[last[filled]] = self.key[first[filled]] + self.width if self.across is None else np.inf
        overlaps = stop - following > ROUNDING * self.width
        return np.bincount(row[overlaps], minlength=rows) == 0

    def cast(self, origins: Array, directions: Array) -> tuple[Array, IntArray]:
        """Distance along each ray to the outermost segment of its row.

        Parameters
        ----------
        origins, directions : array, shape (rows, l, 2)
            Rays in the frame of their row; directions are unit vectors.

        Returns
        -------
        distance : array, shape (rows, l)
            [m]; NaN where the ray meets nothing.
        hit : array of int, shape (rows, l)
            Segment that was met; 0 where nothing was.
        """
        distance = np.full(origins.shape[:2], np.nan)
        hit = np.zeros(origins.shape[:2], np.int64)
        if len(self.ends) == 0:
            return distance, hit
        if self.clean.any():
            distance, hit = self._bisect(origins, directions)
        # A ray through a corner may have been given a segment of hardly any length there: misses are looked at again.
        open_ = np.isnan(distance) | ~self.clean[:, None]
        for i in np.flatnonzero(open_.any(axis=1)):
            segments = slice(self.bounds[i], self.bounds[i + 1])
            rays = open_[i]
            distance[i, rays], found = outermost(self.ends[segments], origins[i, rays], directions[i, rays])
            hit[i, rays] = np.where(np.isnan(distance[i, rays]), 0, found + self.bounds[i])
        return distance, hit

    def _bisect(self, origins: Array, directions: Array) -> tuple[Array, IntArray]:
        if self.across is None:
            x = diamond_angle(directions)
        else:
            x = np.clip(origins @ self.across - self.low, 0.0, self.width * (1 - ROUNDING))
        rows = np.arange(len(x))[:, None]
        place = np.searchsorted(self.key, rows * self.width + x, side="right") - 1
        first, last = self.bounds[:-1, None], self.bounds[1:, None] - 1
        # A ray before the first segment of its row can only lie on the last one, which crosses the zero angle.
        place = np.where(place < first, last, place)
        hit = self.order[np.clip(place, 0, None)]
        start = self.ends[hit, 0]
        step = self.ends[hit, 1] - start
        distance = crossing(start - origins, step, directions)
        distance[np.broadcast_to(last < first, distance.shape)] = np.nan
        return distance, hit


def diamond_angle(vectors: Array) -> Array:
    """A number in [0, 4) that grows with the angle of plane vectors (..., 2), without trigonometry."""
    x, y = vectors[..., 0], vectors[..., 1]
    size = np.abs(x) + np.abs(y)
    rise = y / np.where(size > 0, size, 1.0)
    angle = np.where(x < 0, 2 - rise, rise)
    return np.where(angle < 0, angle + DIAMOND_TURN, angle)


def crossing(offset: Array, step: Array, direction: Array) -> Array:
    """Distance along rays to segments that start at ``offset`` from them and run along ``step``; NaN for a miss."""
    turn = direction[..., 0] * step[..., 1] - direction[..., 1] * step[..., 0]
    turn = np.where(turn == 0, np.nan, turn)
    distance = (offset[..., 0] * step[..., 1] - offset[..., 1] * step[..., 0]) / turn
    part = (offset[..., 0] * direction[..., 1] - offset[..., 1] * direction[..., 0]) / turn
    return np.where((np.abs(part - 0.5) <= 0.5 + ROUNDING) & (distance > 0), distance, np.nan)


def outermost(ends: Array, origins: Array, directions: Array) -> tuple[Array, IntArray]:
    """Distance to the furthest crossing of each ray with any of the segments, and which; shapes (l,)."""
    if len(ends) == 0:
        return np.full(len(origins), np.nan), np.zeros(len(origins), np.int64)
    distance = crossing(ends[:, 0] - origins[:, None], ends[:, 1] - ends[:, 0], directions[:, None])
    hit = np.where(np.isnan(distance), -np.inf, distance).argmax(axis=1)
    return distance[np.arange(len(hit)), hit], hit
