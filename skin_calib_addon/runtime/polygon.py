"""Convex polygons in a plane: the supporting polygon, and what a walking controller asks of it."""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array
from .hull import GridPoint, HullTable

Point = tuple[float, float]
Line = tuple[float, float, float, float]  # a point and a direction

KINDS = ("empty", "point", "segment", "area")


@dataclass(frozen=True, eq=False)
class Polygon:
    """A convex polygon, counter-clockwise; also what is left of one: a segment, a point, nothing.

    Made by :func:`convex_hull`; then the corners lie on its grid and no three of them on a line.
    """

    corners: Array  # (k, 2) [m]

    @property
    def kind(self) -> str:
        """``"empty"``, ``"point"``, ``"segment"`` or ``"area"``."""
        return KINDS[min(len(self.corners), 3)]

    @cached_property
    def _loop(self) -> list[Point]:
        return [(x, y) for x, y in self.corners.tolist()]

    @cached_property
    def _edges(self) -> list[Line]:
        """Each edge's start and the vector along it."""
        loop = self._loop
        return [(x, y, u - x, v - y) for (x, y), (u, v) in zip(loop, loop[1:] + loop[:1])] if len(loop) > 1 else []

    @cached_property
    def _moments(self) -> tuple[float, float, float]:
        """Area, and its first moments about the first corner."""
        if len(self._loop) < 3:
            return 0.0, 0.0, 0.0
        x0, y0 = self._loop[0]
        area = along_x = along_y = 0.0
        for x, y, dx, dy in self._edges[1:-1]:
            x, y = x - x0, y - y0
            twice = x * dy - y * dx
            area += twice / 2
            along_x += twice * (2 * x + dx) / 6
            along_y += twice * (2 * y + dy) / 6
        return area, along_x, along_y

    @property
    def area(self) -> float:
        """[m^2]; 0 for a segment or a point."""
        return self._moments[0]

    @cached_property
    def centroid(self) -> Array | None:
        """Centre of the area (2,) [m], not the mean of the corners, which is 11 mm off on soles (FORMULAS 3).

        The middle of a segment, the point itself; None where nothing is.
        """
        if not self._loop:
            return None
        area, along_x, along_y = self._moments
        if area <= 0:
            return self.corners.mean(axis=0)
        return self.corners[0] + np.array((along_x, along_y)) / area

    @property
    def bounds(self) -> tuple[Array, Array] | None:
        """Lowest and highest coordinates, each (2,) [m]; None where nothing is."""
        return (self.corners.min(axis=0), self.corners.max(axis=0)) if self._loop else None

    @cached_property
    def half_planes(self) -> tuple[Array, Array]:
        """Outward unit normals (k, 2) and offsets (k,) [m]: a point p is inside where ``normals @ p <= offsets``.

        Empty arrays unless the polygon has an area.
        """
        edges = self._edges if len(self._loop) > 2 else []
        lines = [(dy / r, -dx / r, (x * dy - y * dx) / r) for x, y, dx, dy in edges if (r := math.hypot(dx, dy))]
        table = np.array(lines).reshape(-1, 3)
        return table[:, :2], table[:, 2]

    def margin(self, point: Any) -> float:
        """Distance [m] of a point (2,) to the border, positive inside, negative outside; -inf where nothing is."""
        x, y = map(float, point)
        if len(self._loop) > 2:
            depth = min((dx * (y - b) - dy * (x - a)) / math.hypot(dx, dy) for a, b, dx, dy in self._edges)
            if depth >= 0:
                return depth
        near = self.closest((x, y))
        return -math.inf if near is None else -math.hypot(near[0] - x, near[1] - y)

    def contains(self, point: Any) -> bool:
        """Whether a point (2,) lies inside or on the border; a point that is no number lies nowhere."""
        x, y = map(float, point)
        if len(self._loop) > 2:
            return all(dx * (y - b) - dy * (x - a) >= 0 for a, b, dx, dy in self._edges)
        return self.margin((x, y)) >= 0

    def closest(self, point: Any) -> Array | None:
        """The point (2,) of the polygon nearest to a point: a desired ZMP kept inside (thesis, Algorithm 1, corrected).

        The point itself where it is inside; None where the polygon is empty or the point no number.
        """
        x, y = map(float, point)
        if not self._loop or not (math.isfinite(x) and math.isfinite(y)):
            return None
        if len(self._loop) > 2 and all(dx * (y - b) - dy * (x - a) >= 0 for a, b, dx, dy in self._edges):
            return np.array((x, y))
        best, nearest = math.inf, self._loop[0]
        for a, b, dx, dy in self._edges or [(*self._loop[0], 0.0, 0.0)]:
            length = dx * dx + dy * dy
            t = min(max(((x - a) * dx + (y - b) * dy) / length, 0.0), 1.0) if length else 0.0
            foot = (a + t * dx, b + t * dy)
            distance = math.hypot(foot[0] - x, foot[1] - y)
            if distance < best:
                best, nearest = distance, foot
        return np.array(nearest)

    def inset(self, distance: float) -> "Polygon":
        """The points that are at least ``distance`` [m] from the border; empty where there are none.

        The thesis shrinks a bounding box by 1 cm, which sticks out of nearly every hull (FORMULAS 5).
        """
        if not distance >= 0:
            raise ValueError(f"inset distance {distance} must be 0 or more")
        return self.moved_in([distance] * len(self._edges)) if len(self._loop) > 2 else Polygon(np.empty((0, 2)))

    def moved_in(self, distances: Iterable[float]) -> "Polygon":
        """What is left when each edge moves inward by a distance [m] of its own, 0 or more; empty where nothing is."""
        lines = []
        for (x, y, dx, dy), distance in zip(self._edges, distances):
            r = math.hypot(dx, dy)
            lines.append((x - distance * dy / r, y + distance * dx / r, dx, dy))
        return Polygon(np.array(_left_of_all(lines), float).reshape(-1, 2))


def convex_hull(points: Any) -> Polygon:
    """The smallest convex polygon round points (n, 2) [m], exactly, of the points put on a grid (:mod:`.hull`).

    The grid's step is 2**-29 of the largest coordinate: below a nanometre for a foot. Points on a line give their two
    ends, points in one place that place, none an empty polygon.

    Raises
    ------
    ValueError
        If a point is not finite.
    """
    table = HullTable(np.asarray(points, float).reshape(-1, 2))
    return of_grid(table.hull(np.arange(table.size)), table.step)


def of_grid(corners: list[GridPoint], step: float) -> Polygon:
    """The polygon of corners in whole steps of a grid."""
    return Polygon(np.array(corners, float).reshape(-1, 2) * step)


def _left_of_all(lines: list[Line]) -> list[Point]:
    """Corners of what lies left of all lines, which come in the order of their directions, once round.

    Each line takes away the corners right of it, at both ends of the chain so far, and with them the lines that have
    nothing left; where two that meet then turn by half a circle or more, nothing is left at all.
    """
    kept: deque[Line] = deque()
    corners: deque[Point] = deque()  # corners[i] is where kept[i] and kept[i + 1] meet
    for line in lines:
        x, y, dx, dy = line
        while corners and dx * (corners[-1][1] - y) - dy * (corners[-1][0] - x) <= 0:
            corners.pop()
            kept.pop()
        while corners and dx * (corners[0][1] - y) - dy * (corners[0][0] - x) <= 0:
            corners.popleft()
            kept.popleft()
        if kept:
            if kept[-1][2] * dy - kept[-1][3] * dx <= 0:
                return []
            corners.append(_meet(kept[-1], line))
        kept.append(line)
    while len(corners) > 1:
        x, y, dx, dy = kept[0]
        if dx * (corners[-1][1] - y) - dy * (corners[-1][0] - x) > 0:
            break
        corners.pop()
        kept.pop()
    if len(kept) < 3 or kept[-1][2] * kept[0][3] - kept[-1][3] * kept[0][2] <= 0:
        return []
    return [*corners, _meet(kept[-1], kept[0])]


def _meet(a: Line, b: Line) -> Point:
    """Where two lines that are not parallel meet."""
    t = ((b[0] - a[0]) * b[3] - (b[1] - a[1]) * b[2]) / (a[2] * b[3] - a[3] * b[2])
    return a[0] + t * a[2], a[1] + t * a[3]
