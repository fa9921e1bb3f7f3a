"""The ground as a plane with axes of its own: where CoP, ZMP and supporting polygons are measured."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..common.arrays import Array, freeze, unit

# A taxel that looks down by less than 60 degrees off the vertical can stand on the ground.
DOWNWARD = 0.5
# A skin whose lower taxels look one way this much, as the length of their mean normal, stands on the plane below them.
FLAT = 0.95


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane in the frame of a link, or of the world; z points up from the ground, into the robot."""

    origin: Array  # (3,) [m]
    axes: Array  # (3, 3), rows x, y, z: unit, right-handed

    def __post_init__(self):
        freeze(self, origin=(3,), axes=(3, 3))

    @classmethod
    def through(cls, point: Any, up: Any, forward: Any = (1.0, 0.0, 0.0)) -> "Plane":
        """The plane through a point, with its x axis along the part of ``forward`` that lies in it.

        Its origin is the foot of the frame's own origin, so that a flat sole's plane has the coordinates of the link.

        Raises
        ------
        ValueError
            If ``up`` has no direction, or ``forward`` is along it.
        """
        z = unit(np.array(up, float))
        x = np.array(forward, float)
        x = unit(x - (x @ z) * z)
        if not (np.isclose(z @ z, 1) and np.isclose(x @ x, 1)):
            raise ValueError(f"up {up} and forward {forward} must be two directions, not one and not zero")
        return cls((np.array(point, float) @ z) * z, np.stack((x, np.cross(z, x), z)))

    def flat(self, points: Array) -> Array:
        """Coordinates (..., 2) in the plane of points (..., 3): where they stand over it."""
        return (points - self.origin) @ self.axes[:2].T

    def heights(self, points: Array) -> Array:
        """Heights (...) of points (..., 3) over the plane [m]."""
        return (points - self.origin) @ self.axes[2]

    def spatial(self, points: Array) -> Array:
        """Points (..., 3) of the plane from their coordinates (..., 2) in it."""
        return self.origin + points @ self.axes[:2]

    def wrench(self, wrench: Array) -> Array:
        """A wrench (6,) about the frame's origin, taken about the plane's origin and along its axes."""
        force, moment = wrench[:3], wrench[3:] - cross(self.origin, wrench[:3])
        return np.concatenate((self.axes @ force, self.axes @ moment))


def cross(a: Array, b: Array) -> Array:
    """Cross product of two vectors (3,); ``np.cross`` takes ten times as long for so few."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx))


def ground_of(positions: Array, normals: Array, areas: Array) -> Plane | None:
    """The plane that a flat skin stands on, in its link's frame; None where the skin looks too many ways.

    Parameters
    ----------
    positions, normals : array, shape (n, 3)
        Of the taxels; normals out of the robot, to the ground.
    areas : array, shape (n,)
    """
    down = unit(areas @ normals)
    below = normals @ down >= DOWNWARD
    if not below.any():
        return None
    positions, normals, shares = positions[below], normals[below], areas[below] / areas[below].sum()
    mean = shares @ normals
    if np.linalg.norm(mean) < FLAT:
        return None
    up = -unit(mean)
    forward = (1.0, 0.0, 0.0) if abs(up[0]) < 0.9 else (0.0, 0.0, 1.0)  # a palm may look along x
    return Plane.through(shares @ positions, up, forward)
