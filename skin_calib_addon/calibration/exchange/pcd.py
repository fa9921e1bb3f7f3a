"""Read and write PCD point clouds of PCL, with normals, in metres, as text or binary data."""

from dataclasses import dataclass, field

from ...common.findings import FoundError, show, warning
from ..model import LinkCalibration
from .cloud import Points, cloud_of, count_of, lines_of, read_points
from .taxel_set import Draft, line

FIRST_LINES = (b"# .PCD", b"VERSION", b"FIELDS")  # possible first lines of a file
TYPES = {"I": "i", "U": "u", "F": "f"}
SIZES = {"I": "1248", "U": "1248", "F": "48"}
IDENTITY_VIEWPOINT = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]  # Format: position and quaternion without transformation


@dataclass
class Header:
    """Entries of the header."""

    words: dict[str, list[str]] = field(default_factory=dict)
    numbers: dict[str, int] = field(default_factory=dict)  # line number of each entry
    comments: list[str] = field(default_factory=list)
    lines: int = 0

    def entry(self, name: str) -> list[str]:
        """Return the words of an entry, which must exist."""
        if not self.words.get(name):
            raise FoundError("syntax", "", f"has a header without {name}; export the file again")
        return self.words[name]


def read_pcd(data: bytes) -> Draft:
    """Read the points; a viewpoint (the pose of the camera) is not applied."""
    header, stop = _header(data)
    names, types = _columns(header)
    count, form = count_of(header.entry("POINTS")[0], header.numbers["POINTS"]), header.entry("DATA")[0]
    if form not in ("ascii", "binary"):
        message = f"contains {show(form)} data; save it as ascii or binary (pcl_convert_pcd_ascii_binary)"
        raise FoundError("syntax", line(header.numbers["DATA"]), message)
    kinds = types if form == "binary" else None
    draft = read_points(Points(count, names, kinds, data[stop:], header.lines + 1, header.comments))
    if _numbers(header.words.get("VIEWPOINT", [])) not in ([], IDENTITY_VIEWPOINT):
        message = "has a viewpoint, which is not applied: positions are used unchanged"
        draft.findings.append(warning("unused-transform", line(header.numbers["VIEWPOINT"]), message))
    return draft


def _header(data: bytes) -> tuple[Header, int]:
    """Return the header, and the position of the first byte after it."""
    header, start = Header(), 0
    while start < len(data):
        stop = data.find(b"\n", start) + 1 or len(data)
        content = lines_of(data[start:stop]).rstrip("\n")
        start, header.lines = stop, header.lines + 1
        if content.startswith("#"):
            header.comments.append(content[1:].removeprefix(" "))
            continue
        name, *words = content.split() or [""]
        header.words[name], header.numbers[name] = words, header.lines
        if name == "DATA":
            return header, start
    raise FoundError("syntax", "", "has no line DATA; it is truncated, or not a PCD file")


def _columns(header: Header) -> tuple[list[str], list[str]]:
    """Return name and NumPy type of each number of a point; fields with several numbers have several names."""
    fields = [name.lower() for name in header.entry("FIELDS")]
    counts = header.words.get("COUNT") or ["1"] * len(fields)
    names, types = [], []
    entries = (fields, header.entry("SIZE"), header.entry("TYPE"), counts)
    if len({len(entry) for entry in entries}) > 1:
        raise FoundError(
            "syntax", line(header.numbers["FIELDS"]), "has another number of fields than SIZE, TYPE or COUNT"
        )
    for name, size, kind, count in zip(*entries):
        if size not in SIZES.get(kind, ()) or not count.isdecimal() or not 1 <= int(count[:9]) <= 1000:
            message = f"has the field {show(name)} of type {show(kind)}, size {show(size)}, count {show(count)}"
            raise FoundError("syntax", line(header.numbers["FIELDS"]), f"{message}, which is invalid in PCD")
        names += [name, *(f"{name} {i}" for i in range(1, int(count)))]
        types += int(count) * [f"<{TYPES[kind]}{size}"]
    return names, types


def _numbers(words: list[str]) -> list[float] | None:
    try:
        return [float(word) for word in words]
    except ValueError:
        return None


def write_pcd(calibration: LinkCalibration) -> bytes:
    """Write a point for each taxel with normal and channel; comments contain the ids.

    Fields are declared in single precision, which other programs require. The text has all digits, which the reader
    of this package uses.
    """
    comments, rows, sigma = cloud_of(calibration)
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        *(f"# {comment}" for comment in comments),
        "VERSION 0.7",
        " ".join(("FIELDS x y z normal_x normal_y normal_z channel", *sigma)),
        "SIZE 4 4 4 4 4 4 4" + " 4" * len(sigma),
        "TYPE F F F F F F U" + " F" * len(sigma),
        "COUNT 1 1 1 1 1 1 1" + " 1" * len(sigma),
        f"WIDTH {len(rows)}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {len(rows)}",
        "DATA ascii",
        *rows,
    ]
    return ("\n".join(lines) + "\n").encode()
