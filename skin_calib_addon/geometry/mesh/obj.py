"""Read Wavefront OBJ files."""

from pathlib import Path

import numpy as np

from ...common.arrays import Array, IntArray
from .polygons import triangulated
from .words import shown, words_of_lines

# Elements without an effect on the surface: textures, normals, groups, materials, display, points and lines. Others,
# such as curved surfaces, are refused.
OTHERS = {
    *(b"vt", b"vn", b"g", b"o", b"s", b"mg", b"usemtl", b"mtllib", b"usemap", b"maplib", b"p", b"l"),
    *(b"lod", b"bevel", b"c_interp", b"d_interp", b"shadow_obj", b"trace_obj"),
}


def read_obj(path: Path) -> tuple[Array, IntArray]:
    """Read the vertices (v, 3) and triangles (f, 3) of all groups; negative indices count from the last vertex."""
    points: list[tuple[float, ...]] = []
    corners: list[int] = []
    counts: list[int] = []
    for number, words in words_of_lines(path.read_bytes()):
        try:
            if words[0] == b"v":  # weights and colours may follow
                points.append(tuple(map(float, words[1:4])))
                if len(words) < 4:
                    raise ValueError
            elif words[0] in (b"f", b"fo"):
                counts.append(len(words) - 1)
                for word in words[1:]:
                    index = int(word.partition(b"/")[0])  # those of texture and normal may follow
                    corners.append(index - 1 if index > 0 else len(points) + index)
                    if not index or corners[-1] < 0:
                        raise ValueError
                if len(words) < 4:
                    raise ValueError
            elif words[0] not in OTHERS:
                raise ValueError(f"line {number} has the element {shown(words[0])}, which is not supported")
        except ValueError as error:
            if words[0] not in (b"v", b"f", b"fo"):
                raise
            what = "vertex of three coordinates" if words[0] == b"v" else "face of three or more vertices before it"
            raise ValueError(f"line {number} is no {what}: {shown(b' '.join(words))}") from error
    vertices = np.array(points).reshape(-1, 3)
    return vertices, triangulated(vertices, corners, counts)
