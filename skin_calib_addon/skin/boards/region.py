"""Flat regions with holes, and the clearance of hexagonal boards in them."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ...common.arrays import Array, BoolArray, IntArray, unit
from ...common.errors import InvalidPlan

# Pairs of points and edges in one block. Larger: more memory.
MAX_PAIRS = 2**20
# Decimals [m] to which points are rounded: points closer than a picometre are equal.
POINT_DECIMALS = 12
# Samples of each edge of an excluded zone: is it a border of the region there? Larger: detects shorter parts, slower.
ZONE_EDGE_SAMPLES = 3


@dataclass(frozen=True, eq=False)
class Region:
    """The points inside an uneven number of ``loops``: outlines, islands and holes, in any order and orientation.

    Each loop is an array of shape (k, 2) [m]; its last point joins the first. Repeated points and edges without length
    have no effect. An edge that occurs twice has no effect either: a bridge from an outline to a hole, or the common
    side of two adjacent loops. Therefore the triangles of a flat mesh are a region too.
    """

    loops: tuple[Array, ...]
    excluded: tuple[Array, ...] = ()  # loops whose inside is not part of the region

    def __post_init__(self):
        for name in ("loops", "excluded"):
            object.__setattr__(self, name, _checked_loops(getattr(self, name)))
        if not len(self.edges):
            raise InvalidPlan("the region is empty: no loop encloses an area. Give at least three points")

    @cached_property
    def edges(self) -> Array:
        """Ends of the edges between inside and outside, shape (e, 2, 2) [m]."""
        outline, *zones = self._loop_edges
        if not zones:
            return outline
        # Edges of a zone outside of the loops, or inside another zone, have the same on both sides.
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
        """Edges of all loops together, then of each zone."""
        return [_edges_of(self.loops), *(_edges_of((zone,)) for zone in self.excluded)]

    @cached_property
    def points(self) -> Array:
        """Ends of the edges, without repetition, shape (p, 2) [m]."""
        return np.unique(self.edges.reshape(-1, 2), axis=0)

    @cached_property
    def ends(self) -> IntArray:
        """Rows of ``points`` at the two ends of each edge, shape (e, 2)."""
        return np.unique(self.edges.reshape(-1, 2), axis=0, return_inverse=True)[1].reshape(-1, 2)

    @cached_property
    def box(self) -> Array:
        """Smallest and largest coordinates, shape (2, 2) [m]."""
        return np.stack((self.points.min(axis=0), self.points.max(axis=0)))

    def radius_about(self, point: Array) -> float:
        """Return the distance from a point (2,) to the farthest point of the region [m]."""
        return float(np.linalg.norm(self.points - point, axis=1).max())

    @cached_property
    def centroid(self) -> Array:
        """Centroid of the area, shape (2,) [m]; approximate if loops cross."""
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
        """Which of the ``points`` are reflex: the interior angle is above 180 degrees; shape (p,)."""
        along = unit(self.edges[:, 1] - self.edges[:, 0])
        towards = np.zeros_like(self.points)
        np.add.at(towards, self.ends[:, 0], along)
        np.add.at(towards, self.ends[:, 1], -along)
        return ~self.contains(self.points + self.probe_distance * unit(towards))

    @property
    def probe_distance(self) -> float:
        """Distance of a probe from an edge or a point [m]."""
        return 1e-6 * float(np.ptp(self.box, axis=0).max())

    def contains(self, points: Array) -> BoolArray:
        """Return which points (n, 2) [m] are inside, shape (n,)."""
        points = np.asarray(points, float)
        outline, *zones = self._loop_edges
        inside = _encloses(outline, points)
        for zone in zones:
            inside &= ~_encloses(zone, points)
        return inside

    def distances(self, points: Array) -> Array:
        """Return the distance of each point (n, 2) to each edge, shape (n, e) [m]."""
        return along_edges(np.asarray(points, float)[:, None], self.edges)[0]

    def clearances(self, centres: Array, corners: Array) -> Array:
        """Return the signed clearance of regular hexagons in the region, shape (n,) [m].

        Inside, the clearance is the smallest distance between the outlines of board and region. Otherwise it is
        negative: the largest of the protrusion of a corner and the penetration of an edge of the region into the board.
        A movement of the board by d changes its clearance by at most d.

        Parameters
        ----------
        centres : array, shape (n, 2)
            Centres of the hexagons [m].
        corners : array, shape (6, 2)
            Corners relative to the centre [m].
        """
        centres = np.asarray(centres, float)
        if not len(centres):
            return np.empty(0)
        circumradius = np.linalg.norm(corners[0])
        apothem = np.sqrt(0.75) * circumradius
        distances = self.distances(centres)
        nearest = distances.min(axis=1)
        # The nearest edge bounds the clearance. An edge farther from the centre than this cannot be the nearest one.
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
    """Return the loops as read-only arrays; raise InvalidPlan for an invalid one."""
    checked = tuple(np.array(loop, float) for loop in loops)
    for number, loop in enumerate(checked):
        if loop.ndim != 2 or loop.shape[1] != 2:
            raise InvalidPlan(f"loop {number} of the region has shape {loop.shape}; give points (x, y) [m]")
        if not np.isfinite(loop).all():
            raise InvalidPlan(f"loop {number} of the region has a number that is not finite. Remove the point")
        loop.setflags(write=False)
    return checked


def _edges_of(loops: Sequence[Array]) -> Array:
    """Return the edges of loops, without those that occur an even number of times, shape (e, 2, 2) [m]."""
    rounded = [np.round(loop, POINT_DECIMALS) + 0.0 for loop in loops if len(loop)]  # no minus zero
    pairs = np.concatenate([np.stack((a, np.roll(a, -1, axis=0)), axis=1) for a in rounded] or [np.empty((0, 2, 2))])
    pairs = pairs[(pairs[:, 0] != pairs[:, 1]).any(axis=1)]
    (ax, ay), (bx, by) = pairs[:, 0].T, pairs[:, 1].T
    swap = (bx < ax) | ((bx == ax) & (by < ay))
    pairs[swap] = pairs[swap, ::-1]
    found, times = np.unique(pairs.reshape(-1, 4), axis=0, return_counts=True)
    return found[times % 2 == 1].reshape(-1, 2, 2)


def _encloses(edges: Array, points: Array) -> BoolArray:
    """Return which of the points (n, 2) are inside: a ray along x crosses an uneven number of edges, shape (n,)."""
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
    """Return distance, fraction and height of points relative to edges.

    Parameters
    ----------
    points : array, shape (..., 2)
        Points [m].
    edges : array, shape (..., 2, 2)
        Start and end of the edges [m].

    Returns
    -------
    distance : array, shape (...)
        Distance to the edge [m].
    fraction : array, shape (...)
        Position of the foot on the line, as a fraction of the edge; in [0, 1] on the edge.
    height : array, shape (...)
        Signed distance to the line, positive to its left [m].
    """
    x, y = points[..., 0] - edges[..., 0, 0], points[..., 1] - edges[..., 0, 1]
    dx, dy = edges[..., 1, 0] - edges[..., 0, 0], edges[..., 1, 1] - edges[..., 0, 1]
    square = dx * dx + dy * dy
    fraction = (x * dx + y * dy) / square
    on = np.clip(fraction, 0, 1)
    return np.hypot(x - on * dx, y - on * dy), fraction, (dx * y - dy * x) / np.sqrt(square)


def _deepest(edges: Array, corners: Array) -> Array:
    """Return candidates for the deepest point of edges (k, 2, 2) in a hexagon about zero, shape (k, 5, 2).

    The depth is linear between the lines through opposite corners. Its maximum is at an end of the edge or on one of
    these three lines.
    """
    start, along = edges[:, :1], edges[:, 1:] - edges[:, :1]
    across = np.column_stack((-corners[:3, 1], corners[:3, 0]))
    rise, run = -start @ across.T, along @ across.T
    fraction = np.clip(np.divide(rise, run, out=np.zeros_like(rise), where=run != 0), 0, 1)
    return np.concatenate((edges, start + fraction[:, 0, :, None] * along), axis=1)


def _hexagon_distances(points: Array, corners: Array) -> Array:
    """Return signed distances of points (..., 2) to a regular hexagon about zero, negative inside, shape (...) [m]."""
    side = np.linalg.norm(corners[0])
    normals = unit(corners + np.roll(corners, -1, axis=0))
    out = (points @ normals.T).max(axis=-1)
    aside = np.sqrt(np.maximum((points**2).sum(axis=-1) - out**2, 0)) - side / 2
    beyond = out - np.sqrt(0.75) * side
    return np.where(beyond < 0, beyond, np.hypot(beyond, np.maximum(aside, 0)))


def _chunks(rows: int, columns: int) -> Iterator[slice]:
    """Yield slices of the rows; the pairs of one slice with all columns fit the memory limit."""
    step = max(1, MAX_PAIRS // max(columns, 1))
    return (slice(start, start + step) for start in range(0, rows, step))
