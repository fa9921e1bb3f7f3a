"""Tables of taxels with a header: CSV as spreadsheets, GenTact and scripts write it, metres."""

import csv
import io
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ...common.findings import Finding, did_you_mean, error, first, show, warning
from ...common.tables import TableError, read_rows
from ...common.text import MAX_TAXELS, NumberError, real, whole
from ..model import LinkCalibration
from .link_taxels import refuse_labels, taxels_of
from .taxel_set import Draft, TaxelSet, line

# Names of each column, in small letters; the first that the header has is taken.
POSITION = (("x",), ("y",), ("z",))
NORMAL = tuple((f"n{c}", f"norm{c}", f"normal_{c}") for c in "xyz")
TANGENT = tuple((f"t{c}", f"tangent_{c}") for c in "xyz")
CHANNEL = ("channel", "row", "index")
LABEL = ("id", "label")
FRAME = ("frame", "link", "parent")
NEIGHBOURS = ("neighbours",)  # channels of the neighbours, with spaces between
GENTACT = ("Index", "X", "Y", "Z", "NormX", "NormY", "NormZ", "Radius", "Parent", "Object Name in Blender")
PLACE = ("x", "y", "z", "nx", "ny", "nz", "tx", "ty", "tz")


@dataclass(frozen=True)
class Columns:
    """Where in a row everything stands; None for what the table does not have."""

    position: tuple[int, ...]
    normal: tuple[int, ...] | None
    tangent: tuple[int, ...] | None
    channel: int | None
    label: int | None
    frame: int | None
    neighbours: int | None


def read_table(text: str) -> Draft:
    """Rows below a header; its names, in any order and case, say what a column is, and other columns are left alone.

    Without a channel, a row's index counts; without a label, its channel is its name.
    """
    draft = Draft()
    rows = read_rows(text)
    try:
        number, header = next(rows, (1, [""]))
        columns = _columns(draft, number, [name.strip().lower() for name in header])
        if columns is not None:
            draft.normals = None if columns.normal is None else []
            draft.tangents = None if columns.tangent is None else []
            draft.findings += first(_take(draft, columns, rows, len(header)))
    except TableError as problem:
        draft.findings.append(error("syntax", line(problem.line), str(problem)))
    if not draft.lines and not draft.broken:
        draft.findings.append(error("no-taxels", "", "has no row below its header; check that it is the right file"))
    return draft


def has_header(text: str) -> bool:
    """Whether a text begins with a header that names x, y and z."""
    try:
        _, header = next(read_rows(text), (1, [""]))
    except TableError:
        return False
    return {"x", "y", "z"} <= {name.strip().lower() for name in header}


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
    return Columns(position, normal, tangent, place(CHANNEL), place(LABEL), place(FRAME), place(NEIGHBOURS))


def _take(draft: Draft, columns: Columns, rows: Iterator[tuple[int, list[str]]], width: int) -> Iterator[Finding]:
    """Put the rows into the draft; what is wrong with one."""
    frames: dict[str, int] = {}
    neighbours: list[list[int]] = []
    for index, (number, row) in enumerate(rows):
        if index == MAX_TAXELS:
            yield error("size", line(number), f"is one row too many; at most {MAX_TAXELS} are read")
            return
        if len(row) != width:
            yield error("row", line(number), f"has {len(row)} columns, but the header has {width}")
            continue
        try:
            vectors = [
                None if places is None else tuple(real(row[i].strip()) for i in places)
                for places in (columns.position, columns.normal, columns.tangent)
            ]
            channel = index if columns.channel is None else whole(row[columns.channel].strip())
            others = [] if columns.neighbours is None else [whole(word) for word in row[columns.neighbours].split()]
        except NumberError as problem:
            yield error(problem.code, line(number), str(problem))
            continue
        neighbours.append(others)
        draft.lines.append(number)
        draft.channels.append(channel)
        draft.labels.append(str(channel) if columns.label is None else row[columns.label].strip())
        for column, vector in zip((draft.positions, draft.normals, draft.tangents), vectors):
            if column is not None and vector is not None:
                column.append(vector)
        if columns.frame is not None:
            frames.setdefault(row[columns.frame].strip(), number)
    draft.frame = next(iter(frames)) or None if len(frames) == 1 else None
    if columns.neighbours is not None:
        yield from _name_neighbours(draft, neighbours)
    if len(frames) > 1:
        number = sorted(frames.values())[1]
        message = f"is in another frame than the rows before; the {len(frames)} frames named are read as if it were one"
        yield warning("frames", line(number), message, len(frames))


def _name_neighbours(draft: Draft, neighbours: list[list[int]]) -> Iterator[Finding]:
    """Put the labels of the neighbours into the draft; what is wrong with their channels."""
    label = dict(zip(draft.channels, draft.labels))
    draft.neighbours = [tuple(label[other] for other in others if other in label) for others in neighbours]
    lost = [
        (number, other) for number, others in zip(draft.lines, neighbours) for other in others if other not in label
    ]
    if lost:
        message = f"names neighbours that are not all in this file; {len(lost)} are not, channel {lost[0][1]} the first"
        yield warning("unknown-neighbour", line(lost[0][0]), message, len(lost))


def write_table(calibration: LinkCalibration) -> bytes:
    """Everything about a taxel in a row, to the last bit.

    Raises
    ------
    CalibrationFormatError
        If a name would not come back as it is.
    """
    taxels = taxels_of(calibration)
    refuse_labels(taxels.ids, "the id")
    refuse_labels((taxels.link,), "the link name")
    channel = dict(zip(taxels.ids, taxels.channels.tolist()))
    vectors = np.column_stack((taxels.positions, taxels.normals, taxels.tangents)).tolist()
    neighbours = (" ".join(str(channel[i]) for i in others if i in channel) for others in taxels.neighbours)
    columns = (taxels.patches, taxels.areas.tolist(), neighbours)
    rows = (
        (number, name, *numbers, taxels.link, *rest)
        for number, name, numbers, *rest in zip(taxels.channels.tolist(), taxels.ids, vectors, *columns)
    )
    return _bytes(("channel", "id", *PLACE, "link", "patch", "area", "neighbours"), rows)


def write_taxel_set(taxels: TaxelSet) -> bytes:
    """What is known of the taxels of a file, in the same columns: those that it does not tell are left out."""
    given = [vectors for vectors in (taxels.positions, taxels.normals, taxels.tangents) if vectors is not None]
    names = [
        axis
        for i, vectors in enumerate((taxels.positions, taxels.normals, taxels.tangents))
        if vectors is not None
        for axis in PLACE[3 * i : 3 * i + 3]
    ]
    header = ["channel", "id", *names]
    columns: list[Iterable[object]] = []
    if taxels.frame is not None:
        header.append("link")
        columns.append([taxels.frame] * len(taxels.labels))
    if taxels.neighbours is not None:
        header.append("neighbours")
        channel = dict(zip(taxels.labels, taxels.channels.tolist()))
        columns.append(" ".join(str(channel[i]) for i in row if i in channel) for row in taxels.neighbours)
    rows = zip(taxels.channels.tolist(), taxels.labels, np.column_stack(given).tolist(), *columns)
    return _bytes(header, ((number, name, *numbers, *rest) for number, name, numbers, *rest in rows))


def write_gentact(calibration: LinkCalibration) -> bytes:
    """The table that GenTact writes: the radius is that of a disc as large as the cell, the object is the patch.

    Raises
    ------
    CalibrationFormatError
        If a name would not come back as it is.
    """
    taxels = taxels_of(calibration)
    refuse_labels((taxels.link,), "the link name")
    vectors = np.column_stack((taxels.positions, taxels.normals, np.sqrt(taxels.areas / np.pi))).tolist()
    rows = (
        (number, *numbers, taxels.link, patch)
        for number, numbers, patch in zip(taxels.channels.tolist(), vectors, taxels.patches)
    )
    return _bytes(GENTACT, rows)


def _bytes(header: Iterable[str], rows: Iterable[Iterable[object]]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue().encode()
