"""Convex polygons in a plane: the supporting polygon, and what a walking controller asks of it."""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from ...common.arrays import Array
from .hull import GridPoint, HullTable

Point = tuple[float, float]
Corner = tuple[float, float, int]  # a point, and which side leaves it
Side = tuple[float, float, float, float, float]  # where it starts, a unit vector along it, its length

KINDS = ("empty", "point", "segment", "area")
# How far rounding may take a cross product, for the sizes of its two terms (Shewchuk 1997); and where they underflow.
DOUBT, TINY = 3.3306690738754716e-16, 1e-290
THIN = 1e-10  # of a sum of cross products, the share that rounding may have; more in a very thin polygon


@dataclass(frozen=True, eq=False)
class Polygon:
    """A convex polygon, counter-clockwise; also what is left of one: a segment, a point, nothing.

    Made by :func:`convex_hull`; then the corners lie on its grid and no three of them on a line.
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
        """Where each edge starts and ends; a segment has two, there and back."""
        loop = self._loop
        return list(zip(loop, loop[1:] + loop[:1])) if len(loop) > 1 else []

    @cached_property
    def _sides(self) -> list[Side]:
        """The edges by their directions, which have a length however small or large the coordinates."""
        sides = []
        for (x, y), (u, v) in self._edges:
            r = math.hypot(u - x, v - y)
            sides.append((x, y, (u - x) / r, (v - y) / r, r))
        return sides

    @cached_property
    def _moments(self) -> tuple[float, Point]:
        """Area, and from the first corner to the centroid."""
        if len(self._loop) < 3:
            return 0.0, (0.0, 0.0)
        start = self._loop[0]
        corners = [(x - start[0], y - start[1]) for x, y in self._loop[1:]]
        twice, along_x, along_y = _fan(corners)
        spread = sum(abs(x * v) + abs(y * u) for (x, y), (u, v) in zip(corners, corners[1:]))
        if TINY < DOUBT * spread < THIN * twice < math.inf:
            return twice / 2, (along_x / twice / 3, along_y / twice / 3)
        x0, y0 = map(Fraction, start)
        twice, along_x, along_y = _fan([(Fraction(x) - x0, Fraction(y) - y0) for x, y in self._loop[1:]])
        if not twice:  # corners on a line, which no hull has
            middle = (self.corners / len(self._loop)).sum(axis=0) - start
            return 0.0, (float(middle[0]), float(middle[1]))
        try:
            area = float(twice / 2)
        except OverflowError:
            area = math.inf
        return area, (float(along_x / twice / 3), float(along_y / twice / 3))

    @property
    def area(self) -> float:
        """[m^2]; 0 for a segment or a point."""
        return self._moments[0]

    @cached_property
    def centroid(self) -> Array | None:
        """Centre of the area (2,) [m], not the mean of the corners, which is 11 mm off on soles.

        The middle of a segment, the point itself; None where nothing is.
        """
        if not self._loop:
            return None
        if len(self._loop) < 3:
            return (self.corners / len(self._loop)).sum(axis=0)
        return self.corners[0] + self._moments[1]

    @property
    def bounds(self) -> tuple[Array, Array] | None:
        """Lowest and highest coordinates, each (2,) [m]; None where nothing is."""
        return (self.corners.min(axis=0), self.corners.max(axis=0)) if self._loop else None

    @cached_property
    def half_planes(self) -> tuple[Array, Array]:
        """Outward unit normals (k, 2) and offsets (k,) [m]: a point p is inside where ``normals @ p <= offsets``.

        Empty arrays unless the polygon has an area.
        """
        sides = self._sides if len(self._loop) > 2 else []
        table = np.array([(uy, -ux, x * uy - y * ux) for x, y, ux, uy, _ in sides]).reshape(-1, 3)
        return table[:, :2], table[:, 2]

    def margin(self, point: Any) -> float:
        """Distance [m] of a point (2,) to the border, positive inside, negative outside; -inf where nothing is."""
        x, y = map(float, point)
        if self.contains((x, y)):
            depths = [ux * (y - b) - uy * (x - a) for a, b, ux, uy, _ in self._sides]
            return max(0.0, min(depths)) if len(depths) > 2 else 0.0
        near = self._nearest(x, y)
        return -math.hypot(near[0] - x, near[1] - y) if near else -math.inf

    def contains(self, point: Any) -> bool:
        """Whether a point (2,) lies inside or on the border, without any rounding; one that is no number does not."""
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
        """The point (2,) of the polygon nearest to a point: a desired ZMP kept inside (thesis, Algorithm 1, corrected).

        The point itself where it is inside; None where the polygon is empty or the point no number.
        """
        x, y = map(float, point)
        if self.contains((x, y)):
            return np.array((x, y))
        near = self._nearest(x, y)
        return np.array(near) if near else None

    def _nearest(self, x: float, y: float) -> Point | None:
        """The point of the border nearest to a point that is not inside; None where there is none.

        By the side or the corner that the point stands before: of two distances that differ by less than rounding, the
        shorter may lead nanometres away.
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
        return min((*self._loop, *feet), key=lambda foot: math.hypot(foot[0] - x, foot[1] - y))  # within rounding of it

    def inset(self, distance: float) -> "Polygon":
        """The points that are at least ``distance`` [m] from the border; empty where there are none.

        The thesis shrinks a bounding box by 1 cm, which sticks out of nearly every hull.

        Raises
        ------
        ValueError
            If the distance is negative or not a number.
        """
        if not distance >= 0:
            raise ValueError(f"inset distance {distance} must be 0 or more")
        if distance == 0:
            return self
        return self.moved_in([distance] * len(self._edges)) if len(self._loop) > 2 else NOTHING

    def eroded(self, cell: Array) -> "Polygon":
        """Where the middle of a convex cell can stand so that all of the cell, turned round, is inside (Minkowski).

        Each edge moves in by how far the cell reaches against the edge's normal. Of the hull of the centres of touched
        cells it leaves what the true contact holds, though each be touched at its far corner alone.

        Parameters
        ----------
        cell : array, shape (k, 2)
            Corners of the cell about its middle [m].
        """
        if len(self._loop) < 3:
            return NOTHING
        inward = np.array([(-uy, ux) for _, _, ux, uy, _ in self._sides])
        return self.moved_in((inward @ np.asarray(cell).T).max(axis=1, initial=0.0).tolist())

    def moved_in(self, distances: Iterable[float]) -> "Polygon":
        """What is left when each edge moves inward by a distance [m] of its own, 0 or more; empty where nothing is.

        What is left of a segment or a point, which have no inside, is nothing.

        Raises
        ------
        ValueError
            If a distance is negative or not a number, or there is not one for each edge.
        """
        distances = list(distances)
        if len(distances) != len(self._edges) or not all(d >= 0 for d in distances):
            raise ValueError(f"{len(self._edges)} edges move in by as many distances, 0 or more, not by {distances}")
        if len(self._loop) < 3:
            return NOTHING
        return Polygon(np.array(_convex(_cut(self._loop, self._sides, distances)), float).reshape(-1, 2))


NOTHING = Polygon(np.empty((0, 2)))


def convex_hull(points: Any) -> Polygon:
    """The smallest convex polygon round points (n, 2) [m], exactly, of the points put on a grid (:mod:`.hull`).

    The grid's step is 2**-29 of the largest coordinate: below a nanometre for a foot. Points on a line give their two
    ends, points in one place that place, none an empty polygon.

    Raises
    ------
    ValueError
        If a point is not finite, or has not two coordinates.
    """
    points = np.asarray(points, float)
    if points.size and (points.ndim != 2 or points.shape[1] != 2):
        raise ValueError(f"points of a plane have shape (n, 2), not {points.shape}")
    table = HullTable(points.reshape(-1, 2))
    return of_grid(table.hull(np.arange(table.size)), table.step)


def of_grid(corners: list[GridPoint], step: float) -> Polygon:
    """The polygon of corners in whole steps of a grid."""
    return Polygon(np.array(corners, float).reshape(-1, 2) * step)


def turn(a: Point, b: Point, c: Point) -> float:
    """Twice the area of a triangle, positive where it turns left; its sign is exact, whatever the coordinates."""
    there, back = (b[0] - a[0]) * (c[1] - a[1]), (b[1] - a[1]) * (c[0] - a[0])
    if abs(there - back) > DOUBT * (abs(there) + abs(back)) + TINY:  # never where one overflows
        return there - back
    (ax, ay), (bx, by), (cx, cy) = ((Fraction(x), Fraction(y)) for x, y in (a, b, c))
    exact = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    return (exact > 0) - (exact < 0)


def _along(side: Side, x: float, y: float) -> float:
    """How far along a side a point stands."""
    return (x - side[0]) * side[2] + (y - side[1]) * side[3]


def _fan(corners: list) -> tuple:
    """Twice the area of a polygon with a corner at the origin, and that times three times the centroid."""
    twice = along_x = along_y = 0
    for (x, y), (u, v) in zip(corners, corners[1:]):
        cross = x * v - y * u
        twice += cross
        along_x += cross * (x + u)
        along_y += cross * (y + v)
    return twice, along_x, along_y


def _cut(loop: list[Point], sides: list[Side], distances: list[float]) -> list[Point]:
    """Corners of a polygon less a strip along each side, in their order; some may lie in one place.

    What a strip takes hangs together, round its side or, where others took that, round the corner furthest out: with
    the loop opened there, corners go from both ends, each once. New ones divide what is left of old edges; rounding
    hardly moves them, however small the angle.
    """
    left = deque((x, y, k) for k, (x, y) in enumerate(loop))  # each with the side that leaves it
    for k, ((x, y, ux, uy, _), distance) in enumerate(zip(sides, distances)):
        if left[0][2] == k:
            left.rotate(-1)
        front, back = left[0], left[-1]
        first = ux * (front[1] - y) - uy * (front[0] - x) - distance  # how far inside of the strip, at either end
        last = ux * (back[1] - y) - uy * (back[0] - x) - distance
        if first >= 0 and last >= 0:
            continue
        ahead, out_ahead, behind, out_behind = back, last, front, first  # the last that go, from either end
        while first < 0:
            ahead, out_ahead = left.popleft(), first
            if not left:
                return []
            first = ux * (left[0][1] - y) - uy * (left[0][0] - x) - distance
        while last < 0:
            behind, out_behind = left.pop(), last
            last = ux * (left[-1][1] - y) - uy * (left[-1][0] - x) - distance
        front, back = left[0], left[-1]
        if ahead[2] != k:  # else rounding lets go of a side's start but not of its end: then that stays
            left.appendleft((*_between(front, first, ahead, out_ahead), ahead[2]))
        left.append((*_between(back, last, behind, out_behind), k))
    return [(x, y) for x, y, _ in left]


def _between(kept: Corner, inside: float, gone: Corner, outside: float) -> Point:
    """Where an edge is cut, whose ends are so far inside and (negative) outside."""
    t = inside / (inside - outside)
    return kept[0] + t * (gone[0] - kept[0]), kept[1] + t * (gone[1] - kept[1])


def _convex(points: list[Point]) -> list[Point]:
    """Corners of the hull of a few points, by exact turns; most often they are the points, which turn left only."""
    before = zip(points[-2:] + points[:-2], points[-1:] + points[:-1])
    if len(points) > 2 and all(turn(a, b, c) > 0 for (a, b), c in zip(before, points)):
        return points
    ordered = sorted(set(points))
    return ordered if len(ordered) < 3 else _lefts(ordered)[:-1] + _lefts(ordered[::-1])[:-1]


def _lefts(ordered: list[Point]) -> list[Point]:
    """The part of the hull that turns left from the first to the last of ordered points; :mod:`.hull` has integers."""
    chain: list[Point] = []
    for point in ordered:
        while len(chain) > 1 and turn(chain[-2], chain[-1], point) <= 0:
            chain.pop()
        chain.append(point)
    return chain
