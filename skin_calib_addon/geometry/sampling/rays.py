"""Cast fans of rays on mesh sections: the distance along each ray to the outer curve of the section."""

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray, ranges
from .curves import curves, fold_distances, outer_curve

TURN = 2 * np.pi
DIAMOND_TURN = 4.0  # one turn as a ``diamond_angle``
# [fraction of a segment, or of a triangle's side] A ray through the common end of two segments, or the common side of
# two triangles, may miss both by rounding; it counts as a hit within this fraction. Larger: hits beyond open ends.
HIT_TOLERANCE = 1e-9
# [1] rays that determine the outer curve of a section. Larger: smaller parts are seen, more time.
PROBE_RAYS = 64


class RayCaster:
    """Segments in planes, sorted once, so that many fans of rays can be cast on them.

    If the rays of a row all start at its centre, or are all parallel, bisection finds the segment that a ray hits. The
    key is an abscissa: a measure of the angle about the centre, or the position across the direction. If segments of a
    row overlap in this abscissa, the row keeps only its outer curve, if it has one (see ``curves.outer_curve``). Where
    this curve folds back, rays follow it in order (``curves.fold_distances``). Without an outer curve the outermost
    segment counts. All other rays are compared with all segments.
    """

    def __init__(
        self, row: IntArray, ends: Array, rows: int, centres: Array | None = None, direction: Array | None = None
    ):
        self.centres, self.direction = centres, direction
        self.ordered = len(row) > 0 and (centres is not None or direction is not None)
        self.segment: IntArray = np.arange(len(row))  # index in the caller's arrays
        self.followed: BoolArray = np.zeros(rows, bool)
        self._sort(row, ends, rows)
        if self.ordered and not self.clean.all():
            long = (ends[:, 0] != ends[:, 1]).any(axis=1)  # a plane may cut a face only in one corner
            if not long.all():
                self.segment, row, ends = self.segment[long], row[long], ends[long]
                self._sort(row, ends, rows)
        if self.ordered and not self.clean.all():
            kept = self._outer_curves(ends)
            self.segment = self.segment[kept]
            self._sort(row[kept], ends[kept], rows)

    def _sort(self, row: IntArray, ends: Array, rows: int) -> None:
        """Sort the segments by their abscissae, and find the rows without overlapping segments."""
        self.ends = ends
        self.bounds = np.searchsorted(row, np.arange(rows + 1))
        if not self.ordered:
            self.clean: BoolArray = np.zeros(rows, bool)
            return
        begin: Array
        sweep: Array
        if self.centres is not None:
            angle = diamond_angle(ends - self.centres[row][:, None] if self.centres.any() else ends)
            sweep = angle[:, 1] - angle[:, 0]
            sweep -= DIAMOND_TURN * np.rint(sweep / DIAMOND_TURN)
            begin, sweep = np.minimum(angle[:, 0], angle[:, 0] + sweep), np.abs(sweep)
            begin += DIAMOND_TURN * (begin < 0)
            self.low, self.width = 0.0, DIAMOND_TURN
        else:
            assert self.direction is not None
            self.across: Array = np.array((self.direction[1], -self.direction[0]))
            x = ends[..., 0] * self.across[0] + ends[..., 1] * self.across[1]
            begin = np.minimum(x[:, 0], x[:, 1])
            sweep = np.maximum(x[:, 0], x[:, 1]) - begin
            self.low = float(begin.min())
            self.width = 2 * float((begin + sweep).max() - self.low) or 1.0  # twice the extent separates the rows
            begin = begin - self.low
        key = row * self.width + begin
        self.order: IntArray = np.argsort(key, kind="stable")
        self.key: Array = key[self.order]
        self.stop: Array = self.key + sweep[self.order]
        self.row = row
        # By component, in the order of the abscissae.
        self.start, stop = (np.stack([ends[:, i, c][self.order] for c in (0, 1)]) for i in (0, 1))
        self.step = stop - self.start
        self.clean = self._clean(rows)

    def _clean(self, rows: int) -> BoolArray:
        """Return which rows have at most one segment at each abscissa, so that the first hit is the only one."""
        following = np.append(self.key[1:], np.inf)
        first, last = self.bounds[:-1], self.bounds[1:] - 1
        filled = last >= first
        # After the last segment of a row follows its first one, plus one turn; nothing follows if the rays are
        # parallel.
        following[last[filled]] = self.key[first[filled]] + self.width if self.centres is not None else np.inf
        overlaps = self.stop - following > HIT_TOLERANCE * self.width
        return np.bincount(self.row[overlaps], minlength=rows) == 0

    @property
    def folds(self) -> BoolArray:
        """Return the rows in which the outer curve folds back, shape (rows,): some rays intersect it more than once."""
        return self.followed & ~self.clean

    @property
    def parts(self) -> BoolArray:
        """Return the rows in which segments overlap and no curve is the outer one, shape (rows,)."""
        return ~self.followed & ~self.clean if self.ordered else np.zeros(len(self.clean), bool)

    def folded_segments(self, i: int) -> Array:
        """Return the segments of row ``i`` with an abscissa that other segments have too, shape (s, 2, 2) [m]."""
        index = slice(self.bounds[i], self.bounds[i + 1])
        begin, stop = self.key[index], np.sort(self.stop[index])
        middle = (begin + self.stop[index]) / 2
        here = np.searchsorted(begin, middle, side="right") - np.searchsorted(stop, middle)
        if self.centres is not None:  # segments across angle zero
            here += len(stop) - np.searchsorted(stop, middle + self.width)
        return self.ends[self.order[index][here > 1]]

    def _outer_curves(self, ends: Array) -> BoolArray:
        """Return which segments are kept, shape (s,): in rows with overlaps, those of the outer curve."""
        rows = np.flatnonzero(~self.clean)
        origins, directions = (np.zeros((len(self.clean), PROBE_RAYS, 2)) for _ in range(2))
        origins[rows], directions[rows] = self._probes(rows)
        probe, segment, distance = self._crossings(origins, directions, rows)
        kept = np.ones(len(ends), bool)
        row = probe // PROBE_RAYS
        overlaps = np.flatnonzero(~self.clean[self.row])
        curve_of = np.zeros(len(ends), np.int64)
        curve_of[overlaps] = curves(ends[overlaps], self.row[overlaps])
        for i in rows:
            index, mine = slice(self.bounds[i], self.bounds[i + 1]), slice(*np.searchsorted(row, (i, i + 1)))
            crossings = (probe[mine] % PROBE_RAYS, segment[mine] - self.bounds[i], distance[mine])
            curve = outer_curve(curve_of[index], *crossings)
            if curve is not None:
                kept[index], self.followed[i] = curve, True
        return kept

    def _probes(self, rows: IntArray) -> tuple[Array, Array]:
        """Return origins and directions of even rays over some rows, shapes (len(rows), PROBE_RAYS, 2)."""
        part = (np.arange(PROBE_RAYS) + 0.5) / PROBE_RAYS
        if self.centres is not None:
            directions = np.column_stack((np.cos(TURN * part), np.sin(TURN * part)))
            return self.centres[rows][:, None], directions
        assert self.direction is not None
        first = self.key[self.bounds[rows]] - rows * self.width
        last = np.maximum.reduceat(self.stop, self.bounds[rows]) - rows * self.width
        x = self.low + first[:, None] + (last - first)[:, None] * part
        below = (self.ends @ self.direction).min() - self.width
        return x[..., None] * self.across + below * self.direction, self.direction

    def cast(self, origins: Array, directions: Array) -> tuple[Array, IntArray]:
        """Return the distance (rows, l) [m] along rays to the outer curve of their row, or NaN, and the segment."""
        distance = np.full(origins.shape[:2], np.nan)
        hit = np.zeros(origins.shape[:2], np.int64)
        if len(self.ends) == 0:
            return distance, hit
        if self.clean.any():
            distance, hit = self._bisect(origins, directions)
        if self.ordered and not self.clean.all():
            self._cast_overlapping(origins, directions, distance, hit)
        # Bisection may give a ray through a corner or a rim the adjacent segment, so misses are cast again.
        missed = np.flatnonzero(np.isnan(distance))
        if len(missed) == 0:
            return distance, self.segment[hit]
        if self.ordered:
            self._recast(origins, directions, distance, hit, missed)
        else:
            for i in np.unique(missed // distance.shape[1]):
                index, rays = slice(self.bounds[i], self.bounds[i + 1]), np.isnan(distance[i])
                distance[i, rays], found = outermost(self.ends[index], origins[i, rays], directions[i, rays])
                hit[i, rays] = np.where(np.isnan(distance[i, rays]), 0, found + self.bounds[i])
        return distance, self.segment[hit]

    def _recast(self, origins: Array, directions: Array, distance: Array, hit: IntArray, missed: IntArray) -> None:
        """Find the hits of rays that missed because of rounding, among the segments at their abscissae."""
        ray, segment = self._pairs(self._abscissae(origins, directions), missed)
        ends, (origin, direction) = self.ends[segment], (x.reshape(-1, 2)[ray] for x in (origins, directions))
        start, step = (ends[:, 0] - origin).T, (ends[:, 1] - ends[:, 0]).T
        along = crossing(*start, *step, *direction.T)
        found = np.flatnonzero(~np.isnan(along))
        found = found[np.lexsort((along[found], ray[found]))]
        distance.ravel()[ray[found]], hit.ravel()[ray[found]] = (
            along[found],
            segment[found],
        )  # the last hit of each ray remains

    def _abscissae(self, origins: Array, directions: Array) -> Array:
        """Return the abscissae of rays, clipped below the width, so that no key rounds up to the next row."""
        x = diamond_angle(directions) if self.centres is not None else origins @ self.across - self.low
        return np.clip(x, 0.0, self.width * (1 - HIT_TOLERANCE))

    def _bisect(self, origins: Array, directions: Array) -> tuple[Array, IntArray]:
        x = self._abscissae(origins, directions)
        rows = np.arange(len(x))[:, None]
        index = np.searchsorted(self.key, rows * self.width + x, side="right") - 1
        first, last = self.bounds[:-1, None], self.bounds[1:, None] - 1
        # A ray before the first segment of its row can only hit the last one, which crosses the zero angle.
        index = np.where(index < first, np.maximum(last, 0), index)
        start_x, start_y, step_x, step_y = (part.take(index) for part in (*self.start, *self.step))
        if self.centres is None or self.centres.any():
            start_x, start_y = start_x - origins[..., 0], start_y - origins[..., 1]
        distance = crossing(start_x, start_y, step_x, step_y, directions[..., 0], directions[..., 1])
        unknown = (last < first)[:, 0] | ~self.clean
        if unknown.any():
            distance[unknown] = np.nan
        return distance, self.order[index]

    def _cast_overlapping(self, origins: Array, directions: Array, distance: Array, hit: IntArray) -> None:
        """Cast the rays of rows in which segments overlap."""
        shape = distance.shape
        ray, segment, along = self._crossings(origins, directions, np.flatnonzero(~self.clean))
        last = np.lexsort((along, ray))
        last = last[np.append(ray[last][1:] != ray[last][:-1], True)] if len(last) else last
        distance.ravel()[ray[last]], hit.ravel()[ray[last]] = along[last], segment[last]
        for i in np.flatnonzero(self.followed & ~self.clean):
            mine = slice(*np.searchsorted(ray, (i * shape[1], (i + 1) * shape[1])))
            folded, folded_distance = fold_distances(ray[mine] % shape[1], along[mine], shape[1])
            distance[i, folded] = folded_distance

    def _crossings(self, origins: Array, directions: Array, rows: IntArray) -> tuple[IntArray, IntArray, Array]:
        """Return all intersections of the rays of some rows: ray (ascending), segment, and distance [m].

        A ray through the common end of two segments intersects exactly one of them.
        """
        x = self._abscissae(origins, directions)
        ray, segment = self._pairs(x, (rows[:, None] * x.shape[1] + np.arange(x.shape[1])).ravel())
        offset = self.ends[segment] - origins.reshape(-1, 2)[ray][:, None]
        direction = np.broadcast_to(directions, origins.shape).reshape(-1, 2)[ray]
        side = direction[:, None, 0] * offset[..., 1] - direction[:, None, 1] * offset[..., 0]
        crosses = (side[:, 0] > 0) != (side[:, 1] > 0)
        part = side[:, 0] / np.where(crosses, side[:, 0] - side[:, 1], 1.0)
        depth = direction[:, None, 0] * offset[..., 0] + direction[:, None, 1] * offset[..., 1]
        distance = depth[:, 0] + part * (depth[:, 1] - depth[:, 0])
        found = np.flatnonzero(crosses & (distance > 0))
        found = found[np.argsort(ray[found], kind="stable")]
        return ray[found], segment[found], distance[found]

    def _pairs(self, x: Array, rays: IntArray) -> tuple[IntArray, IntArray]:
        """Return pairs of rays and segments that overlap, or nearly overlap, in their abscissae (rows, l)."""
        row = rays // x.shape[1]
        key = row * self.width + x.ravel()[rays]
        by_key = np.argsort(key, kind="stable")
        key, rays = key[by_key], rays[by_key]
        chosen = np.zeros(len(x), bool)
        chosen[row] = True
        index = np.flatnonzero(chosen[self.row])  # sorting by abscissa keeps the order of the rows
        slack = HIT_TOLERANCE * self.width
        begin, stop = self.key[index] - slack, self.stop[index] + slack
        low, high = self.row[index] * self.width, (self.row[index] + 1) * self.width
        pairs = []
        for turn in (0.0, self.width) if self.centres is not None else (0.0,):  # segments across angle zero: twice
            first = np.searchsorted(key, np.maximum(begin - turn, low))
            count = np.maximum(np.searchsorted(key, np.minimum(stop - turn, high)) - first, 0)
            which = np.repeat(np.arange(len(index)), count)
            pairs.append((rays[ranges(first, count)], which))
        ray, which = (np.concatenate(parts) for parts in zip(*pairs))
        return ray, self.order[index][which]


def diamond_angle(vectors: Array) -> Array:
    """Return a number in [0, 4) that increases with the angle of plane vectors (..., 2), without trigonometry."""
    x, y = vectors[..., 0], vectors[..., 1]
    size = np.abs(x) + np.abs(y)
    rise = y / np.where(size > 0, size, 1.0)
    angle = np.where(x < 0, 2 - rise, rise)
    return np.where(angle < 0, angle + DIAMOND_TURN, angle)


def crossing(start_x: Array, start_y: Array, step_x: Array, step_y: Array, x: Array, y: Array) -> Array:
    r"""Return the distance [m] along rays to segments; NaN where they do not intersect.

    A ray of direction :math:`\mathbf{d}` hits the segment from :math:`\mathbf{a}` to :math:`\mathbf{a} + \mathbf{s}`,
    both relative to the origin of the ray, at

    .. math::

        t = \frac{\mathbf{a} \times \mathbf{s}}{\mathbf{d} \times \mathbf{s}}, \qquad
        \lambda = \frac{\mathbf{a} \times \mathbf{d}}{\mathbf{d} \times \mathbf{s}}, \qquad
        t > 0, \quad 0 \le \lambda \le 1
    """
    turn = x * step_y - y * step_x
    with np.errstate(divide="ignore", invalid="ignore"):  # a ray parallel to its segment
        distance = (start_x * step_y - start_y * step_x) / turn
        part = (start_x * y - start_y * x) / turn
        hits = (np.abs(part - 0.5) <= 0.5 + HIT_TOLERANCE) & (distance > 0)
    return distance if hits.all() else np.where(hits & (turn != 0), distance, np.nan)


def outermost(ends: Array, origins: Array, directions: Array) -> tuple[Array, IntArray]:
    """Return the distance (l,) [m] to the furthest segment (s, 2, 2) on each ray, NaN without one, and this segment."""
    if len(ends) == 0:
        return np.full(len(origins), np.nan), np.zeros(len(origins), np.int64)
    offset, step = np.moveaxis(ends[:, 0] - origins[:, None], -1, 0), (ends[:, 1] - ends[:, 0]).T
    distance = crossing(*offset, *step, *directions.T[..., None])
    hit = np.where(np.isnan(distance), -np.inf, distance).argmax(axis=1)
    return distance[np.arange(len(hit)), hit], hit
