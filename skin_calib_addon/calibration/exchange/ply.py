"""Read and write PLY point clouds with normals, in metres, as text or binary data of both byte orders."""

from dataclasses import dataclass, field

from ...common.findings import FoundError, show, warning
from ..model import LinkCalibration
from .cloud import Points, cloud_of, count_of, lines_of, read_points
from .taxel_set import Draft, line

MAGIC = b"ply"
END = b"end_header"
KINDS = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass
class Header:
    """Entries of the header about the vertices."""

    order: str | None = None  # byte order; empty for text
    count: int | None = None
    names: list[str] = field(default_factory=list)
    types: list[str] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)
    faces: tuple[int, str] | None = None  # line and number of the faces
    only_points: bool = True  # whether there are no other elements


def read_ply(data: bytes) -> Draft:
    """Read the vertices, which must be the first element; faces and other elements are ignored."""
    stop = data.find(b"\n", max(data.find(b"\n" + END), 0) + 1) + 1 or len(data)
    if not data.startswith(MAGIC):
        raise FoundError("syntax", "", "does not begin with ply; check that it is the correct file")
    head = lines_of(data[:stop]).split("\n")
    header = _header(head)
    if header.order is None or header.count is None or not header.names:
        raise FoundError("syntax", "", "has a header without format or vertices; export the file again")
    types = [header.order + kind for kind in header.types] if header.order else None
    points = Points(header.count, header.names, types, data[stop:], len(head), header.comments, header.only_points)
    draft = read_points(points)
    if header.faces is not None:
        message = f"announces {show(header.faces[1])} faces: if this is a mesh, its vertices are read as taxels"
        draft.findings.append(warning("faces", line(header.faces[0]), message))
    return draft


def _header(lines: list[str]) -> Header:
    header, element = Header(), ""
    for number, content in enumerate(lines, 1):
        words = content.split()
        match words:
            case ["format", name, *_]:
                header.order = ORDERS.get(name)
            case ["comment", *_]:
                header.comments.append(content.lstrip().removeprefix("comment").removeprefix(" "))
            case ["element", element, amount]:
                header.only_points &= element == "vertex"
                if element == "vertex":
                    if header.count is not None:
                        raise FoundError("syntax", line(number), "names a second element vertex; keep one")
                    header.count = count_of(amount, number)
                elif element == "face" and header.count is not None:
                    header.faces = (number, amount) if amount != "0" else None
                elif header.count is None:
                    raise FoundError(
                        "syntax",
                        line(number),
                        f"names {show(element)} before the vertices; move the vertices to the front",
                    )
            case ["property", "list", *_] if element == "vertex":
                raise FoundError("syntax", line(number), "defines a list for vertices; export them with plain numbers")
            case ["property", kind, name] if element == "vertex":
                if kind not in KINDS:
                    raise FoundError("syntax", line(number), f"has the type {show(kind)}, which is invalid in PLY")
                header.names.append(name.lower())
                header.types.append(KINDS[kind])
            case ["end_header"]:
                return header
    raise FoundError("syntax", "", "has a header without end; the file is truncated")


def write_ply(calibration: LinkCalibration) -> bytes:
    """Write a vertex for each taxel with normal and channel; comments contain the ids."""
    comments, rows, sigma = cloud_of(calibration)
    lines = [
        "ply",
        "format ascii 1.0",
        *(f"comment {comment}" for comment in comments),
        f"element vertex {len(rows)}",
        *(f"property double {name}" for name in ("x", "y", "z", "nx", "ny", "nz")),
        "property int channel",
        *(f"property double {name}" for name in sigma),
        "end_header",
        *rows,
    ]
    return ("\n".join(lines) + "\n").encode()
