"""Planes, and the frames in which sections are drawn."""

from dataclasses import dataclass, field

import numpy as np

from ...common.arrays import Array, IntArray, freeze, unit

# [1] deviation of a normal's length from one below which it is left unchanged, so that saving and reading a plan does
# not change it. Larger: normals that are not quite of unit length.
NORMAL_LENGTH_ROUNDING = 1e-15


@dataclass(frozen=True, eq=False)
class Planes:
    """A family of planes; row i of both arrays is one plane."""

    points: Array  # (n, 3) [m]
    normals: Array  # (n, 3) unit
    directions: Array = field(init=False, repr=False)  # (n, 3) the normals as given, of any length

    def __post_init__(self):
        normals = np.asarray(self.normals, float)
        is_unit = np.abs(np.linalg.norm(normals, axis=-1, keepdims=True) - 1) < NORMAL_LENGTH_ROUNDING
        object.__setattr__(self, "directions", normals)
        object.__setattr__(self, "normals", np.where(is_unit, normals, unit(normals)))
        freeze(self, points=(None, 3), normals=(len(self.points), 3), directions=(len(self.points), 3))

    def __len__(self) -> int:
        return len(self.points)

    def at(self, order: IntArray) -> "Planes":
        """Return the planes at some places of the list."""
        return Planes(self.points[order], self.directions[order])

    def are_parallel(self) -> bool:
        """Return whether all normals are equal to the bit, as in a grid made from one axis."""
        return bool((self.normals == self.normals[0]).all())


def perpendicular(direction: Array) -> Array:
    """Return a unit vector perpendicular to ``direction``, from the link axis least parallel to it; shape (3,)."""
    axis = np.eye(3)[np.argmin(np.abs(direction))]
    return unit(axis - (axis @ direction) * direction / (direction @ direction))
