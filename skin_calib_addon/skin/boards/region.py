"""Flat regions with holes, and how much room hexagonal boards have in them."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ...common.arrays import Array, BoolArray, IntArray, unit
from ...common.errors import InvalidPlan

# Pairs of points and edges that are held against each other at a time, to keep the memory small.
MAX_PAIRS = 2**20
# Digits of a point that count: what is closer than a picometre is the same.
POINT_DECIMALS = 12
# Places of a zone's edge where its sides are looked at.
ZONE_EDGE_SAMPLES = 3


@dataclass(frozen=True, eq=False)
class Region:
    """What lies inside an odd number of ``loops``: outlines, islands and holes, in any order, wound either way.

    Each loop is an array of shape (k, 2) [m] whose end joins its start. Points that repeat and edges without length
    count for nothing, and so does an edge that is there twice: a bridge from an outline to a hole, or the common side
    of two loops that lie beside each other. So the triangles of a flat mesh are a region too.
    """

    loops: tuple[Array, ...]
    excluded: tuple[Array, ...] = ()  # loops whose inside is none of the region, wherever they lie

    def __post_init__(self):
        for name in ("loops", "excluded"):
            object.__setattr__(self, name, _checked_loops(getattr(self, name)))
        if not len(self.edges):
            raise InvalidPlan("the region is empty: none of its loops encloses anything; give three points or more")

    @cached_property
    def edges(self) -> Array:
        """Ends of the edges that part inside from outside, shape (e, 2, 2) [m]."""
        outline, *zones = self._loop_edges
        if not zones:
            return outline
        # What of a zone lies outside, or in another one, parts nothing.
        edges = np.concatenate(zones)
        along = edges[:, 1] - edges[:, 0]
        aside = 1e-6 * np.ptp(edges.reshape(-1, 2), axis=0).max() * unit(np.column_stack((-along[:, 1], along[:, 0])))
        samples = edges[:, 0] + np.linspace(0, 1, ZONE_EDGE_SAMPLES + 2)[1:-1, None, None] * along
        left, right = (
            self.contains((samples + side * aside).reshape(-1, 2)).reshape(ZONE_EDGE_SAMPLES, -1) for side in (1, -1)
        )
        return np.concatenate((outline, edges[(left != right).any(axis=0)]))

    @cached_property
    def _loop_edges(self) -> list[Array]:
        """Edges of all loops, and then of each zone."""
        return [_edges_of(self.loops), *(_edges_of((zone,)) for zone in self.excluded)]

    @cached_property
    def points(self) -> Array:
        """Ends of the edges, each once, shape (p, 2) [m]."""
        return np.unique(self.edges.reshape(-1, 2), axis=0)

    @cached_property
    def ends(self) -> IntArray:
        """Rows of ``points`` in which each edge begins and ends, shape (e, 2)."""
        return np.unique(self.edges.reshape(-1, 2), axis=0, return_inverse=True)[1].reshape(-1, 2)

    @cached_property
    def box(self) -> Array:
        """Least and largest coordinates, shape (2, 2) [m]."""
        return np.stack((self.points.min(axis=0), self.points.max(axis=0)))

    def radius_about(self, point: Array) -> float:
        """Distance from a point (2,) to the furthest of the region [m]."""
        return float(np.linalg.norm(self.points - point, axis=1).max())

    @cached_property
    def centroid(self) -> Array:
        """Middle of the area, shape (2,) [m], if no loop crosses itself or another; else somewhere about it."""
        middle = self.box.mean(axis=0)
        start, stop = self.edges[:, 0] - middle, self.edges[:, 1] - middle
        along = unit(stop - start)
        left = self.contains(
            self.edges.mean(axis=1) + self.probe_distance * np.column_stack((-along[:, 1], along[:, 0]))
        )
        twice = np.where(left, 1, -1) * (start[:, 0] * stop[:, 1] - start[:, 1] * stop[:, 0])
        return middle + twice @ (start + stop) / (3 * twice.sum()) if twice.sum() > 0 else middle

    @cached_property
    def is_reflex(self) -> BoolArray:
        """Which of the ``points`` poke into the region: more than half of what is around them is inside; shape (p,)."""
        along = unit(self.edges[:, 1] - self.edges[:, 0])
        towards = np.zeros_like(self.points)
        np.add.at(towards, self.ends[:, 0], along)
        np.add.at(towards, self.ends[:, 1], -along)
        return ~self.contains(self.points + self.probe_distance * unit(towards))

    @property
    def probe_distance(self) -> float:
        """A small distance from an edge or a point, to ask what is there [m]."""
        return 1e-6 * float(np.ptp(self.box, axis=0).max())

    def contains(self, points: Array) -> BoolArray:
        """Which points of shape (n, 2) lie inside, shape (n,)."""
        points = np.asarray(points, float)
        outline, *zones = self._loop_edges
        inside = _encloses(outline, points)
        for zone in zones:
            inside &= ~_encloses(zone, points)
        return inside

    def distances(self, points: Array) -> Array:
        """Distance of each of the points (n, 2) to each edge, shape (n, e) [m]."""
        return along_edges(np.asarray(points, float)[:, None], self.edges)[0]

    def clearances(self, centres: Array, corners: Array) -> Array:
        """Signed room of regular hexagons with ``corners`` (6, 2) about each of the ``centres`` (n, 2), shape (n,) [m].

        Inside, it is the least distance between the outlines of the board and of the region. Elsewhere it is minus the
        larger of how far a corner sticks out, and how deep an edge of the region pokes into the board. No room changes
        by more than the board is moved.
        """
        centres = np.asarray(centres, float)
        if not len(centres):
            return np.empty(0)
        circumradius = np.linalg.norm(corners[0])
        apothem = np.sqrt(0.75) * circumradius
        distances = self.distances(centres)
        nearest = distances.min(axis=1)
        # The nearest edge bounds the room; what is further from the centre than this cannot be nearer to the outline.
        is_clear = self.contains(centres) & (nearest >= apothem)
        board, edge = np.nonzero(
            distances <= (nearest + np.where(is_clear, circumradius - apothem, 2 * circumradius))[:, None]
        )
        first = np.searchsorted(board, np.arange(len(centres)))
        outline = centres[:, None] + corners
        distances = along_edges(outline[board], self.edges[edge, None])[0]
        distances = np.minimum.reduceat(distances, first, axis=0)
        inside = self.contains(outline.reshape(-1, 2)).reshape(-1, 6)
        penetration = _hexagon_distances(_deepest(self.edges[edge] - centres[board, None], corners), corners).min(
            axis=1
        )
        return np.minimum(np.where(inside, distances, -distances).min(axis=1), np.minimum.reduceat(penetration, first))


def _checked_loops(loops: Iterable[ArrayLike]) -> tuple[Array, ...]:
    """The loops as read-only arrays; raises InvalidPlan for one that is none."""
    checked = tuple(np.array(loop, float) for loop in loops)
    for number, loop in enumerate(checked):
        if loop.ndim != 2 or loop.shape[1] != 2:
            raise InvalidPlan(f"loop {number} of the region has shape {loop.shape}; give points (x, y) [m]")
        if not np.isfinite(loop).all():
            raise InvalidPlan(f"loop {number} of the region holds a number that is not finite; leave the point out")
        loop.setflags(write=False)
    return checked


def _edges_of(loops: Sequence[Array]) -> Array:
    """Edges of loops, without those that are there twice, shape (e, 2, 2) [m]."""
    rounded = [np.round(loop, POINT_DECIMALS) + 0.0 for loop in loops if len(loop)]  # no minus zero
    pairs = np.concatenate([np.stack((a, np.roll(a, -1, axis=0)), axis=1) for a in rounded] or [np.empty((0, 2, 2))])
    pairs = pairs[(pairs[:, 0] != pairs[:, 1]).any(axis=1)]
    (ax, ay), (bx, by) = pairs[:, 0].T, pairs[:, 1].T
    swap = (bx < ax) | ((bx == ax) & (by < ay))
    pairs[swap] = pairs[swap, ::-1]
    found, times = np.unique(pairs.reshape(-1, 4), axis=0, return_counts=True)
    return found[times % 2 == 1].reshape(-1, 2, 2)


def _encloses(edges: Array, points: Array) -> BoolArray:
    """From which of the points (n, 2) a ray along x crosses an odd number of edges, shape (n,)."""
    (ax, ay), (bx, by) = edges[:, 0].T, edges[:, 1].T
    rises = by > ay
    inside = np.empty(len(points), bool)
    for chunk in _chunks(len(points), len(ax)):
        x, y = points[chunk, :1], points[chunk, 1:]
        is_left = (bx - ax) * (y - ay) > (by - ay) * (x - ax)
        crosses = ((ay > y) != (by > y)) & (is_left == rises)
        inside[chunk] = np.count_nonzero(crosses, axis=1) % 2 == 1
    return inside


def along_edges(points: Array, edges: Array) -> tuple[Array, Array, Array]:
    """Distance of points (..., 2) to edges (..., 2, 2) [m], share of the edge at the foot, height left of its line [m].

    The foot counts on the whole line: its share lies in [0, 1] where it is on the edge.
    """
    x, y = points[..., 0] - edges[..., 0, 0], points[..., 1] - edges[..., 0, 1]
    dx, dy = edges[..., 1, 0] - edges[..., 0, 0], edges[..., 1, 1] - edges[..., 0, 1]
    square = dx * dx + dy * dy
    fraction = (x * dx + y * dy) / square
    on = np.clip(fraction, 0, 1)
    return np.hypot(x - on * dx, y - on * dy), fraction, (dx * y - dy * x) / np.sqrt(square)


def _deepest(edges: Array, corners: Array) -> Array:
    """Points of edges (k, 2, 2) among which is the one deepest in, or nearest to, a hexagon about zero; (k, 5, 2).

    Depth is linear between the lines from corner to corner, so it is greatest at an end or on one of the three.
    """
    start, along = edges[:, :1], edges[:, 1:] - edges[:, :1]
    across = np.column_stack((-corners[:3, 1], corners[:3, 0]))
    rise, run = -start @ across.T, along @ across.T
    fraction = np.clip(np.divide(rise, run, out=np.zeros_like(rise), where=run != 0), 0, 1)
    return np.concatenate((edges, start + fraction[:, 0, :, None] * along), axis=1)


def _hexagon_distances(points: Array, corners: Array) -> Array:
    """Signed distances of points (..., 2) to a regular hexagon about zero, negative inside, shape (...) [m]."""
    side = np.linalg.norm(corners[0])
    normals = unit(corners + np.roll(corners, -1, axis=0))
    out = (points @ normals.T).max(axis=-1)
    aside = np.sqrt(np.maximum((points**2).sum(axis=-1) - out**2, 0)) - side / 2
    beyond = out - np.sqrt(0.75) * side
    return np.where(beyond < 0, beyond, np.hypot(beyond, np.maximum(aside, 0)))


def _chunks(rows: int, columns: int) -> Iterator[slice]:
    """Slices of rows, each of so many that few pairs with the columns are held at a time."""
    step = max(1, MAX_PAIRS // max(columns, 1))
    return (slice(start, start + step) for start in range(0, rows, step))
