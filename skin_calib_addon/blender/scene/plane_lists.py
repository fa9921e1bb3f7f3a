# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists of planes in a plan's properties as arrays, and back."""

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ...common.arrays import Array
from ...geometry import Planes
from .units import in_units, metres_per_unit, vector

FAMILIES = ("CUT", "U", "V")


@dataclass(frozen=True)
class HandPlanes:
    """The planes of a plan that the author placed one by one."""

    planes: dict[str, tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]]  # point [m] and normal, by family
    shell: str  # which shells of the mesh are kept, as in a CoverSpec
    closed: bool  # whether the v-planes go all round the link

    @property
    def are_there(self) -> bool:
        """Return whether there is any plane."""
        return any(self.planes.values())

    def points(self, family: str) -> Array:
        """Return the points of the planes of a family, shape (k, 3) [m]."""
        return np.array([point for point, _ in self.planes[family]]).reshape(-1, 3)

    def normals(self, family: str) -> Array:
        """Return their normals, shape (k, 3), of any length."""
        return np.array([normal for _, normal in self.planes[family]]).reshape(-1, 3)


def read_hand_planes(link: bpy.types.Object, scene: bpy.types.Scene) -> HandPlanes:
    """Return the planes that were placed one by one, valid or not: cuts, and those of a grid of such planes."""
    settings, metre = link.skin_calib, metres_per_unit(scene)
    grid = settings.grid if settings.grid.kind == "planes" else None
    lists = {"CUT": settings.cover.cuts, "U": grid.u if grid else (), "V": grid.v if grid else ()}
    planes = {
        family: tuple((tuple(vector(p.point, metre)), tuple(vector(p.normal))) for p in listed)
        for family, listed in lists.items()
    }
    return HandPlanes(planes, settings.cover.shell, settings.grid.closed)


def read_planes(grid: Any, family: str, scene: bpy.types.Scene) -> Planes | None:
    """Return the "u" or "v" planes of a grid."""
    metre, listed = metres_per_unit(scene), getattr(grid, family)
    if not listed:
        return None
    return Planes(
        np.array([vector(plane.point, metre) for plane in listed]), np.array([vector(p.normal) for p in listed])
    )


def write_planes(grid: Any, family: str, planes: Planes, scene: bpy.types.Scene) -> None:
    """Replace the "u" or "v" planes of a grid."""
    listed = getattr(grid, family)
    listed.clear()
    for point, normal in zip(planes.points, planes.normals):
        set_plane(listed.add(), point, normal, scene)


def set_plane(item: Any, point: Array, normal: Array, scene: bpy.types.Scene) -> None:
    """Set one plane of a list."""
    item.point, item.normal = in_units(point, metres_per_unit(scene)), normal
