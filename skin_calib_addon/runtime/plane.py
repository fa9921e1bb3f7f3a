"""Describe the ground: the plane in which CoP, ZMP and supporting polygons have their coordinates."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..common.arrays import Array, freeze, unit

# Cosine of the angle between a taxel's normal and straight down from which on the taxel can stand on the ground: 60
# degrees. Larger: fewer taxels at the rim of a sole count for CoP and polygons.
MIN_DOWNWARD = 0.5
# Length of the mean normal [1] of the lower taxels from which on a skin counts as flat and gets a ground.
# Larger: a slightly curved sole has no ground; smaller: a strongly curved skin gets one.
MIN_FLATNESS = 0.95


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane in the frame of a link or of the world; its z axis points out of the ground, into the robot."""

    origin: Array  # (3,) [m]
    axes: Array  # (3, 3), rows x, y, z: unit, right-handed

    def __post_init__(self):
        freeze(self, origin=(3,), axes=(3, 3))

    @classmethod
    def through(cls, point: Any, up: Any, forward: Any = (1.0, 0.0, 0.0)) -> "Plane":
        """Return the plane through a point, with its x axis along the component of ``forward`` in the plane.

        The origin of the plane is the projection of the frame's origin. The plane of a flat sole therefore has the
        x and y coordinates of the link.

        Parameters
        ----------
        point : array, shape (3,)
            Any point of the plane [m].
        up : array, shape (3,)
            Normal of the plane, out of the ground; any length.
        forward : array, shape (3,)
            Direction whose projection is the x axis; any length.

        Raises
        ------
        ValueError
            If ``up`` or ``forward`` is zero, or both are parallel.
        """
        z = unit(np.array(up, float))
        x = np.array(forward, float)
        x = unit(x - (x @ z) * z)
        if not (np.isclose(z @ z, 1) and np.isclose(x @ x, 1)):
            raise ValueError(f"up {up} and forward {forward} must not be zero and not be parallel")
        return cls((np.array(point, float) @ z) * z, np.stack((x, np.cross(z, x), z)))

    def flat(self, points: Array) -> Array:
        """Return the coordinates (..., 2) in the plane of the projections of points (..., 3)."""
        return (points - self.origin) @ self.axes[:2].T

    def heights(self, points: Array) -> Array:
        """Return the heights (...) of points (..., 3) over the plane [m]."""
        return (points - self.origin) @ self.axes[2]

    def spatial(self, points: Array) -> Array:
        """Return the points (..., 3) of the plane that have the coordinates (..., 2) in it."""
        return self.origin + points @ self.axes[:2]

    def wrench(self, wrench: Array) -> Array:
        r"""Return a wrench (6,) about the origin of the plane, along its axes.

        With the rows of ``axes`` as :math:`R` and the origin :math:`\mathbf{o}`:

        .. math::
            \mathbf{f}' = R\,\mathbf{f} , \qquad
            \boldsymbol{\tau}' = R\,(\boldsymbol{\tau} - \mathbf{o} \times \mathbf{f}) .
        """
        force, moment = wrench[:3], wrench[3:] - cross(self.origin, wrench[:3])
        return np.concatenate((self.axes @ force, self.axes @ moment))


def cross(a: Array, b: Array) -> Array:
    """Return the cross product of two vectors (3,); ``np.cross`` takes ten times as long for one pair."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx))


def ground_of(positions: Array, normals: Array, areas: Array) -> Plane | None:
    """Return the plane on which a flat skin stands, in its link frame; None if it is not flat. Rows are taxels (n,)."""
    down = unit(areas @ normals)
    is_lower = normals @ down >= MIN_DOWNWARD
    if not is_lower.any():
        return None
    positions, normals, weights = positions[is_lower], normals[is_lower], areas[is_lower] / areas[is_lower].sum()
    mean = weights @ normals
    if np.linalg.norm(mean) < MIN_FLATNESS:
        return None
    up = -unit(mean)
    forward = (1.0, 0.0, 0.0) if abs(up[0]) < 0.9 else (0.0, 0.0, 1.0)  # the normal of a palm may be along x
    return Plane.through(weights @ positions, up, forward)
