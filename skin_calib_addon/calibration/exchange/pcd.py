"""Point clouds of PCL: points with normals, metres; as text or as bytes."""

from dataclasses import dataclass, field

from ...common.findings import show, warning
from ..model import LinkCalibration
from .cloud import (
    CloudError,
    cloud_of,
    count_of,
    fill_draft,
    lines_of,
    parse_bytes,
    parse_comments,
    parse_text,
    point,
    rows_of,
)
from .taxel_set import Draft, line

FIRST_LINES = (b"# .PCD", b"VERSION", b"FIELDS")  # one of these begins a file
TYPES = {"I": "i", "U": "u", "F": "f"}
SIZES = {"I": "1248", "U": "1248", "F": "48"}
IDENTITY_VIEWPOINT = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]  # the viewpoint of points in their own frame


@dataclass
class Header:
    """What the header says about the points."""

    words: dict[str, list[str]] = field(default_factory=dict)
    numbers: dict[str, int] = field(default_factory=dict)  # the line of each
    comments: list[str] = field(default_factory=list)
    lines: int = 0

    def entry(self, name: str) -> list[str]:
        """The words of an entry."""
        if not self.words.get(name):
            raise CloudError("syntax", "", f"has a header without {name}; export it anew")
        return self.words[name]


def read_pcd(data: bytes) -> Draft:
    """The points of a file. A viewpoint is not applied: it says where they were seen from."""
    draft = Draft()
    try:
        header, stop = _header(data)
        names, types = _columns(header)
        count, form = count_of(header.entry("POINTS")[0], header.numbers["POINTS"]), header.entry("DATA")[0]
        if form == "ascii":
            rows = rows_of(lines_of(data[stop:]), header.lines + 1, count)
            draft.lines = [number for number, _ in rows]
            columns = parse_text(names, rows)
        elif form == "binary":
            draft.lines, draft.at = list(range(count)), point
            columns = parse_bytes(names, types, data[stop:], count)
        else:
            message = f"holds {show(form)} data; save it as ascii or binary (pcl_convert_pcd_ascii_binary)"
            raise CloudError("syntax", line(header.numbers["DATA"]), message)
        fill_draft(draft, columns, parse_comments(draft, header.comments))
        if _numbers(header.words.get("VIEWPOINT", [])) not in ([], IDENTITY_VIEWPOINT):
            message = "has a viewpoint, which is not applied: positions are taken as they stand"
            draft.findings.append(warning("unused-transform", line(header.numbers["VIEWPOINT"]), message))
    except CloudError as problem:
        draft.findings.append(problem.finding)
    return draft


def _header(data: bytes) -> tuple[Header, int]:
    """The header, and where in the file its data begin."""
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
    raise CloudError("syntax", "", "has no line DATA; it is cut off, or no PCD file")


def _columns(header: Header) -> tuple[list[str], list[str]]:
    """Name and NumPy type of every number of a point; a field of several numbers has a name for each."""
    fields = [name.lower() for name in header.entry("FIELDS")]
    counts = header.words.get("COUNT") or ["1"] * len(fields)
    names, types = [], []
    entries = (fields, header.entry("SIZE"), header.entry("TYPE"), counts)
    if len({len(entry) for entry in entries}) > 1:
        raise CloudError(
            "syntax", line(header.numbers["FIELDS"]), "names other fields than SIZE, TYPE and COUNT describe"
        )
    for name, size, kind, count in zip(*entries):
        if size not in SIZES.get(kind, ()) or not count.isdecimal() or not 1 <= int(count[:9]) <= 1000:
            message = f"has the field {show(name)} of type {show(kind)}, size {show(size)}, count {show(count)}"
            raise CloudError("syntax", line(header.numbers["FIELDS"]), f"{message}, which PCD does not have")
        names += [name, *(f"{name} {i}" for i in range(1, int(count)))]
        types += int(count) * [f"<{TYPES[kind]}{size}"]
    return names, types


def _numbers(words: list[str]) -> list[float] | None:
    try:
        return [float(word) for word in words]
    except ValueError:
        return None


def write_pcd(calibration: LinkCalibration) -> bytes:
    """A point for each taxel with its normal and its channel; ids are told in comments.

    Fields are declared in single precision, which programs want, and written with all digits, which ours reads.

    Raises
    ------
    CalibrationFormatError
        If a name would not come back as it is.
    """
    comments, rows = cloud_of(calibration)
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        *(f"# {comment}" for comment in comments),
        "VERSION 0.7",
        "FIELDS x y z normal_x normal_y normal_z channel",
        "SIZE 4 4 4 4 4 4 4",
        "TYPE F F F F F F U",
        "COUNT 1 1 1 1 1 1 1",
        f"WIDTH {len(rows)}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {len(rows)}",
        "DATA ascii",
        *rows,
    ]
    return ("\n".join(lines) + "\n").encode()
