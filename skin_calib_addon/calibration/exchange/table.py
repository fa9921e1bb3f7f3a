"""Tables of taxels with a header: CSV as spreadsheets, GenTact and scripts write it, metres."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass

from ..findings import Finding, did_you_mean, error, first, show, warning
from .taxel_set import Draft, line
from .text import MOST_TAXELS, BadNumber, real, whole

SEPARATORS = ",;\t"
# Names of each column, in small letters; the first that the header has is taken.
POSITION = (("x",), ("y",), ("z",))
NORMAL = tuple((f"n{c}", f"norm{c}", f"normal_{c}") for c in "xyz")
TANGENT = tuple((f"t{c}", f"tangent_{c}") for c in "xyz")
CHANNEL = ("channel", "row", "index")
LABEL = ("id", "label")
FRAME = ("frame", "link", "parent")


@dataclass(frozen=True)
class Columns:
    """Where in a row everything stands; None for what the table does not have."""

    position: tuple[int, ...]
    normal: tuple[int, ...] | None
    tangent: tuple[int, ...] | None
    channel: int | None
    label: int | None
    frame: int | None


def read_table(text: str) -> Draft:
    """Rows below a header; its names, in any order and case, say what a column is, and other columns are left alone.

    Without a channel, a row's index counts; without a label, its channel is its name.
    """
    draft = Draft()
    rows = _rows(text)
    try:
        number, header = next(rows, (1, [""]))
        columns = _columns(draft, number, [name.strip().lower() for name in header])
        if columns is not None:
            draft.normals = None if columns.normal is None else []
            draft.tangents = None if columns.tangent is None else []
            draft.findings += first(_take(draft, columns, rows, len(header)))
    except csv.Error as problem:
        draft.findings.append(error("syntax", "", f"is no table: {problem}"))
    if not draft.lines and not draft.broken:
        draft.findings.append(error("no-taxels", "", "has no row below its header; check that it is the right file"))
    return draft


def has_header(text: str) -> bool:
    """Whether a text begins with a header that names x, y and z."""
    try:
        _, header = next(_rows(text), (1, [""]))
    except csv.Error:
        return False
    return {"x", "y", "z"} <= {name.strip().lower() for name in header}


def _rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Numbered rows, comments and empty lines left out; the header tells what separates columns."""
    lines = text.split("\n")
    head = next((content for content in lines if content.strip() and not content.startswith("#")), "")
    separator = max(SEPARATORS, key=head.count)
    reader = csv.reader(lines, delimiter=separator, strict=True)
    for row in reader:
        if any(cell.strip() for cell in row) and not row[0].startswith("#"):
            yield reader.line_num, row


def _columns(draft: Draft, number: int, header: list[str]) -> Columns | None:
    """Find the columns; what is wrong with the header goes into the draft."""
    for name in sorted({name for name in header if name and header.count(name) > 1}):
        draft.findings.append(error("duplicate-column", line(number), f"names the column {show(name)} twice", name))

    def place(names: tuple[str, ...]) -> int | None:
        return next((header.index(name) for name in names if name in header), None)

    def vector(names: tuple[tuple[str, ...], ...], needed: bool) -> tuple[int, ...] | None:
        places = [place(alike) for alike in names]
        if all(at is None for at in places) and not needed:
            return None
        for at, alike in zip(places, names):
            if at is None:
                message = f"names no column {show(alike[0])}{did_you_mean(alike[0], header)}"
                draft.findings.append(error("missing-column", line(number), message, header[:100]))
        return tuple(at for at in places if at is not None)

    position, normal, tangent = vector(POSITION, True), vector(NORMAL, False), vector(TANGENT, False)
    if draft.broken or position is None:
        return None
    return Columns(position, normal, tangent, place(CHANNEL), place(LABEL), place(FRAME))


def _take(draft: Draft, columns: Columns, rows: Iterator[tuple[int, list[str]]], width: int) -> Iterator[Finding]:
    """Put the rows into the draft; what is wrong with one."""
    frames: dict[str, int] = {}
    for index, (number, row) in enumerate(rows):
        if index == MOST_TAXELS:
            yield error("size", line(number), f"is one row too many; at most {MOST_TAXELS} are read")
            return
        if len(row) != width:
            yield error("row", line(number), f"has {len(row)} columns, the header {width}")
            continue
        try:
            vectors = [
                None if places is None else tuple(real(row[i].strip()) for i in places)
                for places in (columns.position, columns.normal, columns.tangent)
            ]
            channel = index if columns.channel is None else whole(row[columns.channel].strip())
        except BadNumber as problem:
            yield error(problem.code, line(number), str(problem))
            continue
        draft.lines.append(number)
        draft.channels.append(channel)
        draft.labels.append(str(channel) if columns.label is None else row[columns.label].strip())
        for column, vector in zip((draft.positions, draft.normals, draft.tangents), vectors):
            if column is not None and vector is not None:
                column.append(vector)
        if columns.frame is not None:
            frames.setdefault(row[columns.frame].strip(), number)
    draft.frame = next(iter(frames)) or None if len(frames) == 1 else None
    if len(frames) > 1:
        number = sorted(frames.values())[1]
        message = f"is in another frame than the rows before; the {len(frames)} frames named are read as if it were one"
        yield warning("frames", line(number), message, len(frames))
