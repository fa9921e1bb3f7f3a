"""Represent convex polygons in a plane, such as supporting polygons: area, margin, nearest point, inset."""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from ..common.arrays import Array, BoolArray
from .hull import GridPoint, HullTable

Point = tuple[float, float]
Corner = tuple[float, float, int]  # a point, and the index of the side that starts at it
Side = tuple[float, float, float, float, float]  # start, unit vector along it, length

KINDS = ("empty", "point", "segment", "area")
# Rounding error of a cross product, relative to the sizes of its two terms. Derived: from double precision
# (Shewchuk 1997, ccwerrboundA).
ROUNDING_BOUND = 3.3306690738754716e-16
# Size of the terms below which they can underflow, so that the bound is not valid. Derived: from double precision.
UNDERFLOW_LIMIT = 1e-290
# Rounding error of an area, relative to the area, from which on the area is computed with fractions: in very thin
# polygons. Larger: less accurate areas; smaller: slower for thin polygons.
MAX_ROUNDING_FRACTION = 1e-10


@dataclass(frozen=True, eq=False)
class Polygon:
    """A convex polygon with counter-clockwise corners; also a segment, a point, or an empty polygon.

    :func:`convex_hull` makes polygons whose corners are on its grid and of which no three corners are on a line.
    """

    corners: Array  # (k, 2) [m], read-only

    def __post_init__(self):
        self.corners.setflags(write=False)

    @property
    def kind(self) -> str:
        """``"empty"``, ``"point"``, ``"segment"`` or ``"area"``."""
        return KINDS[min(len(self.corners), 3)]

    @cached_property
    def _loop(self) -> list[Point]:
        return [(x, y) for x, y in self.corners.tolist()]

    @cached_property
    def _edges(self) -> list[tuple[Point, Point]]:
        """Start and end of each edge; a segment has two edges of opposite direction."""
        loop = self._loop
        return list(zip(loop, loop[1:] + loop[:1])) if len(loop) > 1 else []

    @cached_property
    def _sides(self) -> list[Side]:
        """Start, unit direction and length of each edge; without overflow and underflow for any coordinates."""
        sides = []
        for (x, y), (u, v) in self._edges:
            r = math.hypot(u - x, v - y)
            sides.append((x, y, (u - x) / r, (v - y) / r, r))
        return sides

    @cached_property
    def _moments(self) -> tuple[float, Point]:
        """Area, and the vector from the first corner to the centroid."""
        if len(self._loop) < 3:
            return 0.0, (0.0, 0.0)
        start = self._loop[0]
        corners = [(x - start[0], y - start[1]) for x, y in self._loop[1:]]
        twice, along_x, along_y = _fan(corners)
        spread = sum(abs(x * v) + abs(y * u) for (x, y), (u, v) in zip(corners, corners[1:]))
        if UNDERFLOW_LIMIT < ROUNDING_BOUND * spread < MAX_ROUNDING_FRACTION * twice < math.inf:
            return twice / 2, (along_x / twice / 3, along_y / twice / 3)
        x0, y0 = map(Fraction, start)
        twice, along_x, along_y = _fan([(Fraction(x) - x0, Fraction(y) - y0) for x, y in self._loop[1:]])
        if not twice:  # all corners are on a line; hulls have no such corners
            middle = (self.corners / len(self._loop)).sum(axis=0) - start
            return 0.0, (float(middle[0]), float(middle[1]))
        try:
            area = float(twice / 2)
        except OverflowError:
            area = math.inf
        return area, (float(along_x / twice / 3), float(along_y / twice / 3))

    @property
    def area(self) -> float:
        """Area [m^2]; 0 for a segment or a point."""
        return self._moments[0]

    @cached_property
    def centroid(self) -> Array | None:
        """Centre of the area (2,) [m]; the middle of a segment, the point itself, None for an empty polygon.

        The mean of the corners is another point; on soles it is 11 mm away.
        """
        if not self._loop:
            return None
        if len(self._loop) < 3:
            return (self.corners / len(self._loop)).sum(axis=0)
        return self.corners[0] + self._moments[1]

    @property
    def bounds(self) -> tuple[Array, Array] | None:
        """Minimum and maximum coordinates, each (2,) [m]; None for an empty polygon."""
        return (self.corners.min(axis=0), self.corners.max(axis=0)) if self._loop else None

    @cached_property
    def half_planes(self) -> tuple[Array, Array]:
        """Outward unit normals (k, 2) and offsets (k,) [m]: a point p is inside if ``normals @ p <= offsets``.

        Empty arrays if the polygon has no area.
        """
        sides = self._sides if len(self._loop) > 2 else []
        table = np.array([(uy, -ux, x * uy - y * ux) for x, y, ux, uy, _ in sides]).reshape(-1, 3)
        return table[:, :2], table[:, 2]

    def margin(self, point: Any) -> float:
        """Return the distance [m] of a point (2,) to the border: positive inside, negative outside, -inf if empty."""
        x, y = map(float, point)
        if self.contains((x, y)):
            depths = [ux * (y - b) - uy * (x - a) for a, b, ux, uy, _ in self._sides]
            return max(0.0, min(depths)) if len(depths) > 2 else 0.0
        near = self._nearest(x, y)
        return -math.hypot(near[0] - x, near[1] - y) if near else -math.inf

    def contains(self, point: Any) -> bool:
        """Return whether a point (2,) is inside or on the border, without rounding; False if it is not finite."""
        x, y = map(float, point)
        if not (math.isfinite(x) and math.isfinite(y)):
            return False
        if len(self._loop) < 2:
            return (x, y) in self._loop
        if not all(turn(a, b, (x, y)) >= 0 for a, b in self._edges):
            return False
        (ax, ay), (bx, by) = self._loop[:2]
        return len(self._loop) > 2 or (min(ax, bx) <= x <= max(ax, bx) and min(ay, by) <= y <= max(ay, by))

    def closest(self, point: Any) -> Array | None:
        """Return the point (2,) of the polygon nearest to a point (thesis, Algorithm 1, corrected).

        It limits a desired ZMP to the polygon. The result is the point itself if it is inside, and None if the polygon
        is empty or the point is not finite. The thesis asks for clockwise corners; the algorithm needs
        counter-clockwise ones.
        """
        x, y = map(float, point)
        if self.contains((x, y)):
            return np.array((x, y))
        near = self._nearest(x, y)
        return np.array(near) if near else None

    def _nearest(self, x: float, y: float) -> Point | None:
        """Return the point of the border nearest to a point that is not inside; None for an empty polygon.

        The side or corner is chosen by the signs of projections. A comparison of distances that are equal within
        rounding could choose a corner that is nanometres away.
        """
        if not self._loop or not (math.isfinite(x) and math.isfinite(y)):
            return None
        feet = []
        is_past = bool(self._sides) and _along(self._sides[-1], x, y) >= self._sides[-1][4]
        for side in self._sides:
            a, b, ux, uy, r = side
            t = _along(side, x, y)
            if t <= 0 and is_past:
                return a, b
            foot = (a + t * ux, b + t * uy)
            if 0 < t < r:
                if ux * (y - b) - uy * (x - a) <= 0:
                    return foot
                feet.append(foot)
            is_past = t >= r
        return min((*self._loop, *feet), key=lambda foot: math.hypot(foot[0] - x, foot[1] - y))  # nearly on the border

    def inset(self, distance: float) -> "Polygon":
        """Return the polygon of all points that are at least ``distance`` [m] from the border; it can be empty.

        The thesis reduces a bounding box by 1 cm instead. This box extends beyond nearly every hull.

        Raises
        ------
        ValueError
            If the distance is negative or not a number.
        """
        if not distance >= 0:
            raise ValueError(f"inset distance {distance} m must be 0 or more")
        if distance == 0:
            return self
        return self.moved_in([distance] * len(self._edges)) if len(self._loop) > 2 else EMPTY_POLYGON

    def eroded(self, cell: Array) -> "Polygon":
        r"""Return the Minkowski difference of the polygon and the point reflection of a convex cell.

        Each edge with the outward normal :math:`\mathbf{a}_k` and offset :math:`b_k` moves inward by the extent of the
        cell against this normal. With the corners :math:`\mathbf{q}_j` of the cell about its centre:

        .. math::
            G = \left\{\, \mathbf{x} :\; \mathbf{a}_k \cdot \mathbf{x} \le
            b_k - \max_j (-\mathbf{a}_k \cdot \mathbf{q}_j) \;\text{ for all } k \,\right\} .

        If the polygon is the hull of the centres of the cells in contact, the hull of the true contact contains
        :math:`G`, even if each cell is touched at one corner only.

        Parameters
        ----------
        cell : array, shape (k, 2)
            Corners of the cell about its centre [m].
        """
        if len(self._loop) < 3:
            return EMPTY_POLYGON
        corners = np.asarray(cell).tolist()
        edges = [(u - x, v - y) for (x, y), (u, v) in self._edges]
        extents = [max(0.0, *[ex * q - ey * p for p, q in corners]) for ex, ey in edges]
        moved = _moved_corners(self._loop, edges, extents)
        if moved is None:
            return self.moved_in(extent / side[4] for extent, side in zip(extents, self._sides))
        return Polygon(np.array(_convex(moved)))

    def moved_in(self, distances: Iterable[float]) -> "Polygon":
        """Return the polygon after each edge moved inward by its own distance [m]; it can be empty.

        A segment or a point has no inside: the result is empty.

        Raises
        ------
        ValueError
            If a distance is negative or not a number, or there is not exactly one for each edge.
        """
        distances = list(distances)
        if len(distances) != len(self._edges) or not all(d >= 0 for d in distances):
            raise ValueError(f"{len(self._edges)} edges need as many distances, 0 or more, not {distances}")
        if len(self._loop) < 3:
            return EMPTY_POLYGON
        return Polygon(np.array(_convex(_cut(self._loop, self._sides, distances)), float).reshape(-1, 2))


EMPTY_POLYGON = Polygon(np.empty((0, 2)))


class PolygonTable:
    """A set of points that computes the convex hull of some of them; an unchanged hull is the same polygon."""

    def __init__(self, table: HullTable):
        self._table = table
        self._which = np.zeros(table.size, bool)  # rows of the last hull
        self._corners: list[GridPoint] = []  # of the last hull
        self._polygon = EMPTY_POLYGON

    def hull(self, which: BoolArray) -> Polygon:
        """Return the convex hull of the points of some rows (n,)."""
        if np.count_nonzero(which != self._which):
            self._which, corners = which, self._table.hull(which.nonzero()[0])
            if corners != self._corners:
                self._corners, self._polygon = corners, from_grid(corners, self._table.step)
        return self._polygon


def convex_hull(points: Any) -> Polygon:
    """Return the convex hull of points (n, 2) [m]; exact for the points rounded to a grid (:mod:`.hull`).

    The step of the grid is 2**-29 of the largest coordinate: less than a nanometre for a foot. Points on a line give a
    segment, equal points a point, no points an empty polygon.

    Raises
    ------
    ValueError
        If a point is not finite, or does not have two coordinates.
    """
    points = np.asarray(points, float)
    if points.size and (points.ndim != 2 or points.shape[1] != 2):
        raise ValueError(f"points of a plane must have shape (n, 2), not {points.shape}")
    table = HullTable(points.reshape(-1, 2))
    return from_grid(table.hull(np.arange(table.size)), table.step)


def from_grid(corners: list[GridPoint], step: float) -> Polygon:
    """Return the polygon of corners on a grid."""
    return Polygon(np.array(corners, float) * step) if corners else EMPTY_POLYGON


def turn(a: Point, b: Point, c: Point) -> float:
    """Return twice the area of a triangle, positive if it turns left. The sign is exact for any finite coordinates."""
    first, second = (b[0] - a[0]) * (c[1] - a[1]), (b[1] - a[1]) * (c[0] - a[0])
    # Not true if a term overflows.
    if abs(first - second) > ROUNDING_BOUND * (abs(first) + abs(second)) + UNDERFLOW_LIMIT:
        return first - second
    (ax, ay), (bx, by), (cx, cy) = ((Fraction(x), Fraction(y)) for x, y in (a, b, c))
    exact = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    return (exact > 0) - (exact < 0)


def _along(side: Side, x: float, y: float) -> float:
    """Return the coordinate of a point along a side, from its start."""
    return (x - side[0]) * side[2] + (y - side[1]) * side[3]


def _fan(corners: list) -> tuple:
    """Return twice the area of a polygon with a corner at the origin, and its product with three times the centroid."""
    twice = along_x = along_y = 0
    for (x, y), (u, v) in zip(corners, corners[1:]):
        cross = x * v - y * u
        twice += cross
        along_x += cross * (x + u)
        along_y += cross * (y + v)
    return twice, along_x, along_y


def _moved_corners(loop: list[Point], edges: list[Point], extents: list[float]) -> list[Point] | None:
    """Return the corners after each edge moved inward; None if little or nothing is left, where :func:`_cut` is needed.

    An edge that would run backwards is behind the intersection of its neighbours, and is left out.
    """
    left = list(range(len(loop)))
    while True:
        moved = []
        i = left[-1]
        for j in left:
            (ax, ay), (bx, by) = edges[i], edges[j]
            (x, y), (u, v) = loop[j], loop[i]
            turns = ax * by - ay * bx
            if not UNDERFLOW_LIMIT < turns < math.inf:
                return None
            a, b = extents[i] - (ax * (y - v) - ay * (x - u)), extents[j]
            moved.append((x + (a * bx - b * ax) / turns, y + (a * by - b * ay) / turns))
            i = j
        kept = []
        was_kept = True
        for k, (x, y), (u, v) in zip(left, moved, moved[1:] + moved[:1]):
            ex, ey = edges[k]
            was_kept = not was_kept or (u - x) * ex + (v - y) * ey > 0  # the neighbours of one left out stay
            if was_kept:
                kept.append(k)
        if len(kept) == len(left):
            return moved
        left = kept if was_kept or kept[0] == left[0] else [left[0], *kept]


def _cut(loop: list[Point], sides: list[Side], distances: list[float]) -> list[Point]:
    """Return the corners of a polygon without a strip along each side, in their order; some can be equal.

    The corners that a strip removes are adjacent: they are around its side, or around the outermost corner if earlier
    strips removed the side. The loop is opened there, and corners are removed from both ends, each once. New corners
    divide the rest of old edges. Rounding moves them very little, for any angle.
    """
    left = deque((x, y, k) for k, (x, y) in enumerate(loop))  # each with the side that starts at it
    for k, ((x, y, ux, uy, _), distance) in enumerate(zip(sides, distances)):
        if left[0][2] == k:
            left.rotate(-1)
        front, back = left[0], left[-1]
        first = ux * (front[1] - y) - uy * (front[0] - x) - distance  # depth behind the strip, at both ends
        last = ux * (back[1] - y) - uy * (back[0] - x) - distance
        if first >= 0 and last >= 0:
            continue
        ahead, out_ahead, behind, out_behind = back, last, front, first  # the last removed ones, at both ends
        while first < 0:
            ahead, out_ahead = left.popleft(), first
            if not left:
                return []
            first = ux * (left[0][1] - y) - uy * (left[0][0] - x) - distance
        while last < 0:
            behind, out_behind = left.pop(), last
            last = ux * (left[-1][1] - y) - uy * (left[-1][0] - x) - distance
        front, back = left[0], left[-1]
        if ahead[2] != k:  # else rounding removed the start of the side but not its end: keep the end
            left.appendleft((*_between(front, first, ahead, out_ahead), ahead[2]))
        left.append((*_between(back, last, behind, out_behind), k))
    return [(x, y) for x, y, _ in left]


def _between(kept: Corner, inside: float, removed: Corner, outside: float) -> Point:
    """Return the point at which an edge is cut, from the depths of its ends: inside positive, outside negative."""
    t = inside / (inside - outside)
    return kept[0] + t * (removed[0] - kept[0]), kept[1] + t * (removed[1] - kept[1])


def _convex(points: list[Point]) -> list[Point]:
    """Return the corners of the hull of a few points, by exact turns; mostly these are the points themselves."""
    before = zip(points[-2:] + points[:-2], points[-1:] + points[:-1])
    if len(points) > 2 and all(turn(a, b, c) > 0 for (a, b), c in zip(before, points)):
        return points
    ordered = sorted(set(points))
    return ordered if len(ordered) < 3 else _lefts(ordered)[:-1] + _lefts(ordered[::-1])[:-1]


def _lefts(ordered: list[Point]) -> list[Point]:
    """Return the chain that turns left from the first to the last of sorted points (:mod:`.hull` has integers)."""
    chain: list[Point] = []
    for point in ordered:
        while len(chain) > 1 and turn(chain[-2], chain[-1], point) <= 0:
            chain.pop()
        chain.append(point)
    return chain
