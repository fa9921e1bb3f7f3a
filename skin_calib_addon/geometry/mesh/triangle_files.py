"""Read the usual binary files of triangles without trimesh, whose import takes several times as long."""

import re
from pathlib import Path

import numpy as np

from ...common.arrays import Array, IntArray

# Format: one face of a binary STL file, after a header of 84 bytes that ends with their number.
STL_FACE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
STL_HEADER = 84  # Format
# Format: names of the types of numbers in a PLY file, old and new.
PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
PLY_TYPES |= {"float": "f4", "double": "f8"}
PLY_TYPES |= {np.dtype(kind).name: kind for kind in PLY_TYPES.values()}
PLY_HEADER = re.compile(
    rb"ply\r?\nformat binary_little_endian 1\.0\r?\n(?:(?:comment|obj_info)[^\n]*\n)*"
    rb"element vertex (?P<vertices>\d+)\r?\n(?P<properties>(?:property \w+ \w+\r?\n)+)"
    rb"element face (?P<faces>\d+)\r?\nproperty list (?P<count>\w+) (?P<corner>\w+) vertex_ind(?:ices|ex)\r?\n"
    rb"end_header\r?\n"
)


def read_triangles(path: Path, kind: str) -> tuple[Array, IntArray] | None:
    """Return vertices (v, 3) and faces (f, 3) of a file; None if it is of a form for a general reader, or truncated."""
    if kind not in ("stl", "ply"):
        return None
    content = path.read_bytes()
    return _read_stl(content) if kind == "stl" else _read_ply(content)


def _read_stl(content: bytes) -> tuple[Array, IntArray] | None:
    """Read a binary STL file: corners of each face are vertices of their own."""
    count = int.from_bytes(content[STL_HEADER - 4 : STL_HEADER], "little")
    if len(content) != STL_HEADER + count * STL_FACE.itemsize:
        return None
    corners = np.frombuffer(content, STL_FACE, offset=STL_HEADER)["corners"]
    return corners.reshape(-1, 3).astype(float), np.arange(3 * count).reshape(-1, 3)


def _read_ply(content: bytes) -> tuple[Array, IntArray] | None:
    """Read a binary PLY file of vertices and triangles, without further data of the faces."""
    header = PLY_HEADER.match(content)
    if header is None:
        return None
    try:
        words = [line.split() for line in header["properties"].decode().splitlines()]
        of_vertex = np.dtype([(name, f"<{PLY_TYPES[kind]}") for _, kind, name in words])
        count, corner = (f"<{PLY_TYPES[header[name].decode()]}" for name in ("count", "corner"))
        of_face = np.dtype([("count", count), ("corners", corner, 3)])
        vertices, faces = int(header["vertices"]), int(header["faces"])
        end = header.end() + vertices * of_vertex.itemsize
        if len(content) != end + faces * of_face.itemsize:
            return None
        points = np.frombuffer(content, of_vertex, vertices, header.end())
        triangles = np.frombuffer(content, of_face, faces, end)
        if (triangles["count"] != 3).any():
            return None
        return np.column_stack([points[c].astype(float) for c in "xyz"]), triangles["corners"].astype(np.int64)
    except (KeyError, ValueError):  # an unknown type, no coordinate x, or a name that is there twice
        return None
