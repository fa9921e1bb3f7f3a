# SPDX-License-Identifier: GPL-3.0-or-later
"""The skins of a plan as properties: sheets, boards, imported taxels; their lists."""

from typing import Any

import bpy
from bpy.props import EnumProperty, StringProperty

from ...common.errors import InvalidPlan
from ...plan.keys import LANDMARK, SINGLE_TAXEL, SKIN_KINDS, SKINS_OF, ZONE
from ..scene.fields import read_cells
from .of_keys import items_of, of_keys
from .options import PLAN, flag, outdate, text


def _check_cells(skin: Any, context: Any) -> None:
    outdate(skin, context)
    try:
        skin.cells_wrong = not read_cells(skin.cells)
    except InvalidPlan:
        skin.cells_wrong = True


@of_keys(LANDMARK)
class SKIN_PG_landmark(bpy.types.PropertyGroup):
    """A cell that is pinned to a point."""


@of_keys(ZONE)
class SKIN_PG_zone(bpy.types.PropertyGroup):
    """A disc that boards must not cover."""


@of_keys(SINGLE_TAXEL)
class SKIN_PG_single_taxel(bpy.types.PropertyGroup):
    """A taxel that differs from the others of its skin."""


@of_keys(*SKINS_OF.values())
class SKIN_PG_skin(bpy.types.PropertyGroup):
    """A sheet of taxels, hexagonal boards, or taxels of a file."""

    kind: EnumProperty(name="Kind", description="What the skin is made of", items=items_of(SKIN_KINDS), **PLAN)
    zone_group: StringProperty(
        name="Vertex Group",
        description="Boards stay off the faces of this vertex group, as it is at each fit. A plan file has excluded "
        "zones over these faces",
        **PLAN,
    )
    opened: flag(name="Open", description="Show what this skin has, in a list of several")
    cells: text(
        name="Cells",
        description="The boards as q,r with spaces between: 0,0 is the root, q counts along its row, r along the "
        "direction 60 degrees to its left",
        update=_check_cells,
    )
    cells_wrong: flag(description="The list of cells is empty or cannot be read", default=True)
