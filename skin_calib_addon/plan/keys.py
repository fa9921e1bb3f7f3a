"""All keys of the plan file, one entry for each; ``CONTRIBUTING.md`` says how to add one."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..calibration.exchange import FORMATS, READABLE
from ..calibration.modality import UNITS, Modality
from ..calibration.model import MAX_CHANNEL, Touched
from ..calibration.response import Response
from ..calibration.validate import SCHEMA
from ..common.mesh_uncertainty import CORRELATION_LENGTH, MESH_DEVIATION, MeshUncertainty
from ..geometry.fit.diagnosis import MAX_DEVIATION
from ..geometry.grid.axis import Axis
from ..geometry.grid.grids import Across, Grid, PlanesGrid, Sector, Size, Tolerance, Tube
from ..geometry.mesh.cover import CoverSpec, Cut
from ..skin.boards.ground import Zone
from ..skin.lattice import SIDE, HexLattice, SheetLattice
from ..skin.sheet.landmarks import Landmark
from ..skin.single_taxels import SingleTaxel
from ..skin.uncertainty import (
    DIRECTION_UNCERTAINTY,
    MAX_DIRECTION_UNCERTAINTY,
    MAX_ORIGIN_UNCERTAINTY,
    MIN_ORIGIN_UNCERTAINTY,
    ORIGIN_UNCERTAINTY,
)
from .key import Choice, Key, Record, Switch, Type
from .plan import SURFACE as FIRST_SURFACE
from .plan import Plan, Surface
from .skins import BoardSkin, Frame, ImportedSkin, Mounting, Registered, SheetSkin, Spot

FORMAT = "skin-plan"
PLAN_VERSION = 2  # Format: newest version of plan files
MIN_CORRELATION_LENGTH = 1e-4  # [m] of a deviation of the mesh. Smaller: one in kilometres is accepted.
FARTHEST = 1_000_000  # [m] from the origin of the link frame; [m] of a margin


def length(words: str = "length", digits: int = 5, **limits: float) -> Type:
    """Return the type of a length [m] within limits, named as in JSON Schema."""
    return Type("length", words, {"type": "number", **limits}, "m", digits=digits)


def count(**limits: int) -> Type:
    """Return the type of a whole number within limits, named as in JSON Schema."""
    return Type("count", "whole number", {"type": "integer", **limits})


def pair(kind: str, words: str, item: dict[str, Any], unit: str = "") -> Type:
    """Return the type of two numbers."""
    return Type(kind, words, {"type": "array", "items": item, "minItems": 2, "maxItems": 2}, unit, (2,))


def choice(*choices: Choice) -> Type:
    """Return the type of a key with a fixed set of values."""
    return Type("choice", "one of the words", {"enum": [c.value for c in choices]}, choices=choices)


def constant(value: Any) -> Type:
    """Return the type of a key that has always the same value."""
    return Type("constant", f"`{value}`", {"const": value})


def one(record: Record, kind: str = "record") -> Type:
    """Return the type of an object."""
    return Type(kind, f"[{record.title}](#{record.name})", {"$ref": f"#/$defs/{record.name}"}, record=record)


def many(record: Record, kind: str = "records", **limits: int) -> Type:
    """Return the type of a list of objects, whose number has limits named as in JSON Schema."""
    schema = {"type": "array", "items": {"$ref": f"#/$defs/{record.name}"}, **limits}
    return Type(kind, f"list of [{record.title}](#{record.name})", schema, record=record)


def three(kind: str, words: str, unit: str = "") -> Type:
    """Return the type of a point or a direction in the link frame."""
    item = {"type": "number", "minimum": -FARTHEST, "maximum": FARTHEST}
    return Type(kind, words, {"type": "array", "items": item, "minItems": 3, "maxItems": 3}, unit, (3,))


POINT, DIRECTION = three("length", "point", "m"), three("direction", "direction")
ANGLE = Type("angle", "angle", {"type": "number", "minimum": -100, "maximum": 100}, "rad")
SWITCH = Type("switch", "`true` or `false`", {"type": "boolean"})
NAME = Type("text", "text", {"type": "string", "pattern": "^[^\\u0000-\\u001f\\u007f]+$"})
TEXT = Type("text", "text", {"type": "string", "minLength": 1})
FILE = Type("file", "path", {"type": "string", "pattern": "^[^\\u0000]+$"})
MESH = replace(FILE, kind="mesh")
ROTATION = Type(
    "rotation",
    "rows of a rotation matrix",
    {"type": "array", "items": dict(POINT.schema), "minItems": 3, "maxItems": 3},
    shape=(3, 3),
    digits=4,
)
COORDINATE = {"type": "integer", "minimum": -1000, "maximum": 1000}
CELL = {"type": "array", "items": COORDINATE, "minItems": 2, "maxItems": 2}
STEP = {"type": "number", "minimum": -1, "maximum": 1}
BOARD = {
    "type": "array",
    "prefixItems": [COORDINATE, COORDINATE, STEP, STEP, {"type": "number", "minimum": -4, "maximum": 4}],
    "minItems": 2,
    "maxItems": 5,
}
CELLS = Type(
    "cells",
    "`fill`, `all`, or a list of `[q, r]` or `[q, r, x, y, turn]`",
    {
        "oneOf": [
            {"type": "string", "enum": ["fill", "all"]},
            {"type": "array", "items": BOARD, "minItems": 1, "maxItems": 10000},
        ]
    },
    choices=(
        Choice("fill", "Fill", "As many boards as fit, at the offset and rotation of the lattice where most do"),
        Choice("all", "All", "All boards that fit, with the root at the origin and its row along the direction"),
        Choice("listed", "Listed", "The boards listed, with the root at the origin and its row along the direction"),
    ),
)
GRID = Type(
    "grid",
    "by its kind [`tube`](#tube), `patch` ([sector](#sector) or [face](#across)), [`planes`](#planes), or `auto` "
    "([tube](#auto_tube), [sector](#auto_sector) or [face](#auto_across))",
    {"oneOf": [{"$ref": f"#/$defs/{name}"} for name in ("tube", "patch", "planes", "auto")]},
)
SKINS = Type(
    "skins",
    "list of skins, by their kind [`sheet`](#sheet), [`hexagons`](#hexagons) or [`imported`](#imported)",
    {"type": "array", "items": {"oneOf": [{"$ref": f"#/$defs/{name}"} for name in ("sheet", "hexagons", "imported")]}},
)
RESPONSE = Type(
    "response", "polynomial or table", {"oneOf": [{"$ref": "#/$defs/polynomial"}, {"$ref": "#/$defs/table"}]}
)
# The kinds of response are those of calibration files.
RESPONSES: dict[str, Any] = {name: SCHEMA["$defs"][name] for name in ("polynomial", "table", "pair")}


def kind(value: str) -> Key:
    """Return the key that says of which kind an object is."""
    return Key("kind", constant(value), "The kind.")


# Planes and the cover.

PLANE = Record(
    "plane",
    "Plane",
    Cut,
    (
        Key("point", POINT, "A point of the plane, in the link frame."),
        Key(
            "normal",
            DIRECTION,
            "Perpendicular to the plane, of any length; a cut keeps the side to which it points.",
            first=(0, 0, 1),
        ),
    ),
)

COVER = Record(
    "cover",
    "Cover",
    CoverSpec,
    (
        Key(
            "shell",
            choice(
                Choice(
                    "outer", "Outer", "Drop the connected parts that are mostly within the convex hull of larger ones"
                ),
                Choice("seen", "Seen", "Keep the faces that can be seen from outside"),
                Choice("all", "All", "Keep all connected parts"),
            ),
            "Which faces of the mesh belong to the cover.",
            default="outer",
            always=True,
        ),
        Key(
            "cuts",
            many(PLANE),
            "Planes that cut the mesh; each keeps the side to which its normal points.",
            default=(),
            labels=("Cut",),
            always=True,
        ),
    ),
)

# Grids: the keys of sizes and regions, then the grids made of them.

N = Key("n", count(minimum=1, maximum=1000), "Number of u-planes, which cross the axis.", label="U-Planes", first=10)
M = Key(
    "m",
    count(minimum=1, maximum=1000),
    "Number of full planes through the axis, instead of `lines`: each gives two lines of a tube, one line of a patch.",
    default=None,
    field="",
    label="",
)
LINES = Key(
    "lines",
    count(minimum=1, maximum=2000),
    "Number of lines of control points: half-planes that start from the axis; across a face, planes along it.",
    default=None,
    label="V-Lines",
    first=20,
    joined=True,
)
SPACING = Key(
    "spacing",
    choice(
        Choice("auto", "Auto", "Planes and lines where they reduce the error most"),
        Choice("uniform", "Uniform", "At equal heights and angles"),
        Choice("arc", "Arc", "Lines at equal arc lengths round the link, planes at equal heights"),
        Choice("curvature", "Curvature", "Lines closer where the link is more curved, planes at equal heights"),
    ),
    "How planes and lines are spaced.",
    default="auto",
    always=True,
)
TOLERANCE = Key(
    "tolerance",
    length(digits=6, exclusiveMinimum=0),
    "Largest distance from surface to mesh; the smallest grid that keeps it is found.",
    first=2e-5,
)
MEASURE = Key(
    "measure",
    choice(Choice("mean", "Mean", "The mean distance"), Choice("max", "Max", "The largest distance")),
    "Which distance the tolerance limits.",
    default="mean",
    joined=True,
    always=True,
)
LINE = Record(
    "line",
    "Axis",
    Axis,
    (
        Key("point", POINT, "A point of the axis, in the link frame.", label="Axis Point"),
        Key(
            "direction", DIRECTION, "Direction along the link, of any length.", label="Axis Direction", first=(0, 0, 1)
        ),
    ),
)
AXIS = Key(
    "axis",
    one(LINE),
    "Axis of the link.",
    default=None,
    otherwise="found from the sections of the mesh, towards the thinner end",
    word="auto",
    switch=Switch("auto_axis", "Automatic Axis"),
    always=True,
)
FACE_AXIS = replace(
    AXIS,
    description="The u-planes are perpendicular to its direction; its point has no effect.",
    otherwise="along the longer side",
    always=False,
)
MARGIN = Key(
    "margin",
    length(minimum=0, maximum=FARTHEST),
    "Length left free at both ends.",
    default=None,
    otherwise="a tube uses its longest run of complete sections, a face leaves a hundredth of its longer side free",
    first=0.002,
    switch=Switch("auto_margin", "Automatic Margin"),
)
MAX_LOOPS, MAX_CORNERS = 100, 1000  # Format: of a boundary, and of each of its loops
BOUNDARY = Key(
    "boundary",
    Type(
        "json",
        "list of loops of points [m]",
        {
            "type": "array",
            "items": {"type": "array", "items": dict(POINT.schema), "minItems": 3, "maxItems": MAX_CORNERS},
            "maxItems": MAX_LOOPS,
        },
    ),
    "Corners of closed loops on the mesh, inside which surface and skins stay; a loop in another is a hole. They "
    "replace the margin.",
    default=(),
    otherwise="the whole region",
)
FROM = Key(
    "from",
    ANGLE,
    "First angle about the axis, from the side of the link's x axis; of its y axis where the tube runs along x.",
    field="start",
    blender="start",
    first=-1.5,
)
TO = Key(
    "to",
    ANGLE,
    "Last angle about the axis, larger than the first.",
    field="stop",
    blender="stop",
    first=1.5,
    joined=True,
)
NORMAL = Key("normal", DIRECTION, "Outward normal of the face, out of the robot.", label="Outward", first=(0, 0, -1))


def grid_of_lines(name: str, title: str, kind_of: str, region: type, *own: Key) -> Record:
    """Return the keys of a grid with numbers of planes and lines in a region, which has keys of its own."""
    keys = (kind(kind_of), N, M, LINES, SPACING, *own, MARGIN, BOUNDARY)
    return Record(name, title, Grid, keys, {"region": region, "size": Size})


def grid_of_tolerance(name: str, title: str, region: type, *own: Key) -> Record:
    """Return the keys of the smallest grid that keeps a tolerance in a region, which has keys of its own."""
    keys = (kind("auto"), TOLERANCE, MEASURE, *own, MARGIN, BOUNDARY)
    return Record(name, title, Grid, keys, {"region": region, "size": Tolerance})


TUBE = grid_of_lines("tube", "Tube", "tube", Tube, AXIS)
SECTOR = grid_of_lines("sector", "Sector of a tube", "patch", Sector, AXIS, FROM, TO)
ACROSS = grid_of_lines("across", "Across a face", "patch", Across, NORMAL, FACE_AXIS)
AUTO_TUBE = grid_of_tolerance("auto_tube", "Automatic tube", Tube, AXIS)
AUTO_SECTOR = grid_of_tolerance("auto_sector", "Automatic sector of a tube", Sector, AXIS, FROM, TO)
AUTO_ACROSS = grid_of_tolerance("auto_across", "Automatic across a face", Across, AXIS, NORMAL)
PLANES = Record(
    "planes",
    "Planes one by one",
    PlanesGrid,
    (
        kind("planes"),
        Key(
            "u",
            many(PLANE, "planes", minItems=1),
            "Planes across the link, in any order.",
            label="U-Planes",
            labels=("U-Plane",),
        ),
        Key(
            "v",
            many(PLANE, "planes", minItems=1),
            "Planes along the link, in any order.",
            label="V-Planes",
            labels=("V-Plane",),
        ),
        Key(
            "closed",
            SWITCH,
            "Whether the v-planes go all round the link; each then cuts a section twice and gives two lines.",
            first=True,
        ),
    ),
)
# By the kind and the region that the window names.
GRIDS = {
    ("tube", "tube"): TUBE,
    ("sector", "sector"): SECTOR,
    ("across", "across"): ACROSS,
    ("auto", "tube"): AUTO_TUBE,
    ("auto", "sector"): AUTO_SECTOR,
    ("auto", "across"): AUTO_ACROSS,
    ("planes", ""): PLANES,
}
GRID_KINDS = (
    Choice("tube", "Tube", "Planes across an axis, and half-planes that start from it all round"),
    Choice("auto", "Auto", "The smallest grid that keeps a tolerance"),
    Choice("sector", "Sector", "Part of a tube, between two angles"),
    Choice("across", "Across", "Two families of parallel planes across a sole or a palm"),
    Choice("planes", "Planes", "Planes placed one by one"),
)
GRID_REGIONS = (
    Choice("tube", "Tube", "All round the axis"),
    Choice("sector", "Sector", "Part of a tube, between two angles"),
    Choice("across", "Across", "Over a sole or a palm"),
)

# Skins: what they have in common, then each kind.

PATCH_NAME = Key("name", NAME, "Name of the patch; ids of its taxels begin with it.", first="skin")
SURFACE_OF_SKIN = Key(
    "surface",
    NAME,
    "Name of the surface that the skin is on.",
    default=None,
    otherwise="the first surface of the plan",
    empty="",
)
ORIGIN = Key(
    "origin",
    POINT,
    "Where the centre of cell (0, 0) lies, on or near the mesh.",
    default=None,
    otherwise="a sheet is centred on the surface, boards start from its middle",
    word="center",
    switch=Switch("centred", "Centred"),
    always=True,
)
ROW_DIRECTION = Key(
    "direction",
    DIRECTION,
    "Direction of the row of the origin; its part in the surface counts.",
    first=(0, 1, 0),
    switch=Switch("auto_direction", "Automatic Direction", "Rows of boards run along the lines of the surface"),
)
OFFSET = Key(
    "offset",
    length(minimum=-1, maximum=1),
    "Height of the skin's neutral layer above the surface: the layer that keeps its lengths.",
    default=0.0,
)
FIRST_CHANNEL = Key(
    "first_channel",
    count(minimum=0),
    "Channel of the first taxel.",
    default=None,
    otherwise="the channels follow those of the skin before",
    switch=Switch("auto_channel", "Channels Follow", ticked=False),
)
MOUNTING = Record(
    "registration",
    "Registration",
    Mounting,
    (
        Key(
            "origin",
            length(minimum=MIN_ORIGIN_UNCERTAINTY, maximum=MAX_ORIGIN_UNCERTAINTY),
            "Standard uncertainty of the position of the anchor along the surface, per axis; of imported taxels in all "
            "directions.",
            default=ORIGIN_UNCERTAINTY,
            label="Position Uncertainty",
            blender="origin_uncertainty",
            always=True,
        ),
        Key(
            "direction",
            replace(ANGLE, schema={"type": "number", "minimum": 0, "maximum": MAX_DIRECTION_UNCERTAINTY}),
            "Standard uncertainty of the rotation about the normal at the anchor; of imported taxels about all axes.",
            default=DIRECTION_UNCERTAINTY,
            label="Rotation Uncertainty",
            blender="direction_uncertainty",
            always=True,
        ),
        Key(
            "anchor",
            POINT,
            "Point of the skin where position and rotation are uncertain independently of each other.",
            default=None,
            otherwise="the origin, the first landmark, or the middle of a centred sheet or of imported taxels",
            switch=Switch("auto_anchor", "Anchor at Origin"),
        ),
    ),
)
REGISTRATION = Key(
    "registration",
    one(MOUNTING),
    "How exactly the skin is mounted; the uncertainty of its taxels follows. `touches` replaces it.",
    default=None,
    otherwise="1 mm and 1 degree; with two landmarks the rotation follows from 1 mm at each",
    switch=Switch("auto_registration", "Standard Mount"),
)
HASH = Type("text", "SHA-256", {"type": "string", "pattern": "^[0-9a-f]{64}$"})
SPOT = Record(
    "spot",
    "Spot",
    Spot,
    (
        Key(
            "points",
            Type("points", "list of points", {"type": "array", "items": dict(POINT.schema)}, "m"),
            "The landmarks, or the origin; empty if centred.",
        ),
        Key("direction", DIRECTION, "Direction of the row.", default=None, otherwise="along the surface's v"),
        Key("surface", NAME, "Its surface.", default=None, otherwise="the first one"),
        Key("cells", HASH, "Hash of the lattice and of the cells that are listed or pinned."),
    ),
)
TOUCHED = Record(
    "touches",
    "Touches",
    Registered,
    (
        Key(
            "date",
            Type("text", "date", {"type": "string", "pattern": "^[0-9]{4}-[0-9]{2}-[0-9]{2}$"}),
            "Day of the registration.",
        ),
        Key("session", HASH, "Hash of the file of the touches.", default=""),
        Key("used", count(minimum=0), "Number of touches that the motion explains."),
        Key("left_out", count(minimum=0), "Number of the others."),
        Key(
            "shift",
            pair("length", "two lengths", {"type": "number", "minimum": -1, "maximum": 1}, "m"),
            "Motion of the anchor along the rows and across; zero if the skin stayed.",
        ),
        Key("turn", ANGLE, "Rotation about the normal at the anchor."),
        Key(
            "covariance",
            Type(
                "covariance",
                "three rows of three numbers",
                {"type": "array", "items": dict(POINT.schema), "minItems": 3, "maxItems": 3},
                "",
                (3, 3),
            ),
            "Covariance of shift and turn [m, m, rad].",
        ),
        Key("anchor", POINT, "Point of the skin that shifts and turns."),
        Key(
            "along",
            length(minimum=0),
            "Root mean square distance of the touches along the skin from the taxels that felt them.",
        ),
        Key(
            "normal",
            length(minimum=0),
            "Root mean square height over these taxels.",
            default=None,
            otherwise="not measured",
        ),
        Key(
            "angle",
            replace(ANGLE, schema={"type": "number", "minimum": 0, "maximum": 4}),
            "Root mean square angle from normal to force.",
            default=None,
            otherwise="not measured",
        ),
        Key("spot", one(SPOT), "Where the plan placed the skin then."),
    ),
    {"touched": Touched},
)
TOUCHES = Key(
    "touches",
    one(TOUCHED, "json"),
    "How `touches --refine` registered the skin; the uncertainty of its taxels follows as long as the plan places it "
    "there.",
    default=None,
    empty="",
    label="Registered",
)

SINGLE_TAXEL = Record(
    "single_taxel",
    "Single taxel",
    SingleTaxel,
    (
        Key("taxel", TEXT, "Id of the taxel without the name of the skin, such as `2.7`."),
        Key(
            "enabled",
            SWITCH,
            "Whether the calibration has the taxel. The others keep their ids and channels.",
            default=True,
        ),
        Key(
            "channel",
            count(minimum=0, maximum=MAX_CHANNEL),
            "Its channel.",
            default=None,
            otherwise="by its position in the skin",
            switch=Switch("auto_channel", "Usual Channel"),
        ),
    ),
)
SINGLE_TAXELS = Key(
    "taxels",
    many(SINGLE_TAXEL, maxItems=10000),
    "Taxels that differ from the others: disabled ones, and those with their own channel. Boards must be listed.",
    default=(),
    label="Single Taxels",
    labels=("Taxel",),
)

LANDMARK = Record(
    "landmark",
    "Landmark",
    Landmark,
    (
        Key(
            "cell",
            pair("count", "`[row, column]`", {"type": "integer", "minimum": 0}),
            "Row and column of the cell, counted from 0.",
        ),
        Key("point", POINT, "Where the centre of the cell lies, in the link frame."),
    ),
)
MAX_OVERHANG = Key(
    "max_overhang",
    length(minimum=0, maximum=1),
    "Largest length by which a cell or a board may protrude over an edge of the surface, a hole or the "
    "boundary; more is an error.",
    default=None,
    otherwise="any; more than 1 mm is a warning",
    first=0.001,
    switch=Switch("any_overhang", "Any Overhang"),
)
MAX_LOAD = Key(
    "max_load",
    Type("force", "force", {"type": "number", "exclusiveMinimum": 0, "maximum": 1000000}, "N", digits=1),
    "Largest plausible load on the skin. The runtime trusts no frame with more: readings in another unit show.",
    default=None,
    otherwise="200 kPa on the area of all cells, 100 N at least",
    first=1000.0,
    switch=Switch("auto_load", "Usual Load"),
)
SHEET = Record(
    "sheet",
    "Sheet",
    SheetSkin,
    (
        PATCH_NAME,
        kind("sheet"),
        SURFACE_OF_SKIN,
        Key("rows", count(minimum=1, maximum=1000), "Number of rows of cells.", first=6),
        Key("columns", count(minimum=1, maximum=1000), "Number of cells in a row.", first=20, joined=True),
        Key(
            "pitch",
            pair("length", "two lengths", {"type": "number", "minimum": 0.00001, "maximum": 1}, "m"),
            "Distance from row to row, and from column to column.",
            first=(0.01, 0.01),
            labels=("Row Pitch", "Column Pitch"),
        ),
        Key(
            "landmarks",
            many(LANDMARK, minItems=1),
            "Cells that are pinned to points of the mesh, instead of an origin. One gives the position of the sheet; "
            "a second turns it, without strain; from the third on the sheet is strained to meet all.",
            default=(),
            labels=("Landmark",),
        ),
        ORIGIN,
        ROW_DIRECTION,
        Key(
            "hand",
            choice(
                Choice("right", "Right", "The next row lies to the left of the row direction, seen from outside"),
                Choice("left", "Left", "The next row lies to the right, as on a sheet whose face is down"),
            ),
            "On which side of a row the next one lies.",
            default="right",
        ),
        Key(
            "trim",
            SWITCH,
            "Whether cells are left out whose centre is off the surface, more than 1 mm off the mesh, over a hole or "
            "outside the boundary, or that are inclined by more than 15 degrees to the faces below them. Otherwise "
            "those off the surface are an error. The other cells keep their ids and channels.",
            default=False,
        ),
        Key(
            "overlap",
            SWITCH,
            "Whether the sheet may overlap itself where it closes around the link; otherwise an overlap of more than a "
            "tenth of a cell is an error.",
            default=False,
        ),
        MAX_OVERHANG,
        MAX_LOAD,
        OFFSET,
        REGISTRATION,
        TOUCHES,
        FIRST_CHANNEL,
        SINGLE_TAXELS,
    ),
    {"lattice": SheetLattice},
)

ZONE = Record(
    "zone",
    "Excluded zone",
    Zone,
    (
        Key("point", POINT, "Centre of the zone, in the link frame."),
        Key(
            "radius",
            length(exclusiveMinimum=0, maximum=1),
            "Boards keep this distance from the point and from the surface point nearest to it, in all directions.",
            first=0.005,
        ),
    ),
)
BOARDS = Record(
    "hexagons",
    "Hexagonal boards",
    BoardSkin,
    (
        PATCH_NAME,
        kind("hexagons"),
        SURFACE_OF_SKIN,
        Key("side", length(minimum=0.0001, maximum=1), "Length of the sides of a board.", default=SIDE, always=True),
        Key(
            "gap",
            length(minimum=-1, maximum=1),
            "Gap between the sides of two boards that face each other; negative where boards are trimmed.",
            default=None,
            otherwise="none; with a side of 16.3 mm boards trimmed as those of the TUM skin, with a pitch of 27.75 mm",
            switch=Switch("auto_gap", "Standard Gap"),
        ),
        Key(
            "cells",
            CELLS,
            "Which boards there are: as many as fit, all from the origin, or a list of axial coordinates. q counts "
            "along the rows, r along the direction 60 degrees to their left. A board that is shifted from its place "
            "has x along the rows and y to their left, in metres along the surface, and the turn in radians.",
            default="fill",
            field="choice",
            blender="choice",
            label="Boards",
            labels=("Cells",),
            always=True,
        ),
        replace(
            ORIGIN, description="Where the root board (0, 0) lies; boards that fill the surface start near this point."
        ),
        replace(
            ROW_DIRECTION,
            description="Direction of the row of the root board; boards that fill the surface keep it to within 30 "
            "degrees.",
            default=None,
            otherwise="along the lines of the surface, in v",
        ),
        Key(
            "excluded",
            many(ZONE),
            "Discs that boards must not cover: screws, cable outlets. Edges and holes of the mesh are found.",
            default=(),
            labels=("Excluded Zone",),
        ),
        MAX_OVERHANG,
        MAX_LOAD,
        OFFSET,
        REGISTRATION,
        TOUCHES,
        FIRST_CHANNEL,
        SINGLE_TAXELS,
    ),
    {"lattice": HexLattice},
)

FRAME = Record(
    "frame",
    "Frame",
    Frame,
    (
        Key(
            "rotation",
            ROTATION,
            "From the frame of the file into the frame of the link, by rows.",
            first=(1, 0, 0, 0, 1, 0, 0, 0, 1),
        ),
        Key("translation", POINT, "Of the file's frame, in the link frame; the rotation comes first."),
    ),
)
IMPORTED = Record(
    "imported",
    "Imported taxels",
    ImportedSkin,
    (
        PATCH_NAME,
        kind("imported"),
        SURFACE_OF_SKIN,
        Key("file", FILE, "The file that has the taxels, relative to the folder of the plan."),
        Key(
            "format",
            choice(*(Choice(name, name, FORMATS[name].what) for name in READABLE)),
            "Format of the file.",
            default=None,
            otherwise="found from the content",
            empty="auto",
        ),
        Key(
            "only",
            TEXT,
            "Pattern of the labels that are used, such as `l_forearm_skin_*`.",
            default=None,
            otherwise="all",
            empty="",
        ),
        Key(
            "frame",
            one(FRAME),
            "Frame of the file in the link frame.",
            default=None,
            otherwise="the file is in the link frame",
            switch=Switch(
                "framed",
                "Own Frame",
                "The file is in another frame than the link: turn and move it",
                means_default=False,
                ticked=False,
            ),
        ),
        Key(
            "snap",
            SWITCH,
            "Whether taxels are moved to the surface; otherwise they stay, and their distance from it is reported.",
            default=False,
        ),
        MAX_LOAD,
        REGISTRATION,
        FIRST_CHANNEL,
        SINGLE_TAXELS,
    ),
)
SKIN_KINDS = (
    Choice("sheet", "Sheet", "Rows of cells on a flexible sheet that bends with the surface"),
    Choice("hexagons", "Hexagons", "Rigid hexagonal boards next to each other"),
    Choice("imported", "Imported", "Taxels in the file of another program"),
)
# By kind.
SKINS_OF: dict[str, Record] = {"sheet": SHEET, "hexagons": BOARDS, "imported": IMPORTED}

# Modalities.

MODALITY = Record(
    "modality",
    "Modality",
    Modality,
    (
        Key("name", NAME, 'Such as "proximity"; not "force".', label=""),
        Key(
            "unit",
            choice(*(Choice(unit, words, words) for unit, words in UNITS.items())),
            "Unit of the values.",
            label="",
        ),
        Key("response", RESPONSE, "Value of a reading, in this unit; values below zero count.", label=""),
        Key(
            "channels",
            Type(
                "channels",
                "object of ids and positions",
                {
                    "type": "object",
                    "patternProperties": {"": {"type": "integer", "minimum": 0, "maximum": MAX_CHANNEL}},
                },
            ),
            "Position in the readings of this modality, by the id of each taxel that has it.",
            default=None,
            otherwise="all taxels have it, with the channel of their force",
            label="",
        ),
    ),
)

# Of a surface.

COVER_KEY = Key(
    "cover",
    one(COVER, "group"),
    "What of the mesh is covered with skin.",
    default=CoverSpec(),
    panel="Cut",
    always=True,
)
GRID_KEY = Key("grid", GRID, "Where planes and lines are.", panel="Grid")
DEGREE = Key(
    "degree",
    pair("count", "two whole numbers", {"type": "integer", "minimum": 2, "maximum": 5}),
    "Degree of the surface along u and v.",
    default=(3, 3),
    labels=("Degree U", "V"),
    panel="Grid",
    always=True,
)
CHORDS = Key(
    "chords",
    SWITCH,
    "Whether the mesh was tessellated from a smooth model: its vertices lie on the true surface and its facets "
    "inside it, and the fitted surface bulges over them. Coarse or sharp meshes are fitted without.",
    default=False,
    label="Facets are Chords",
    panel="Grid",
)
MAX_DEVIATION_KEY = Key(
    "max_deviation",
    length(exclusiveMinimum=0, maximum=1),
    "Largest distance of the surface from the mesh; a fit above it is refused. A warning starts at a fifth of "
    "it. With a tolerance, a warning starts at the tolerance, or at ten times a tolerance of the mean if that "
    "is less than a fifth of this value.",
    default=MAX_DEVIATION,
    otherwise="10 mm",
    label="Max. Deviation",
    switch=Switch("auto_max_deviation", "Standard Limit", "10 mm, whatever the unit of the scene"),
    panel="Grid",
)
SURFACE = Record(
    "surface",
    "Surface",
    Surface,
    (
        Key(
            "name",
            NAME,
            "Name of the surface, which skins refer to.",
            blender="surface_name",
            label="Surface",
            first=FIRST_SURFACE,
        ),
        COVER_KEY,
        GRID_KEY,
        DEGREE,
        CHORDS,
        MAX_DEVIATION_KEY,
    ),
)

# The plan.


def with_one_surface(surface: Surface, **others: Any) -> Plan:
    """Return a plan with one surface."""
    return Plan(surfaces=(surface,), **others)


FORMAT_KEY = Key("format", constant(FORMAT), "The format.")
LINK = Key("link", NAME, "Name of the robot link, as in its URDF.", panel="Link")
MESH_KEY = Key(
    "mesh",
    MESH,
    "STL, PLY, OBJ, OFF, DAE or GLB file, relative to the plan; or URDF: all visual meshes of the link.",
    blender="mesh_file",
    label="Mesh File",
    panel="Link",
)
UNIT = Key(
    "unit",
    choice(
        Choice("m", "Metres", "Metres"),
        Choice("mm", "Millimetres", "Millimetres"),
        Choice("cm", "Centimetres", "Centimetres"),
        Choice("in", "Inches", "Inches"),
    ),
    "Unit of the numbers in the mesh file.",
    label="",
)
MESH_ERROR = Record(
    "mesh_uncertainty",
    "Mesh uncertainty",
    MeshUncertainty,
    (
        Key(
            "standard_deviation",
            length(minimum=0, maximum=MAX_ORIGIN_UNCERTAINTY),
            "Standard deviation of the part from its mesh, in any direction; of a scan, of its noise.",
            default=MESH_DEVIATION,
            label="Mesh Deviation",
            blender="mesh_deviation",
            always=True,
        ),
        Key(
            "correlation_length",
            length(minimum=MIN_CORRELATION_LENGTH, maximum=FARTHEST),
            "Distance over which the deviation changes: at this distance, the correlation of two points is 1 / e.",
            default=CORRELATION_LENGTH,
            blender="mesh_correlation",
            joined=True,
            always=True,
        ),
    ),
)
MESH_UNCERTAINTY = Key(
    "mesh_uncertainty",
    one(MESH_ERROR),
    "How far the part is from its mesh; the uncertainty of the taxels follows.",
    default=MeshUncertainty(),
    otherwise="0.2 mm and 50 mm, as of a printed or moulded cover",
    switch=Switch("auto_mesh_uncertainty", "Standard Part"),
    panel="Grid",
)
SKINS_KEY = Key("skins", SKINS, "The skins on the link.", panel="Skin")
RESPONSE_KEY = Key(
    "response", RESPONSE, "Force of a reading in newtons.", default=Response(), otherwise="readings are newtons"
)
MODALITIES = Key(
    "modalities",
    many(MODALITY, maxItems=256),
    "Further quantities that taxels measure, such as proximity and temperature. Each has readings of its own.",
    default=(),
    label="",
)
PLAN = Record(
    "plan",
    "Plan with one surface",
    with_one_surface,
    (
        FORMAT_KEY,
        Key("version", constant(1), "The version of the format."),
        LINK,
        MESH_KEY,
        UNIT,
        COVER_KEY,
        GRID_KEY,
        DEGREE,
        SKINS_KEY,
        CHORDS,
        MAX_DEVIATION_KEY,
        RESPONSE_KEY,
        MODALITIES,
        MESH_UNCERTAINTY,
    ),
    {"surface": Surface},
)
PLAN_OF_SURFACES = Record(
    "plan_2",
    "Plan with several surfaces",
    Plan,
    (
        FORMAT_KEY,
        Key("version", constant(2), "The version of the format."),
        LINK,
        MESH_KEY,
        UNIT,
        Key(
            "surfaces",
            many(SURFACE, minItems=1, maxItems=100),
            "The surfaces that are fitted to parts of the mesh.",
            label="",
        ),
        SKINS_KEY,
        RESPONSE_KEY,
        MODALITIES,
        MESH_UNCERTAINTY,
    ),
)
PLANS: Mapping[int, Record] = {1: PLAN, 2: PLAN_OF_SURFACES}  # by version
# Objects of the schema; records with the same constant "kind" have one together.
RECORDS: tuple[Record, ...] = (
    PLANE,
    COVER,
    LINE,
    TUBE,
    SECTOR,
    ACROSS,
    AUTO_TUBE,
    AUTO_SECTOR,
    AUTO_ACROSS,
    PLANES,
    SINGLE_TAXEL,
    LANDMARK,
    SHEET,
    ZONE,
    BOARDS,
    FRAME,
    IMPORTED,
    MOUNTING,
    TOUCHED,
    SPOT,
    MESH_ERROR,
    MODALITY,
    SURFACE,
)
