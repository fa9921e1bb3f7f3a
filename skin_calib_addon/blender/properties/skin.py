# SPDX-License-Identifier: GPL-3.0-or-later
"""The skins of a plan as properties: sheets, boards, imported taxels, and what holds them or keeps them away."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    StringProperty,
)

from ...calibration.exchange import FORMATS, READABLE
from ...calibration.model import MAX_CHANNEL
from ...common.errors import InvalidPlan
from ...plan.skins import SIDE
from ..scene.skins import read_cells
from .options import FILE, FIXED, PLACE, PLAN, SIZE, WAY, outdate

FORMAT_ITEMS = [
    ("auto", "Automatic", "The content of the file tells"),
    *((name, name, FORMATS[name].what) for name in READABLE),
]


def _read_cells(skin, context):
    outdate(skin, context)
    try:
        skin.cells_wrong = not read_cells(skin.cells)
    except InvalidPlan:
        skin.cells_wrong = True


class SKIN_PG_landmark(bpy.types.PropertyGroup):
    """A cell that is pinned to a point."""

    cell: IntVectorProperty(
        name="Cell", description="Row and column of the cell, counted from 0", size=2, min=0, max=999, **PLAN
    )
    point: FloatVectorProperty(
        name="Point", description="Where the centre of the cell lies, in the link frame", **PLACE
    )


class SKIN_PG_zone(bpy.types.PropertyGroup):
    """A disc that boards keep clear of."""

    point: FloatVectorProperty(name="Point", description="Middle of the zone, in the link frame", **PLACE)
    radius: FloatProperty(
        name="Radius", description="Boards keep so far away from the point", default=0.005, min=0, **SIZE
    )


class SKIN_PG_skin(bpy.types.PropertyGroup):
    """A sheet of taxels, hexagonal boards, or taxels of a file."""

    name: StringProperty(
        name="Name", description="Name of the patch; ids of taxels begin with it", default="skin", **PLAN
    )
    kind: EnumProperty(
        name="Kind",
        description="What the skin is made of",
        items=[
            ("sheet", "Sheet", "Rows of cells on a flexible sheet that bends with the surface"),
            ("hexagons", "Hexagons", "Rigid hexagonal boards beside each other"),
            ("imported", "Imported", "Taxels that stand in a file of another program"),
        ],
        **PLAN,
    )
    rows: IntProperty(name="Rows", description="Rows of cells", default=6, min=1, max=1000, **PLAN)
    columns: IntProperty(name="Columns", description="Cells in a row", default=22, min=1, max=1000, **PLAN)
    pitch: FloatVectorProperty(
        name="Pitch",
        description="From row to row, and from column to column",
        size=2,
        unit="LENGTH",
        default=(0.01, 0.01),
        min=0,
        precision=5,
        **PLAN,
    )
    hand: EnumProperty(
        name="Hand",
        description="On which side of a row the next one lies",
        items=[
            ("right", "Right", "The next row lies to the left of where the rows run to, seen from outside"),
            ("left", "Left", "The next row lies to the right, as on a sheet that lies face down"),
        ],
        **PLAN,
    )
    trim: BoolProperty(
        name="Trim", description="Leave out cells that lie off the surface, instead of refusing them", **PLAN
    )
    landmarks: CollectionProperty(
        type=SKIN_PG_landmark, name="Landmarks", description="Cells that are pinned to points of the mesh", **FIXED
    )
    side: FloatProperty(name="Side", description="Length of the sides of a board", default=SIDE, min=0, **SIZE)
    auto_gap: BoolProperty(
        name="Standard Gap",
        description="Boards trimmed like those of the TUM skin: with sides of 16.3 mm they stand 27.75 mm apart",
        default=True,
        **PLAN,
    )
    gap: FloatProperty(
        name="Gap",
        description="Between the sides of two boards that face each other; negative where boards are trimmed",
        **SIZE,
    )
    choice: EnumProperty(
        name="Boards",
        description="Which boards there are",
        items=[
            ("fill", "Fill", "As many as fit: they are turned and moved until most lie on the mesh"),
            ("all", "All", "All that fit, with the root at the origin and its row along the direction"),
            ("listed", "Listed", "Those that are listed, with the root at the origin and its row along the direction"),
        ],
        **PLAN,
    )
    cells: StringProperty(
        name="Cells",
        description="The boards as q,r with spaces between: 0,0 is the root, q counts along its row, r to the side",
        **FIXED | {"update": _read_cells},
    )
    cells_wrong: BoolProperty(description="The list of cells is empty or cannot be read", default=True, **FIXED)
    excluded: CollectionProperty(
        type=SKIN_PG_zone, name="Excluded", description="Discs that boards keep clear of: screws, cables", **FIXED
    )
    centred: BoolProperty(
        name="Centred", description="Centre the sheet on the surface; boards begin in its middle", default=True, **PLAN
    )
    origin: FloatVectorProperty(
        name="Origin", description="Where the centre of cell (0, 0) lies, in the link frame", **PLACE
    )
    auto_direction: BoolProperty(
        name="Automatic Direction", description="Boards stand along the lines of the surface", default=True, **PLAN
    )
    direction: FloatVectorProperty(name="Direction", description="Where the rows run to", default=(0, 1, 0), **WAY)
    offset: FloatProperty(
        name="Offset",
        description="Height of the skin's neutral layer above the surface: where it keeps its lengths",
        **SIZE,
    )
    file: StringProperty(
        name="File",
        description="The file that has the taxels; a path that begins with // is relative to the .blend",
        **FILE,
    )
    format: EnumProperty(name="Format", description="What the file is", items=FORMAT_ITEMS, **PLAN)
    only: StringProperty(
        name="Only", description="Pattern of the labels that are taken, such as l_forearm_skin_*; empty: all", **PLAN
    )
    framed: BoolProperty(
        name="Own Frame", description="The file is in another frame than that of the link: turn and move it", **PLAN
    )
    rotation: FloatVectorProperty(
        name="Rotation",
        description="From the frame of the file into that of the link, by rows",
        size=9,  # Blender transposes rows that are given to a matrix
        default=(1, 0, 0, 0, 1, 0, 0, 0, 1),
        precision=4,
        **PLAN,
    )
    translation: FloatVectorProperty(
        name="Translation", description="Of the file's frame, in the link frame; the rotation comes first", **PLACE
    )
    snap: BoolProperty(
        name="Snap", description="Move the taxels to the surface, instead of telling how far off they are", **PLAN
    )
    auto_channel: BoolProperty(
        name="Channels Follow", description="Its channels go on after those of the skin before", **PLAN
    )
    first_channel: IntProperty(
        name="First Channel", description="Channel of the first taxel", min=0, max=MAX_CHANNEL, **PLAN
    )


CLASSES = (SKIN_PG_landmark, SKIN_PG_zone, SKIN_PG_skin)
