"""Read PLY files."""

import re
import struct
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ...common.arrays import Array, IntArray
from .polygons import triangulated
from .words import BYTE_ORDER_MARK, numbers, shown

HEADER = re.compile(rb"ply[ \t]*(\r\n|\n|\r)(.*?\1|)end_header[ \t]*\1", re.S)
# Format: names of the types of numbers, old and new, and the letter of each in ``struct`` and NumPy.
TYPES = dict(zip(["char", "uchar", "short", "ushort", "int", "uint", "float", "double"], "bBhHiIfd"))
TYPES |= dict(zip(["int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"], "bBhHiIfd"))
BYTE_ORDERS = {b"ascii": "<", b"binary_little_endian": "<", b"binary_big_endian": ">"}  # text is converted to binary
CORNERS = ("vertex_indices", "vertex_index")  # Format: names of the list of the corners of a face

Property = tuple[str, str, str]  # name, type of the number of values or "" for one value, type of the values
Columns = dict[str, tuple[Array, Array]]  # values of all rows by name, one after another, and how many each row has


def read_ply(path: Path) -> tuple[Array, IntArray]:
    """Read vertices (v, 3) and triangles (f, 3) of text or binary, with polygons and any further properties."""
    content = path.read_bytes().removeprefix(BYTE_ORDER_MARK)
    header = HEADER.match(content)
    if header is None:
        raise ValueError("it has no header from 'ply' to 'end_header'")
    kind, elements = _parsed(header[2].splitlines())
    precision = {p: values for name, _, properties in elements if name == "vertex" for p, _, values in properties}
    data, at = content[header.end() :], 0
    if kind == b"ascii":
        data = numbers(data.split()).tobytes()
    tables: dict[str, Columns] = {}
    for name, rows, properties in elements:
        if name in tables or name != "face" and any(p in CORNERS and count for p, count, _ in properties):
            raise ValueError(f"it has the element {name}, whose surface is not read; export faces")
        if kind == b"ascii":
            properties = [(p, "d" if count else "", "d") for p, count, _ in properties]
        try:
            tables[name], at = _columns(data, at, rows, properties, BYTE_ORDERS[kind])
        except struct.error:
            raise ValueError(f"it is truncated: its header announces {rows} rows of {name}; export it again") from None
    if at != len(data):
        raise ValueError("it has more data than its header announces; export it again")
    for c in "xyz":
        if c not in tables.get("vertex", {}):
            raise ValueError(f"its vertices have no coordinate {c}")
    vertices = np.column_stack([tables["vertex"][c][0].astype(precision[c]).astype(float) for c in "xyz"])
    faces = tables.get("face", {})
    corners, counts = next((faces[name] for name in CORNERS if name in faces), (None, None))
    if corners is None:
        raise ValueError(f"its faces have no list {CORNERS[0]}")
    return vertices, triangulated(vertices, corners, counts)


def _parsed(lines: Iterable[bytes]) -> tuple[bytes, list[tuple[str, int, list[Property]]]]:
    """Return the form of the data, and the name, the number of rows and the properties of each element."""
    kind = b""
    elements: list[tuple[str, int, list[Property]]] = []
    for line in lines:
        words = line.decode(errors="replace").split()
        try:
            match words:
                case [] | ["comment" | "obj_info", *_]:
                    pass
                case ["format", form, "1.0"]:
                    kind = form.encode()
                    BYTE_ORDERS[kind]
                case ["element", name, rows] if rows.isdecimal():
                    elements.append((name, int(rows), []))
                case ["property", *_, name] if any(name == p for p, _, _ in elements[-1][2]):
                    raise ValueError
                case ["property", "list", count, values, name]:
                    elements[-1][2].append((name, TYPES[count], TYPES[values]))
                case ["property", values, name]:
                    elements[-1][2].append((name, "", TYPES[values]))
                case _:
                    raise ValueError
        except (ValueError, LookupError):
            raise ValueError(f"its header has the unknown line {shown(line)}") from None
    if not kind:
        raise ValueError("its header has no line 'format'")
    return kind, elements


def _columns(data: bytes, at: int, rows: int, properties: list[Property], order: str) -> tuple[Columns, int]:
    """Return the columns of an element, and where it ends."""
    first, _ = _walked(data, at, min(rows, 1), properties, order)
    lengths = {name: int(counts.sum()) for name, (_, counts) in first.items()}
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    for name, count, values in properties:
        fields += [(f"count of {name}", order + count, ())] if count else []
        fields.append((name, order + values, (lengths[name],)))
    row = np.dtype(fields)
    if 0 < rows * row.itemsize <= len(data) - at:  # quickly, if all lists are as long as those of the first row
        table = np.frombuffer(data, row, rows, at)
        if all((table[f"count of {name}"] == lengths[name]).all() for name, count, _ in properties if count):
            columns = {name: (table[name].ravel(), np.full(rows, lengths[name])) for name in lengths}
            return columns, at + rows * row.itemsize
    return _walked(data, at, rows, properties, order)


def _walked(data: bytes, at: int, rows: int, properties: list[Property], order: str) -> tuple[Columns, int]:
    """Return what :func:`_columns` returns, read row by row."""
    values: dict[str, list[float]] = {name: [] for name, _, _ in properties}
    counts: dict[str, list[int]] = {name: [] for name, _, _ in properties}
    layout = [
        (
            values[name],
            counts[name],
            struct.Struct(order + count) if count else None,
            kind,
            struct.calcsize(order + kind),
        )
        for name, count, kind in properties
    ]
    for _ in range(rows if layout else 0):
        for column, lengths, counter, kind, size in layout:
            length = 1
            if counter is not None:
                length = int(counter.unpack_from(data, at)[0])
                at += counter.size
            column += struct.unpack_from(f"{order}{length}{kind}", data, at)
            lengths.append(length)
            at += length * size
    return {name: (np.array(values[name]), np.array(counts[name], int)) for name in values}, at
