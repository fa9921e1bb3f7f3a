# SPDX-License-Identifier: GPL-3.0-or-later
"""How the fitted skin is inspected, as properties; they are not part of the plan."""

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
from ..live.advice import mark_of, shown_warnings
from .millimetres import with_millimetres
from .options import FIXED, LENGTH
from .warning import SKIN_PG_warning

PERCENT = FIXED | {"precision": 3}
ANGLE = FIXED | {"subtype": "ANGLE", "precision": 4}


def _find(record, context):
    """Read the taxel whose name was typed."""
    record.problem = ""
    if record.wanted.strip():
        try:
            taxels.read_taxel(record.id_data, record.wanted, context.scene)
        except SkinCalibError as error:
            record.problem = str(error)


@with_millimetres
class SKIN_PG_taxel(bpy.types.PropertyGroup):
    """The values of the selected taxel."""

    wanted: StringProperty(
        name="Find", description="Id or channel of a taxel, to read its values", **FIXED | {"update": _find}
    )
    problem: StringProperty(description="Why the taxel is not found", **FIXED)
    key: StringProperty(description="Key of the fit that it belongs to", **FIXED)
    id: StringProperty(name="Id", description="Name of the taxel", **FIXED)
    disabled: BoolProperty(description="Whether the taxel is not in the calibration", **FIXED)
    channel: IntProperty(name="Channel", description="Position of the taxel in a reading", **FIXED)
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
        description="Outward normal of the taxel, in the link frame",
        **FIXED | {"subtype": "XYZ", "precision": 5},
    )
    area: FloatProperty(name="Area", description="Area of the cell", unit="AREA", precision=5, **FIXED)
    has_strain: BoolProperty(description="Whether the skin is a sheet, which has strain", **FIXED)
    strain_along: FloatProperty(name="Strain Along [%]", description="Strain along the row, in percent", **PERCENT)
    strain_across: FloatProperty(name="Across [%]", description="Strain across the rows, in percent", **PERCENT)
    shear: FloatProperty(name="Shear", description="Deviation of the angle of the cell from 90 degrees", **ANGLE)
    has_tilt: BoolProperty(description="Whether the taxel has a neighbour", **FIXED)
    tilt: FloatProperty(name="Tilt", description="Largest angle to a neighbour", **ANGLE)
    neighbours: StringProperty(name="Neighbours", description="Ids of the adjacent taxels", **FIXED)


@with_millimetres
class SKIN_PG_comparison(bpy.types.PropertyGroup):
    """Distances of the taxels from those of a file."""

    file: StringProperty(name="File", description="File of the other taxels", **FIXED)
    key: StringProperty(description="Key of the fit that was compared", **FIXED)
    token: StringProperty(description="Name under which its drawing is cached", **FIXED)
    by: StringProperty(name="Paired", description="How taxels are paired", **FIXED)
    pairs: IntProperty(name="Pairs", description="Number of pairs", **FIXED)
    mean: FloatProperty(name="Mean", description="Mean distance of a pair", **LENGTH)
    max: FloatProperty(name="Max", description="Largest distance of a pair", **LENGTH)
    has_angles: BoolProperty(description="Whether the file has normals", **FIXED)
    mean_angle: FloatProperty(name="Mean Angle", description="Mean angle between the normals of a pair", **ANGLE)
    max_angle: FloatProperty(name="Max", description="Largest angle between the normals of a pair", **ANGLE)
    worst: StringProperty(name="Worst", description="Taxel with the largest distance", **FIXED)
    remarks: StringProperty(description="Further remarks, one in a line", **FIXED)


class SKIN_PG_touches(bpy.types.PropertyGroup):
    """Distances of the skin from touches."""

    file: StringProperty(name="File", description="The table of touches", **FIXED)
    key: StringProperty(description="Key of the fit that was compared", **FIXED)
    token: StringProperty(description="Name under which its drawing is cached", **FIXED)
    remarks: StringProperty(description="Results, one in a line", **FIXED)
    warnings: CollectionProperty(type=SKIN_PG_warning, description="Warnings of the comparison", **FIXED)


def _progress(record):
    """Return the position of the frame in the recording, in percent."""
    shown = replay.find(record.id_data)
    return 0.0 if shown is None or len(shown) == 1 else 100 * replay.frame_of(record) / (len(shown) - 1)


def _set_progress(record, progress):
    shown = replay.find(record.id_data)
    if shown is not None:
        replay.choose(record, round(progress / 100 * (len(shown) - 1)))


class SKIN_PG_replay(bpy.types.PropertyGroup):
    """A recording that is shown over the skin."""

    file: StringProperty(name="File", description="The recording", **FIXED)
    key: StringProperty(description="Key of the fit that it is shown on", **FIXED)
    token: StringProperty(description="Name under which it is cached while Blender runs", **FIXED)
    chosen: IntProperty(description="Frame that is shown while the recording is paused", **FIXED)
    frame: IntProperty(
        name="Frame",
        description="Which frame is shown, from 0",
        min=0,
        get=replay.frame_of,
        set=replay.choose,
        options=set(),
    )
    progress: FloatProperty(
        name="Position",
        description="Position of the frame in the recording",
        subtype="PERCENTAGE",
        min=0,
        max=100,
        get=_progress,
        set=_set_progress,
        options=set(),
    )
    speed: FloatProperty(
        name="Speed",
        description="Speed relative to the recording",
        default=1.0,
        min=0.01,
        max=100,
        **FIXED | {"update": replay.paced},
    )
    loop: BoolProperty(name="Loop", description="Start again at the end", default=True, **FIXED)


def maximum_token(key):
    """Return the token under which the mark of the maximum deviation of a fit is stored."""
    return f"maximum of {key}"


@with_millimetres
class SKIN_PG_inspect(bpy.types.PropertyGroup):
    """How the fitted skin of a link is inspected."""

    heat: EnumProperty(
        name="Heat Map",
        description="What the colours show",
        items=[
            ("NONE", "None", "No colours"),
            ("ERROR", "Error", "Distance from surface to mesh, as in the step Fit"),
            ("STRAIN", "Strain", "The larger of the strains of a cell along and across its row"),
            ("TILT", "Tilt", "The largest angle between a taxel and a neighbour"),
            ("UNCERTAINTY", "Uncertainty", "Standard uncertainty of the position of a taxel along the surface"),
            ("FORCE", "Force", "Forces, contacts, CoP and supporting polygons of a replayed recording"),
        ],
        **FIXED,
    )
    labels: EnumProperty(
        name="Labels",
        description="Labels of the taxels that face the viewer, where they do not overlap",
        items=[
            ("NONE", "None", "Nothing"),
            ("ID", "Ids", "Ids of the taxels"),
            ("CHANNEL", "Channels", "Positions of the taxels in a reading"),
        ],
        **FIXED,
    )
    auto_length: BoolProperty(
        name="Automatic Normals",
        description="Draw normals in proportion to the cells and to the link",
        default=True,
        **FIXED,
    )
    length: FloatProperty(name="Normals", description="Length of the drawn normals", default=0.006, min=0, **LENGTH)
    text_size: IntProperty(
        name="Text Size", description="Size of the labels, in points", default=11, min=6, max=60, **FIXED
    )
    line_width: FloatProperty(
        name="Line Width", description="Width of all lines, as a factor", default=1.0, min=0.25, max=10, **FIXED
    )

    marked: StringProperty(description="Key of the fit whose maximum deviation is marked", **FIXED)

    marked_place: StringProperty(description="Name under which the mark of a warning is cached", **FIXED)

    taxel: PointerProperty(type=SKIN_PG_taxel, name="Taxel", description="The taxel whose values are shown")

    comparison: PointerProperty(
        type=SKIN_PG_comparison, name="Comparison", description="Distances of the taxels from those of a file"
    )

    touches: PointerProperty(type=SKIN_PG_touches, name="Touches", description="Distances of the skin from touches")

    replay: PointerProperty(type=SKIN_PG_replay, name="Replay", description="A recording that is shown over the skin")

    def tokens(self):
        """Return the names of further drawings that belong to the last fit."""
        key = self.id_data.skin_calib.result.key
        if self.marked and self.marked == key:
            yield maximum_token(key)
        if self.marked_place and self.marked_place in map(mark_of, shown_warnings(self.id_data)):
            yield self.marked_place
        if self.taxel.id and self.taxel.key == key:
            yield taxels.token_of(self.taxel.key, self.taxel.id)
        if self.comparison.token and self.comparison.key == key:
            yield self.comparison.token
        if self.touches.token and self.touches.key == key:
            yield self.touches.token
        if self.replay.token and self.replay.key == key:
            yield self.replay.token


CLASSES = (SKIN_PG_taxel, SKIN_PG_comparison, SKIN_PG_touches, SKIN_PG_replay, SKIN_PG_inspect)
