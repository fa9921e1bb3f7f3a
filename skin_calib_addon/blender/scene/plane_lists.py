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


@dataclass(frozen=True, eq=False)
class HandPlanes:
    """The planes of a plan that the author placed one by one, by family; row i of both arrays is one plane."""

    points: dict[str, Array]  # (k, 3) [m]
    normals: dict[str, Array]  # (k, 3), of any length
    shell: str  # which shells of the mesh are kept, as in a CoverSpec
    closed: bool  # whether the v-planes go all round the link

    @property
    def are_there(self) -> bool:
        """Return whether there is any plane."""
        return any(len(points) for points in self.points.values())

    def is_same(self, other: "HandPlanes") -> bool:
        """Return whether other planes make the same sketch."""
        pairs = (
            (getattr(self, n)[family], getattr(other, n)[family]) for n in ("points", "normals") for family in FAMILIES
        )
        return (self.shell, self.closed) == (other.shell, other.closed) and all(np.array_equal(a, b) for a, b in pairs)


def read_hand_planes(link: bpy.types.Object, scene: bpy.types.Scene) -> HandPlanes:
    """Return the planes that were placed one by one, valid or not: cuts, and those of a grid of such planes."""
    settings, metre = link.skin_calib, metres_per_unit(scene)
    is_by_hand = settings.grid.kind == "planes"
    families = {
        "CUT": settings.cover.cuts,
        "U": settings.grid.u if is_by_hand else (),
        "V": settings.grid.v if is_by_hand else (),
    }
    points = {name: np.array([vector(p.point, metre) for p in planes]) for name, planes in families.items()}
    normals = {name: np.array([vector(p.normal) for p in planes]) for name, planes in families.items()}
    return HandPlanes(
        {name: rows.reshape(-1, 3) for name, rows in points.items()},
        {name: rows.reshape(-1, 3) for name, rows in normals.items()},
        settings.cover.shell,
        settings.grid.closed,
    )


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
