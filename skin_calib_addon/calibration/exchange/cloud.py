"""Common parts of PLY and PCD: points with named columns, as text or binary data."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...common.findings import FoundError, show
from ...common.plain_text import DecodingError, decoded
from ...common.text import MAX_TAXELS, NumberError, real
from ..model import MAX_CHANNEL, LinkCalibration
from .link_taxels import refuse_labels, taxels_of
from .table import NORMAL, POSITION, SIGMA
from .taxel_set import Draft, line

CHANNEL = "channel"
MARK, LINK = "taxel ", "link "  # prefixes of comments with channel and id of a taxel, and with the link name


@dataclass
class Points:
    """What the header of a cloud says about its points, and where they begin."""

    count: int
    names: list[str]  # of the columns, in lower case
    types: list[str] | None  # of NumPy, of binary data; None for text
    data: bytes  # after the header
    line: int  # of the first point of a text
    comments: list[str] = field(default_factory=list)
    only_points: bool = True  # whether nothing follows them


def read_points(points: Points) -> Draft:
    """Return the points of a cloud."""
    draft = Draft()
    if points.types is None:
        rows = _rows_of(lines_of(points.data), points.line, points.count, points.only_points)
        draft.lines = [number for number, _ in rows]
        columns = _parse_text(points.names, rows)
    else:
        draft.lines, draft.at = list(range(points.count)), _point
        columns = _parse_bytes(points.names, points.types, points.data, points.count)
    _fill_draft(draft, columns, _parse_comments(draft, points.comments))
    return draft


def _parse_comments(draft: Draft, comments: Iterable[str]) -> dict[int, str]:
    """Return the label of each channel in the comments, and set the link of the draft."""
    labels = {}
    for comment in comments:
        if comment.startswith(LINK):
            draft.frame = comment.removeprefix(LINK)
        elif comment.startswith(MARK):
            channel, _, label = comment.removeprefix(MARK).partition(" ")
            if channel.isdecimal() and len(channel) < 12:
                labels[int(channel)] = label
    return labels


def _parse_text(names: Sequence[str], rows: Sequence[tuple[int, str]]) -> dict[str, list[float]]:
    """Parse points that are written as text."""
    positions = {name: names.index(name) for name in _used_names(names)}
    columns: dict[str, list[float]] = {name: [] for name in positions}
    for number, content in rows:
        words = content.split(None, len(names))
        if len(words) != len(names):
            have = f"more than {len(names)}" if len(words) > len(names) else str(len(words))
            raise FoundError("row", line(number), f"has {have} numbers, but the header names {len(names)}")
        try:
            for name, position in positions.items():
                columns[name].append(real(words[position]))
        except NumberError as problem:
            raise FoundError(problem.code, line(number), str(problem)) from problem
    return columns


def _parse_bytes(names: Sequence[str], types: Sequence[str], data: bytes, count: int) -> dict[str, list[float]]:
    """Parse points that are written as binary data."""
    kind = np.dtype([(f"{i}", type_) for i, type_ in enumerate(types)])
    if len(data) < kind.itemsize * count:
        raise FoundError(
            "size", "", f"is truncated: the header announces {count} points, {len(data) // kind.itemsize} were found"
        )
    table = np.frombuffer(data, kind, count)
    columns = {name: table[str(names.index(name))].astype(float) for name in _used_names(names)}
    for column in columns.values():
        invalid = np.flatnonzero(~np.isfinite(column))
        if len(invalid):
            raise FoundError(
                "not-finite", _point(int(invalid[0])), "has a coordinate that is not finite; remove the point"
            )
    return {name: column.tolist() for name, column in columns.items()}


def _point(index: int) -> str:
    """Return the location of a binary point for a finding; the first is point 0."""
    return f"point {index}"


def _used_names(names: Sequence[str]) -> list[str]:
    """Return the names of the columns that are used; of synonyms only the first."""
    found = [next((name for name in alike if name in names), None) for alike in (*POSITION, *NORMAL)]
    for name, alike in zip(found[:3], POSITION):
        if name is None:
            raise FoundError(
                "missing-column", "", f"has no column {show(alike[0])}; its columns are {show(' '.join(names))}"
            )
    if any(found[3:]) and None in found[3:]:
        missing = NORMAL[found[3:].index(None)][0]
        raise FoundError("missing-column", "", f"has a normal without the column {show(missing)}; export it, too")
    used = [name for name in (*found, CHANNEL if CHANNEL in names else None) if name is not None]
    for name in used:
        if names.count(name) > 1:
            raise FoundError("duplicate-column", "", f"names the column {show(name)} twice")
    return used


def _fill_draft(draft: Draft, columns: dict[str, list[float]], labels: dict[int, str]) -> None:
    """Copy the columns into the draft."""
    values = list(columns.values())
    count = len(values[0])
    draft.positions = list(zip(*values[:3]))
    draft.normals = list(zip(*values[3:6])) if len(values) >= 6 else None
    numbers = columns.get(CHANNEL, range(count))
    for row, number in enumerate(numbers):
        if number != int(number) or not 0 <= number <= MAX_CHANNEL:
            raise FoundError(
                "channel", draft.at(draft.lines[row]), f"has the channel {number!r}; use 0 to {MAX_CHANNEL}"
            )
    draft.channels = [int(number) for number in numbers]
    draft.labels = [labels.get(channel, str(channel)) for channel in draft.channels]
    if not draft.labels:
        raise FoundError("no-taxels", "", "contains no point; check that it is the correct file")


def cloud_of(calibration: LinkCalibration) -> tuple[list[str], list[str], tuple[str, ...]]:
    """Return comments with the ids of the taxels, and a row of text for each: position, normal, channel, uncertainty.

    The names of the columns of the uncertainty are returned, too; there are none if it is not stated.
    """
    taxels = taxels_of(calibration)
    refuse_labels((taxels.link,), "the link name")
    refuse_labels(taxels.ids, "the id")
    channels = taxels.channels.tolist()
    comments = [f"{LINK}{taxels.link}", *(f"{MARK}{channel} {name}" for channel, name in zip(channels, taxels.ids))]
    vectors = np.column_stack((taxels.positions, taxels.normals)).tolist()
    names = SIGMA if np.isfinite(taxels.sigma).any() else ()
    sigma = taxels.sigma[:, : len(names)].tolist()
    rows = [" ".join(map(repr, (*row, channel, *rest))) for row, channel, rest in zip(vectors, channels, sigma)]
    return comments, rows, names


def _rows_of(text: str, first: int, count: int, only_points: bool) -> list[tuple[int, str]]:
    """Return the first lines that are not empty, with their line numbers."""
    rows = [(number, content) for number, content in enumerate(text.split("\n"), first) if content.strip()]
    if len(rows) < count:
        raise FoundError("size", "", f"is truncated: the header announces {count} points, {len(rows)} were found")
    if only_points and len(rows) > count:
        message = f"is after the last point: the header announces {count} points, {len(rows)} were found"
        raise FoundError("size", line(rows[count][0]), message)
    return rows[:count]


def lines_of(data: bytes) -> str:
    """Decode text, with line feeds as the only line ends."""
    try:
        return decoded(data).replace("\r\n", "\n").replace("\r", "\n")
    except DecodingError as problem:
        raise FoundError("encoding", "", f"contains text that {problem}") from problem


def count_of(word: str, number: int) -> int:
    """Return the number of points that a header announces."""
    if not word.isdecimal() or len(word) > 9 or int(word) > MAX_TAXELS:
        raise FoundError("size", line(number), f"announces {show(word)} points; the limit is {MAX_TAXELS}")
    return int(word)
