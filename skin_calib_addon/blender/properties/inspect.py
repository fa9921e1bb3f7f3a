# SPDX-License-Identifier: GPL-3.0-or-later
"""How the fitted skin is looked at, as properties: nothing of it belongs to the plan."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from ...common.errors import SkinCalibError
from ..inspection import replay, taxels
from .options import FIXED, LENGTH
from .warning import SKIN_PG_warning

SHARE = FIXED | {"precision": 3}
ANGLE = FIXED | {"subtype": "ANGLE", "precision": 4}


def _find(record, context):
    """A name was typed: read the taxel that has it."""
    record.problem = ""
    if record.wanted.strip():
        try:
            taxels.read_taxel(record.id_data, record.wanted, context.scene)
        except SkinCalibError as error:
            record.problem = str(error)


class SKIN_PG_taxel(bpy.types.PropertyGroup):
    """The numbers of a taxel that was asked for."""

    wanted: StringProperty(
        name="Find", description="Id or channel of a taxel, to read its numbers", **FIXED | {"update": _find}
    )
    problem: StringProperty(description="Why the taxel that was typed is not found", **FIXED)
    key: StringProperty(description="Of which fit it is", **FIXED)
    id: StringProperty(name="Id", description="Name of the taxel", **FIXED)
    channel: IntProperty(name="Channel", description="Where the taxel stands in a reading", **FIXED)
    index: IntVectorProperty(
        name="Row, Column", description="Row and column on a sheet, axial coordinates of a board", size=2, **FIXED
    )
    position: FloatVectorProperty(
        name="Position",
        description="Centre of the taxel, in the link frame",
        **FIXED | {"subtype": "TRANSLATION", "unit": "LENGTH", "precision": 5},
    )
    normal: FloatVectorProperty(
        name="Normal",
        description="Which way the taxel looks, in the link frame",
        **FIXED | {"subtype": "XYZ", "precision": 5},
    )
    area: FloatProperty(name="Area", description="Area of the cell", unit="AREA", precision=5, **FIXED)
    has_strain: BoolProperty(description="The skin can be stretched", **FIXED)
    strain_along: FloatProperty(name="Strain Along [%]", description="Strain along the row, in hundredths", **SHARE)
    strain_across: FloatProperty(name="Across [%]", description="Strain across the rows, in hundredths", **SHARE)
    shear: FloatProperty(name="Shear", description="By how much the cell leaves the right angle", **ANGLE)
    has_tilt: BoolProperty(description="The taxel has a neighbour", **FIXED)
    tilt: FloatProperty(name="Tilt", description="Largest angle to a neighbour", **ANGLE)
    neighbours: StringProperty(name="Neighbours", description="Ids of the taxels beside it", **FIXED)


class SKIN_PG_comparison(bpy.types.PropertyGroup):
    """How far the taxels are from those of a file."""

    file: StringProperty(name="File", description="With whose taxels was compared", **FIXED)
    key: StringProperty(description="Which fit was compared", **FIXED)
    token: StringProperty(description="Under which what is drawn of it is kept", **FIXED)
    by: StringProperty(name="Paired", description="What tells which taxels belong together", **FIXED)
    pairs: IntProperty(name="Pairs", description="Taxels that are compared", **FIXED)
    mean: FloatProperty(name="Mean", description="Mean distance between two that belong together", **LENGTH)
    max: FloatProperty(name="Max", description="Largest distance between two that belong together", **LENGTH)
    has_angles: BoolProperty(description="The file has normals", **FIXED)
    mean_angle: FloatProperty(name="Mean Angle", description="Mean angle between two normals", **ANGLE)
    max_angle: FloatProperty(name="Max", description="Largest angle between two normals", **ANGLE)
    worst: StringProperty(name="Worst", description="The taxel that is furthest off", **FIXED)
    told: StringProperty(description="What else is to be known, a line each", **FIXED)


class SKIN_PG_touches(bpy.types.PropertyGroup):
    """How far the skin is from where it was touched."""

    file: StringProperty(name="File", description="The table of touches", **FIXED)
    key: StringProperty(description="Which fit was compared", **FIXED)
    token: StringProperty(description="Under which what is drawn of it is kept", **FIXED)
    told: StringProperty(description="What the touches say, a line each", **FIXED)
    warnings: CollectionProperty(type=SKIN_PG_warning, description="What the author should look at", **FIXED)


def _share(record):
    """How far the frame is through the recording."""
    shown = replay.find(record.id_data)
    return 0.0 if shown is None or len(shown) == 1 else 100 * replay.frame_of(record) / (len(shown) - 1)


def _set_share(record, share):
    shown = replay.find(record.id_data)
    if shown is not None:
        replay.choose(record, round(share / 100 * (len(shown) - 1)))


class SKIN_PG_replay(bpy.types.PropertyGroup):
    """A recording that is shown over the skin."""

    file: StringProperty(name="File", description="The recording", **FIXED)
    key: StringProperty(description="Over which fit it is shown", **FIXED)
    token: StringProperty(description="Under which it is kept while Blender runs", **FIXED)
    chosen: IntProperty(description="The frame that is shown while nothing plays", **FIXED)
    frame: IntProperty(
        name="Frame",
        description="Which frame is shown, from 0",
        min=0,
        get=replay.frame_of,
        set=replay.choose,
        options=set(),
    )
    share: FloatProperty(
        name="Position",
        description="How far the frame is through the recording",
        subtype="PERCENTAGE",
        min=0,
        max=100,
        get=_share,
        set=_set_share,
        options=set(),
    )
    speed: FloatProperty(
        name="Speed",
        description="How many times as fast as recorded it is played",
        default=1.0,
        min=0.01,
        max=100,
        **FIXED | {"update": replay.paced},
    )
    loop: BoolProperty(name="Loop", description="Begin again at the end", default=True, **FIXED)


class SKIN_PG_inspect(bpy.types.PropertyGroup):
    """How the fitted skin of a link is looked at."""

    heat: EnumProperty(
        name="Heat Map",
        description="What colours stand for",
        items=[
            ("NONE", "None", "No colours"),
            ("ERROR", "Error", "How far the mesh is from the surface, along the rays of the fit"),
            ("STRAIN", "Strain", "The larger one of the strains of a cell along and across its row"),
            ("TILT", "Tilt", "The largest angle between a taxel and a neighbour"),
            ("FORCE", "Force", "Forces, contacts, CoP and supporting polygons of a replayed recording"),
        ],
        **FIXED,
    )
    labels: EnumProperty(
        name="Labels",
        description="What is written at the taxels that face the viewer, as far as there is room",
        items=[
            ("NONE", "None", "Nothing"),
            ("ID", "Ids", "Ids of the taxels"),
            ("CHANNEL", "Channels", "Where the taxels stand in a reading"),
        ],
        **FIXED,
    )
    auto_length: BoolProperty(
        name="Automatic Normals",
        description="Draw normals in proportion to the cells and to the link",
        default=True,
        **FIXED,
    )
    length: FloatProperty(name="Normals", description="How long normals are drawn", default=0.006, min=0, **LENGTH)
    text_size: IntProperty(
        name="Text Size", description="Size of the labels, in points", default=11, min=6, max=60, **FIXED
    )
    line_width: FloatProperty(
        name="Line Width", description="Width of all lines, as a factor", default=1.0, min=0.25, max=10, **FIXED
    )

    taxel: PointerProperty(type=SKIN_PG_taxel, name="Taxel", description="The taxel whose numbers are shown")

    comparison: PointerProperty(
        type=SKIN_PG_comparison, name="Comparison", description="How far the taxels are from those of a file"
    )

    touches: PointerProperty(
        type=SKIN_PG_touches, name="Touches", description="How far the skin is from where it was touched"
    )

    replay: PointerProperty(type=SKIN_PG_replay, name="Replay", description="A recording that is shown over the skin")

    def tokens(self):
        """Names of what is drawn besides, if it is of the last fit."""
        key = self.id_data.skin_calib.result.key
        if self.taxel.id and self.taxel.key == key:
            yield taxels.token_of(self.taxel.key, self.taxel.id)
        if self.comparison.token and self.comparison.key == key:
            yield self.comparison.token
        if self.touches.token and self.touches.key == key:
            yield self.touches.token
        if self.replay.token and self.replay.key == key:
            yield self.replay.token


CLASSES = (SKIN_PG_taxel, SKIN_PG_comparison, SKIN_PG_touches, SKIN_PG_replay, SKIN_PG_inspect)
