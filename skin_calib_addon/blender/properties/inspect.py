# SPDX-License-Identifier: GPL-3.0-or-later
"""How the fitted skin is inspected, as properties; they are not part of the plan."""

import bpy
from bpy.props import FloatProperty, IntProperty, IntVectorProperty, PointerProperty

from ...common.errors import SkinCalibError
from ..inspection import comparing, replay, taxels
from ..live.advice import mark_of, shown_warnings
from .millimetres import with_millimetres
from .options import FIXED, angle, choice, flag, length, many, number, text, vector, whole
from .warning import SKIN_PG_warning

HEAT_MAPS = [
    ("NONE", "None", "No colours"),
    ("ERROR", "Error", "Distance from surface to mesh, as in the step Fit"),
    ("STRAIN", "Strain", "The larger of the strains of a cell along and across its row"),
    ("TILT", "Tilt", "The largest angle between a taxel and a neighbour"),
    ("UNCERTAINTY", "Uncertainty", "Standard uncertainty of the position of a taxel along the surface"),
    ("FORCE", "Force", "Forces, contacts, CoP and supporting polygons of a replayed recording"),
]


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

    wanted: text(name="Find", description="Id or channel of a taxel, to read its values", update=_find)
    problem: text(description="Why the taxel is not found")
    key: text(description="Key of the fit that it belongs to")
    id: text(name="Id", description="Name of the taxel")
    disabled: flag(description="Whether the taxel is not in the calibration")
    channel: whole(name="Channel", description="Position of the taxel in a reading")
    index: IntVectorProperty(
        name="Row, Column", description="Row and column on a sheet, axial coordinates of a board", size=2, **FIXED
    )
    position: vector(
        name="Position",
        description="Centre of the taxel, in the link frame",
        subtype="TRANSLATION",
        unit="LENGTH",
        precision=5,
    )
    normal: vector(
        name="Normal", description="Outward normal of the taxel, in the link frame", subtype="XYZ", precision=5
    )
    area: number(name="Area", description="Area of the cell", unit="AREA", precision=5)
    has_strain: flag(description="Whether the skin is a sheet, which has strain")
    strain_along: number(name="Strain Along [%]", description="Strain along the row, in percent", precision=3)
    strain_across: number(name="Across [%]", description="Strain across the rows, in percent", precision=3)
    shear: angle(name="Shear", description="Deviation of the angle of the cell from 90 degrees")
    has_tilt: flag(description="Whether the taxel has a neighbour")
    tilt: angle(name="Tilt", description="Largest angle to a neighbour")
    neighbours: text(name="Neighbours", description="Ids of the adjacent taxels")


class SKIN_PG_touch(bpy.types.PropertyGroup):
    """One touch, in a list with the largest distance first."""

    words: text(description="Distance that no motion of the skin explains, taxel, and line of the file")
    point: vector(description="Position of the touch, in the link frame [m]")
    far: flag(description="Whether it is far from its taxel")


class SKIN_PG_comparison(bpy.types.PropertyGroup):
    """Distances of the skin from the taxels of a file, or from touches."""

    file: text(name="File", description="The file with the other taxels, or the touches")
    key: text(description="Key of the fit that was compared")
    token: text(description="Name under which its drawing is cached")
    remarks: text(description="Results, one in a line")
    warnings: many(type=SKIN_PG_warning, description="Warnings of the comparison")
    places: many(type=SKIN_PG_touch, description="Touches, the one with the largest distance first")
    chosen: whole(
        name="Touch",
        description="Which touch is marked; the view moves to it",
        default=-1,
        min=-1,
        update=lambda record, context: comparing.show_touch(record.id_data, context),
    )


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

    file: text(name="File", description="The recording")
    key: text(description="Key of the fit that it is shown on")
    token: text(description="Name under which it is cached while Blender runs")
    chosen: whole(description="Frame that is shown while the recording is paused")
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
    speed: number(
        name="Speed", description="Speed relative to the recording", default=1.0, min=0.01, max=100, update=replay.paced
    )
    loop: flag(name="Loop", description="Start again at the end", default=True)


def maximum_token(key):
    """Return the token under which the mark of the maximum deviation of a fit is stored."""
    return f"maximum of {key}"


@with_millimetres
class SKIN_PG_inspect(bpy.types.PropertyGroup):
    """How the fitted skin of a link is inspected."""

    heat: choice(
        name="Heat Map",
        description="What the colours show",
        items=HEAT_MAPS,
    )
    labels: choice(
        name="Labels",
        description="Labels of the taxels that face the viewer, where they do not overlap",
        items=[
            ("NONE", "None", "Nothing"),
            ("ID", "Ids", "Ids of the taxels"),
            ("CHANNEL", "Channels", "Positions of the taxels in a reading"),
        ],
    )
    auto_length: flag(
        name="Automatic Normals", description="Draw normals in proportion to the cells and to the link", default=True
    )
    length: length(name="Normals", description="Length of the drawn normals", default=0.006, min=0)
    text_size: whole(name="Text Size", description="Size of the labels, in points", default=11, min=6, max=60)
    line_width: number(name="Line Width", description="Width of all lines, as a factor", default=1.0, min=0.25, max=10)

    marked: text(description="Key of the fit whose maximum deviation is marked")

    marked_place: text(description="Name under which the mark of a warning is cached")

    taxel: PointerProperty(type=SKIN_PG_taxel, name="Taxel", description="The taxel whose values are shown")

    comparison: PointerProperty(
        type=SKIN_PG_comparison, name="Comparison", description="Distances of the taxels from those of a file"
    )

    touches: PointerProperty(type=SKIN_PG_comparison, name="Touches", description="Distances of the skin from touches")

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
        for record in (self.comparison, self.touches, self.replay):
            if record.token and record.key == key:
                yield record.token
        if self.touches.key == key:
            yield comparing.mark_of(self.touches)
