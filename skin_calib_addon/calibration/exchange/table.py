"""Read and write CSV tables of taxels, from spreadsheets, GenTact or scripts, in metres."""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...common.arrays import Array, IntArray
from ...common.errors import listed
from ...common.findings import Finding, did_you_mean, error, first, show, warning
from ...common.tables import TableError, read_rows
from ...common.text import MAX_TAXELS, NumberError, real, whole
from ..model import LinkCalibration
from .link_taxels import refuse_labels, taxels_of
from .taxel_set import Draft, TaxelSet, line

# Accepted names of each column, in lower case; the first name in the header is used.
POSITION = (("x",), ("y",), ("z",))
NORMAL = tuple((f"n{c}", f"norm{c}", f"normal_{c}") for c in "xyz")
TANGENT = tuple((f"t{c}", f"tangent_{c}") for c in "xyz")
CHANNEL = ("channel", "row", "index")
LABEL = ("id", "label")
FRAME = ("frame", "link", "parent")
NEIGHBOURS = ("neighbours",)  # channels of the neighbours, separated by spaces
GENTACT = ("Index", "X", "Y", "Z", "NormX", "NormY", "NormZ", "Radius", "Parent", "Object Name in Blender")
SIGMA = ("sigma_along", "sigma_normal", "sigma_angle")  # standard uncertainty [m], [m], [rad]; empty where unknown
NOT_NEEDED = {"patch", "area", *SIGMA, *(name.lower() for name in GENTACT)}  # of the columns that we write
VECTORS = ("x", "y", "z", "nx", "ny", "nz", "tx", "ty", "tz")


@dataclass(frozen=True)
class Columns:
    """Positions of all columns in a row; None for columns that do not exist."""

    position: tuple[int, ...]
    normal: tuple[int, ...] | None
    tangent: tuple[int, ...] | None
    channel: int | None
    label: int | None
    frame: int | None
    neighbours: int | None


def read_table(text: str) -> Draft:
    """Read rows below a header.

    The names in the header may have any order and case. A warning names unknown columns. Without a channel, the index
    of the row is the channel. Without a label, the channel is the label.
    """
    draft = Draft()
    rows = read_rows(text)
    try:
        number, header = next(rows, (1, [""]))
        columns = _columns(draft, number, [name.strip().lower() for name in header])
        if columns is not None:
            draft.normals = None if columns.normal is None else []
            draft.tangents = None if columns.tangent is None else []
            draft.findings += first(_read_rows(draft, columns, rows, len(header)))
    except TableError as problem:
        draft.findings.append(error("syntax", line(problem.line), str(problem)))
    if not draft.lines and not draft.broken:
        draft.findings.append(error("no-taxels", "", "has no row below its header; check that it is the correct file"))
    return draft


def has_header(text: str) -> bool:
    """Return whether a text begins with a header that contains x, y and z."""
    try:
        _, header = next(read_rows(text), (1, [""]))
    except TableError:
        return False
    return {"x", "y", "z"} <= {name.strip().lower() for name in header}


def _columns(draft: Draft, number: int, header: list[str]) -> Columns | None:
    """Find the columns; errors of the header go into the draft."""
    for name in sorted({name for name in header if name and header.count(name) > 1}):
        draft.findings.append(error("duplicate-column", line(number), f"names the column {show(name)} twice", name))

    def column(names: tuple[str, ...]) -> int | None:
        return next((header.index(name) for name in names if name in header), None)

    def vector(names: tuple[tuple[str, ...], ...], needed: bool) -> tuple[int, ...] | None:
        found = [column(synonyms) for synonyms in names]
        if all(k is None for k in found) and not needed:
            return None
        for k, synonyms in zip(found, names):
            if k is None:
                message = f"has no column {show(synonyms[0])}{did_you_mean(synonyms[0], header)}"
                draft.findings.append(error("missing-column", line(number), message, header[:100]))
        return tuple(k for k in found if k is not None)

    position, normal, tangent = vector(POSITION, True), vector(NORMAL, False), vector(TANGENT, False)
    if draft.broken or position is None:
        return None
    known = {name for names in (*POSITION, *NORMAL, *TANGENT, CHANNEL, LABEL, FRAME, NEIGHBOURS) for name in names}
    unknown = [name for name in header if name and name not in known | NOT_NEEDED]
    if unknown:
        message = f"has columns that are not used: {listed(unknown)}"
        draft.findings.append(warning("unused-columns", line(number), message, unknown[:100]))
    return Columns(position, normal, tangent, column(CHANNEL), column(LABEL), column(FRAME), column(NEIGHBOURS))


def _read_rows(draft: Draft, columns: Columns, rows: Iterator[tuple[int, list[str]]], width: int) -> Iterator[Finding]:
    """Copy the rows into the draft, and yield errors."""
    frames: dict[str, int] = {}
    neighbours: list[list[int]] = []
    for index, (number, row) in enumerate(rows):
        if index == MAX_TAXELS:
            yield error("size", line(number), f"exceeds the limit of {MAX_TAXELS} rows")
            return
        if len(row) != width:
            yield error("row", line(number), f"has {len(row)} columns, but the header has {width}")
            continue
        try:
            position, normal, tangent = (
                [real(row[i].strip()) for i in cells or ()]
                for cells in (columns.position, columns.normal, columns.tangent)
            )
            channel = index if columns.channel is None else whole(row[columns.channel].strip())
            others = [] if columns.neighbours is None else [whole(word) for word in row[columns.neighbours].split()]
        except NumberError as problem:
            yield error(problem.code, line(number), str(problem))
            continue
        neighbours.append(others)
        label = str(channel) if columns.label is None else row[columns.label].strip()
        draft.add(number, label, channel, position, normal, tangent)
        if columns.frame is not None:
            frames.setdefault(row[columns.frame].strip(), number)
    draft.frame = next(iter(frames)) or None if len(frames) == 1 else None
    if columns.neighbours is not None:
        yield from _name_neighbours(draft, neighbours)
    if len(frames) > 1:
        number = sorted(frames.values())[1]
        message = f"has another frame than the previous rows; the {len(frames)} frames are treated as one"
        yield warning("frames", line(number), message, len(frames))


def _name_neighbours(draft: Draft, neighbours: list[list[int]]) -> Iterator[Finding]:
    """Copy the labels of the neighbours into the draft, and yield a warning for unknown channels."""
    label = dict(zip(draft.channels, draft.labels))
    draft.neighbours = [tuple(label[other] for other in others if other in label) for others in neighbours]
    missing = [
        (number, other) for number, others in zip(draft.lines, neighbours) for other in others if other not in label
    ]
    if missing:
        message = (
            f"names a neighbour outside this file; {len(missing)} are missing, the first is channel {missing[0][1]}"
        )
        yield warning("unknown-neighbour", line(missing[0][0]), message, len(missing))


def write_table(calibration: LinkCalibration) -> bytes:
    """Write all data of each taxel in one row, without loss of digits."""
    taxels = taxels_of(calibration)
    refuse_labels(taxels.ids, "the id")
    refuse_labels((taxels.link,), "the link name")
    columns = {
        **_shared_columns(taxels.channels, taxels.ids, (taxels.positions, taxels.normals, taxels.tangents)),
        "link": [taxels.link] * len(taxels.ids),
        "patch": taxels.patches,
        "area": taxels.areas.tolist(),
        "neighbours": _channels_of(taxels.neighbours, taxels.ids, taxels.channels),
    }
    if np.isfinite(taxels.sigma).any():
        uncertain = [["" if value != value else value for value in column] for column in taxels.sigma.T.tolist()]
        columns |= dict(zip(SIGMA, uncertain))
    return _csv_bytes(columns)


def write_taxel_set(taxels: TaxelSet) -> bytes:
    """Write the taxels of a file in the same columns; unknown columns are left out."""
    columns = _shared_columns(taxels.channels, taxels.labels, (taxels.positions, taxels.normals, taxels.tangents))
    if taxels.frame is not None:
        columns["link"] = [taxels.frame] * len(taxels.labels)
    if taxels.neighbours is not None:
        columns["neighbours"] = _channels_of(taxels.neighbours, taxels.labels, taxels.channels)
    return _csv_bytes(columns)


def write_gentact(calibration: LinkCalibration) -> bytes:
    """Write a GenTact table.

    The radius is that of a disc with the area of the cell. The object is the patch.
    """
    taxels = taxels_of(calibration)
    refuse_labels((taxels.link,), "the link name")
    numbers = np.column_stack((taxels.positions, taxels.normals, np.sqrt(taxels.areas / np.pi))).T.tolist()
    values = (taxels.channels.tolist(), *numbers, [taxels.link] * len(taxels.ids), taxels.patches)
    return _csv_bytes(dict(zip(GENTACT, values)))


def _shared_columns(channels: IntArray, labels: Sequence[str], vectors: Sequence[Array | None]) -> dict[str, Any]:
    """Return the columns that each taxel has: channel, id, and those of its position, normal and tangent it has."""
    columns: dict[str, Any] = {"channel": channels.tolist(), "id": labels}
    for i, part in enumerate(vectors):
        if part is not None:
            columns |= dict(zip(VECTORS[3 * i : 3 * i + 3], part.T.tolist()))
    return columns


def _channels_of(neighbours: Iterable[Iterable[str]], labels: Sequence[str], channels: IntArray) -> list[str]:
    """Return the channels of the neighbours of each taxel, separated by spaces."""
    channel = dict(zip(labels, channels.tolist()))
    return [" ".join(str(channel[i]) for i in row if i in channel) for row in neighbours]


def _csv_bytes(columns: dict[str, Any]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values()))
    return text.getvalue().encode()
