"""Read STL files."""

import re
from pathlib import Path

import numpy as np

from ...common.arrays import Array, IntArray
from .words import BYTE_ORDER_MARK, numbers, shown

# Format: one face of a binary file, after a header of 84 bytes that ends with their number.
FACE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
HEADER = 84  # Format
# Format: one face of a file of text.
VERTEX = rb"\s+vertex\s+(\S+)\s+(\S+)\s+(\S+)"
TEXT_FACE = re.compile(
    rb"\s*facet\s+normal\s+\S+\s+\S+\s+\S+\s+outer\s+loop" + 3 * VERTEX + rb"\s+endloop\s+endfacet", re.I
)
NUMBERS_PER_FACE = 9  # Format


def read_stl(path: Path) -> tuple[Array, IntArray]:
    """Read a binary file or one of text, with one solid or several: corners of each face are vertices of their own."""
    content = path.read_bytes()
    announced = int.from_bytes(content[HEADER - 4 : HEADER], "little")
    surplus = len(content) - HEADER - announced * FACE.itemsize
    if surplus == 0:  # first, because some binary files begin with "solid"
        corners = np.frombuffer(content, FACE, offset=HEADER)["corners"].astype(float)
    elif content.removeprefix(BYTE_ORDER_MARK).lstrip()[:5].lower() == b"solid" and b"\0" not in content:
        corners = _corners_of_text(content.removeprefix(BYTE_ORDER_MARK))
    elif len(content) < HEADER:
        raise ValueError("it is neither binary nor text that begins with 'solid'")
    elif surplus < 0:
        found = (len(content) - HEADER) // FACE.itemsize
        raise ValueError(
            f"it is truncated: its header announces {announced} faces, but {found} were found; export it again"
        )
    else:
        raise ValueError(
            f"it has {surplus} bytes after the {announced} faces that its header announces; export it again"
        )
    return corners.reshape(-1, 3), np.arange(len(corners.reshape(-1, 3))).reshape(-1, 3)


def _corners_of_text(content: bytes) -> Array:
    """Return the coordinates of the corners of all faces, shape (9 f,)."""
    parts = TEXT_FACE.split(content)
    between = parts[:: NUMBERS_PER_FACE + 1]
    del parts[:: NUMBERS_PER_FACE + 1]
    for number, part in enumerate(between, 1):
        for line in part.splitlines():
            words = line.lower().split()
            if words and words[0] not in (b"solid", b"endsolid"):
                raise ValueError(
                    f"its face {number} is incomplete, or no triangle: {shown(line.strip())}; export it again"
                )
    if b"endsolid" not in between[-1].lower():
        raise ValueError(f"it is truncated: it has no 'endsolid' after its {len(between) - 1} faces; export it again")
    return numbers(parts)
