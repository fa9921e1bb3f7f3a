"""What PLY and PCD have in common: points with named numbers, as text or as bytes."""

from collections.abc import Iterable, Sequence

import numpy as np

from ...common.findings import error, show
from ...common.plain_text import DecodingError, decoded
from ...common.text import MAX_TAXELS, NumberError, real, shown
from ..model import MAX_CHANNEL, LinkCalibration
from .link_taxels import refuse_labels, taxels_of
from .table import NORMAL, POSITION
from .taxel_set import Draft, line

CHANNEL = "channel"
MARK, LINK = "taxel ", "link "  # begin comments: channel and id of a taxel, name of the link


class CloudError(ValueError):
    """A file cannot be used; ``finding`` says why."""

    def __init__(self, code: str, place: str, message: str):
        super().__init__(message)
        self.finding = error(code, place, message)


def parse_comments(draft: Draft, comments: Iterable[str]) -> dict[int, str]:
    """The label of each channel that comments tell; the link goes into the draft."""
    labels = {}
    for comment in comments:
        if comment.startswith(LINK):
            draft.frame = comment.removeprefix(LINK)
        elif comment.startswith(MARK):
            channel, _, label = comment.removeprefix(MARK).partition(" ")
            if channel.isdecimal() and len(channel) < 12:
                labels[int(channel)] = label
    return labels


def parse_text(names: Sequence[str], rows: Sequence[tuple[int, str]]) -> dict[str, list[float]]:
    """The columns of rows of text, each with its number in the file."""
    places = {name: names.index(name) for name in _wanted(names)}
    columns: dict[str, list[float]] = {name: [] for name in places}
    for number, content in rows:
        words = content.split(None, len(names))
        if len(words) != len(names):
            have = f"more than {len(names)}" if len(words) > len(names) else str(len(words))
            raise CloudError("row", line(number), f"has {have} numbers; the header names {len(names)}")
        try:
            for name, place in places.items():
                columns[name].append(real(words[place]))
        except NumberError as problem:
            raise CloudError(problem.code, line(number), str(problem)) from problem
    return columns


def parse_bytes(names: Sequence[str], types: Sequence[str], data: bytes, count: int) -> dict[str, list[float]]:
    """The columns of ``count`` points in bytes; ``types`` are NumPy's, in the order of the names."""
    kind = np.dtype([(f"{i}", type_) for i, type_ in enumerate(types)])
    if len(data) < kind.itemsize * count:
        raise CloudError("size", "", f"holds {len(data) // kind.itemsize} of its {count} points; it is cut off")
    table = np.frombuffer(data, kind, count)
    columns = {name: table[str(names.index(name))].astype(float) for name in _wanted(names)}
    for column in columns.values():
        lost = np.flatnonzero(~np.isfinite(column))
        if len(lost):
            raise CloudError(
                "not-finite", point(int(lost[0])), "has a coordinate that is no finite number; remove the point"
            )
    return {name: column.tolist() for name, column in columns.items()}


def point(index: int) -> str:
    """A place in a file of bytes, for a finding; points count from zero."""
    return f"point {index}"


def _wanted(names: Sequence[str]) -> list[str]:
    """The names that mean something here; the first of those alike."""
    found = [next((name for name in alike if name in names), None) for alike in (*POSITION, *NORMAL)]
    for name, alike in zip(found[:3], POSITION):
        if name is None:
            raise CloudError("missing-column", "", f"names no {show(alike[0])} among {show(' '.join(names))}")
    normal = found[3:] if None not in found[3:] else []
    return [name for name in (*found[:3], *normal, CHANNEL if CHANNEL in names else None) if name is not None]


def fill_draft(draft: Draft, columns: dict[str, list[float]], labels: dict[int, str]) -> None:
    """Put the columns into the draft; without a channel a point's place is it, and without a label its channel."""
    values = list(columns.values())
    count = len(values[0])
    draft.positions = list(zip(*values[:3]))
    draft.normals = list(zip(*values[3:6])) if len(values) >= 6 else None
    numbers = columns.get(CHANNEL, range(count))
    for place, number in enumerate(numbers):
        if number != int(number) or not 0 <= number <= MAX_CHANNEL:
            raise CloudError(
                "channel", draft.at(draft.lines[place]), f"has the channel {number!r}; use 0 to {MAX_CHANNEL}"
            )
    draft.channels = [int(number) for number in numbers]
    draft.labels = [labels.get(channel, str(channel)) for channel in draft.channels]
    if not draft.labels:
        draft.findings.append(error("no-taxels", "", "holds no point; check that it is the right file"))


def cloud_of(calibration: LinkCalibration) -> tuple[list[str], list[str]]:
    """The comments that name the taxels, and a line of text for each: position, normal, channel."""
    taxels = taxels_of(calibration)
    refuse_labels((taxels.link,), "the link name")
    refuse_labels(taxels.ids, "the id")
    channels = taxels.channels.tolist()
    comments = [f"{LINK}{taxels.link}", *(f"{MARK}{channel} {name}" for channel, name in zip(channels, taxels.ids))]
    vectors = np.column_stack((taxels.positions, taxels.normals)).tolist()
    rows = [f"{' '.join(map(repr, numbers))} {channel}" for numbers, channel in zip(vectors, channels)]
    return comments, rows


def rows_of(text: str, first: int, count: int) -> list[tuple[int, str]]:
    """The first lines that are not empty, numbered from ``first``.

    Raises
    ------
    CloudError
        If there are less than ``count``.
    """
    rows = [(number, content) for number, content in enumerate(text.split("\n"), first) if content.strip()]
    if len(rows) < count:
        raise CloudError("size", "", f"holds {len(rows)} of its {count} points; it is cut off")
    return rows[:count]


def lines_of(data: bytes) -> str:
    """Text with one kind of line ends."""
    try:
        return decoded(data).replace("\r\n", "\n").replace("\r", "\n")
    except DecodingError as problem:
        raise CloudError("encoding", "", f"has text that {problem}") from problem


def count_of(word: str, number: int) -> int:
    """How many points a header promises."""
    if not word.isdecimal() or len(word) > 9 or int(word) > MAX_TAXELS:
        raise CloudError("size", line(number), f"promises {shown(word)} points; at most {MAX_TAXELS} are read")
    return int(word)
