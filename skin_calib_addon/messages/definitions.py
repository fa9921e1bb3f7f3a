"""Definitions of the messages: the files of the ROS 2 package, and those of ROS that they use."""

import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

PACKAGE = "skin_calib_msgs"
FOLDER = Path(__file__).parent / PACKAGE / "msg"
NAMES = ("SkinContact", "SkinFrame", "SkinPolygon", "SkinQuantity", "SkinReading", "TaxelLayout")  # Contract
PRIMITIVES = {"bool": "?", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float64": "d", "string": ""}
PRIMITIVES |= {"float32": "f", "uint8": "B"}  # of markers only: older readers of DDS fail at a uint8
FLOATS = ("float32", "float64")
# Of ROS 2, unchanged since its first release.
OF_ROS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "geometry_msgs/PointStamped": "std_msgs/Header header\ngeometry_msgs/Point point\n",
    "geometry_msgs/WrenchStamped": "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n",
    # What markers use.
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "std_msgs/ColorRGBA": "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n",
    "sensor_msgs/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data\n",
    "visualization_msgs/UVCoordinate": "float32 u\nfloat32 v\n",
    "visualization_msgs/MeshFile": "string filename\nuint8[] data\n",
    "visualization_msgs/Marker": (
        "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n"
        "geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\n"
        "bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\nstring texture_resource\n"
        "sensor_msgs/CompressedImage texture\nvisualization_msgs/UVCoordinate[] uv_coordinates\nstring text\n"
        "string mesh_resource\nvisualization_msgs/MeshFile mesh_file\nbool mesh_use_embedded_materials\n"
    ),
    "visualization_msgs/MarkerArray": "visualization_msgs/Marker[] markers\n",
}
FIELD = re.compile(r"([\w/]+)(\[(\d*)\])?\s+(\w+)")


class Field(NamedTuple):
    """A field of a message."""

    name: str
    kind: str  # a primitive, or the full name of a message
    length: int | None  # of a fixed array; 0: any length; None: no array


def text_of(kind: str) -> str:
    """Return the definition of a message by its full name, such as ``skin_calib_msgs/SkinFrame``."""
    package, name = kind.split("/")
    return (FOLDER / f"{name}.msg").read_text("utf-8") if package == PACKAGE else OF_ROS[kind]


def fields_in(text: str, package: str = PACKAGE) -> tuple[Field, ...]:
    """Return the fields of a definition in a package."""
    fields = []
    for found in filter(None, map(FIELD.match, text.splitlines())):
        kind, array, count, name = found.groups()
        is_complete = kind in PRIMITIVES or "/" in kind
        fields.append(Field(name, kind if is_complete else f"{package}/{kind}", int(count or 0) if array else None))
    return tuple(fields)


@cache
def fields_of(kind: str) -> tuple[Field, ...]:
    """Return the fields of a message by its full name."""
    return fields_in(text_of(kind))


def full_name(name: str) -> str:
    """Return the full name of one of our messages, or of one of ROS, which has it already."""
    return name if "/" in name else f"{PACKAGE}/{name}"


@cache
def floats_in(kind: str) -> tuple[str, int]:
    """Return which floats a message has, and how many, if it has nothing else; otherwise no type and 0."""
    if kind in PRIMITIVES:
        return (kind, 1) if kind in FLOATS else ("", 0)
    parts = [floats_in(field.kind) if field.length is None else ("", 0) for field in fields_of(kind)]
    types = {type for type, _ in parts}
    return (types.pop(), sum(count for _, count in parts)) if len(types) == 1 else ("", 0)


def schema_text(name: str) -> str:
    """Return the definition of a message followed by all that it uses, as MCAP and rosbag2 want it."""
    name = full_name(name)
    used: list[str] = []

    def visit(kind: str) -> None:
        for field in fields_of(kind):
            if field.kind not in PRIMITIVES and field.kind not in used:
                used.append(field.kind)
                visit(field.kind)

    visit(name)
    line = "=" * 80
    return text_of(name) + "".join(f"{line}\nMSG: {kind}\n{text_of(kind)}" for kind in used)
