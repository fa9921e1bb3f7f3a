# SPDX-License-Identifier: GPL-3.0-or-later
"""Which part of the mesh is covered and where the planes are, as properties."""

from collections.abc import Callable
from typing import Any

import bpy
from bpy.props import EnumProperty

from ...plan.keys import COVER, GRID_KINDS, GRID_REGIONS, GRIDS, PLANE
from .of_keys import items_of, of_keys
from .options import PLAN, whole


@of_keys(PLANE)
class SKIN_PG_plane(bpy.types.PropertyGroup):
    """A plane in the link frame."""


def _give_handles(family: str) -> Callable[[Any, Any], None]:
    """Return an update that gives the handles to the plane that is selected in a list."""

    def give(group: Any, _context: Any) -> None:
        group.id_data.skin_calib.held = family

    return give


@of_keys(COVER)
class SKIN_PG_cover(bpy.types.PropertyGroup):
    """What of the mesh is covered with skin."""

    cut_index: whole(name="Cut", description="Which cut has the handles", min=0, update=_give_handles("CUT"))


@of_keys(*GRIDS.values())
class SKIN_PG_grid(bpy.types.PropertyGroup):
    """Where the planes are."""

    kind: EnumProperty(name="Kind", description="How planes and lines are given", items=items_of(GRID_KINDS), **PLAN)
    region: EnumProperty(
        name="Region", description="What the automatic grid covers", items=items_of(GRID_REGIONS), **PLAN
    )
    u_index: whole(name="U-Plane", description="Which u-plane is selected", min=0, update=_give_handles("U"))
    v_index: whole(name="V-Plane", description="Which v-plane is selected", min=0, update=_give_handles("V"))
