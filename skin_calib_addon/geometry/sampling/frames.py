"""Cylinder coordinates about a line."""

from dataclasses import dataclass

import numpy as np

from ...common.arrays import Array, along, unit
from .planes import Planes, perpendicular

# [1] direction in the link frame that gives a line its sense. No axis of the frame, no diagonal and no plane of them is
# perpendicular to it, so that a line that is nearly along one of these has a clear sense.
SENSE = np.array((1.0, 2.0, 4.0))


@dataclass(frozen=True, eq=False)
class TubeFrame:
    """Cylinder coordinates about an axis: stations along ``e3``, angles from ``e1`` towards ``e2``."""

    point: Array  # (3,) [m]
    e1: Array  # (3,) unit, as are e2 and e3; right-handed
    e2: Array
    e3: Array

    def stations(self, points: Array) -> Array:
        """Return the heights of points along the axis [m]."""
        return along(points - self.point, self.e3)

    def extent(self, points: Array) -> tuple[float, float]:
        """Return the least and the largest station of points (n, 3) [m]."""
        stations = self.stations(points)
        return float(stations.min()), float(stations.max())

    def rays(self, angles: Array) -> Array:
        """Return unit directions away from the axis, shape (len(angles), 3)."""
        return np.cos(angles)[:, None] * self.e1 + np.sin(angles)[:, None] * self.e2

    def fan(self, stations: Array, angles: Array) -> Array:
        """Return unit directions (k, l, 3) away from the axis at k stations and l angles."""
        return np.broadcast_to(self.rays(angles), (len(stations), len(angles), 3))

    def across(self, vectors: Array) -> Array:
        """Return the components across the axis, shape (..., 2)."""
        return np.stack((along(vectors, self.e1), along(vectors, self.e2)), axis=-1)

    def planes(self, stations: Array) -> Planes:
        """Return planes across the axis."""
        points = self.point + np.asarray(stations)[:, None] * self.e3
        return Planes(points, np.broadcast_to(self.e3, points.shape))


def frame_of(point: Array, direction: Array, towards: Array | None = None) -> TubeFrame:
    """Return cylinder coordinates about a line."""
    e3 = unit(direction)
    e1 = perpendicular(e3) if towards is None else towards - (towards @ e3) * e3
    e1 = unit(e1) if np.linalg.norm(e1) > 0 else perpendicular(e3)
    return TubeFrame(np.asarray(point, float), e1, np.cross(e3, e1), e3)


def link_side(direction: Array) -> float:
    """Return the sense of a line in the link frame: 1, or -1 where the opposite direction is preferred.

    The preferred direction of a line along an axis of the frame is that of the axis.
    """
    return 1.0 if direction @ SENSE > 0 else -1.0


def link_direction(direction: Array) -> Array:
    r"""Return a unit vector (3,) across a line that the link frame alone defines.

    It is the projection of :math:`\mathbf{x} + d_x^2\, \mathbf{y}` with the axes :math:`\mathbf{x}` and
    :math:`\mathbf{y}` of the link frame and the unit direction :math:`\mathbf{d}`: the x axis for lines along y and z,
    the y axis for lines along x, and a smooth transition between them.
    """
    e3 = unit(direction)
    side = np.array((1.0, e3[0] ** 2, 0.0))
    return unit(side - (side @ e3) * e3)
