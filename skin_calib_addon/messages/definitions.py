"""Definitions of the messages: the files of the ROS 2 package, and those of ROS that they use."""

import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

PACKAGE = "skin_calib_msgs"
FOLDER = Path(__file__).parent / PACKAGE / "msg"
NAMES = ("SkinContact", "SkinFrame", "SkinPolygon", "SkinQuantity", "SkinReading", "TaxelLayout")  # Contract
PRIMITIVES = {"bool": "?", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float64": "d", "string": ""}
# Of ROS 2, unchanged since its first release.
OF_ROS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
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


def fields_in(text: str) -> tuple[Field, ...]:
    """Return the fields of a definition."""
    fields = []
    for found in filter(None, map(FIELD.match, text.splitlines())):
        kind, array, count, name = found.groups()
        is_complete = kind in PRIMITIVES or "/" in kind
        fields.append(Field(name, kind if is_complete else f"{PACKAGE}/{kind}", int(count or 0) if array else None))
    return tuple(fields)


@cache
def fields_of(kind: str) -> tuple[Field, ...]:
    """Return the fields of a message by its full name."""
    return fields_in(text_of(kind))


@cache
def doubles_in(kind: str) -> int:
    """Return how many doubles a message has if it has nothing else, otherwise 0."""
    if kind in PRIMITIVES:
        return int(kind == "float64")
    parts = [doubles_in(field.kind) * (field.length is None) for field in fields_of(kind)]
    return sum(parts) if all(parts) else 0


def schema_text(name: str) -> str:
    """Return the definition of one of our messages followed by all that it uses, as MCAP and rosbag2 want it."""
    used: list[str] = []

    def visit(kind: str) -> None:
        for field in fields_of(kind):
            if field.kind not in PRIMITIVES and field.kind not in used:
                used.append(field.kind)
                visit(field.kind)

    visit(f"{PACKAGE}/{name}")
    line = "=" * 80
    return text_of(f"{PACKAGE}/{name}") + "".join(f"{line}\nMSG: {kind}\n{text_of(kind)}" for kind in used)
