"""Read OFF files."""

import re
from pathlib import Path

import numpy as np

from ...common.arrays import Array, IntArray
from .polygons import triangulated
from .words import numbers, shown, words_of_lines

# Format: textures, colours and normals follow the coordinates. Vertices of other dimensions begin with others.
HEADER = re.compile(rb"(?:ST)?C?N?OFF", re.I)


def read_off(path: Path) -> tuple[Array, IntArray]:
    """Read vertices (v, 3) and triangles (f, 3): a line for each vertex, and for each polygon."""
    rows = [words for _, words in words_of_lines(path.read_bytes())]
    header = HEADER.match(rows[0][0]) if rows else None
    if header is None or rows[0][1:2] == [b"BINARY"]:
        begin = shown(b" ".join(rows[0])) if rows else "no line"
        raise ValueError(f"it begins with {begin}; only text that begins with OFF, and has three coordinates, is read")
    rows[0][:1] = [rest] if (rest := rows[0][0][header.end() :]) else []  # some have no blank after it
    counts: list[bytes] = []
    at = 0
    while at < len(rows) and (len(counts) < 2 or len(counts) == 2 and len(rows[at]) == 1):
        counts += rows[at]
        at += 1
    if not 2 <= len(counts) <= 3:  # that of edges may be missing
        raise ValueError("it has no line with the numbers of vertices, faces and edges")
    vertices, faces = (int(count) for count in counts[:2])
    if len(rows) - at != vertices + faces:
        words = f"its header announces {vertices} vertices and {faces} faces, but {len(rows) - at} lines follow"
        raise ValueError(f"{words}; it is truncated, or does not have a line for each; export it again")
    points, polygons = rows[at : at + vertices], rows[at + vertices :]
    if any(len(words) < 3 for words in points):
        raise ValueError("its vertices have less than 3 coordinates")
    sizes = [int(words[0]) for words in polygons]
    if any(not 0 <= size < len(words) for size, words in zip(sizes, polygons)):  # colours may follow
        raise ValueError("it has a face with less corners than it announces")
    corners = [word for size, words in zip(sizes, polygons) for word in words[1 : 1 + size]]
    coordinates = numbers([word for words in points for word in words[:3]]).reshape(-1, 3)
    return coordinates, triangulated(coordinates, np.array(corners, dtype="S").astype(np.int64), sizes)
