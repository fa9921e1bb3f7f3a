"""Read and write positions of iCub skin (``app/skinGui/conf/positions/*.txt``) in metres, in a link frame."""

import re
from collections.abc import Iterator

import numpy as np

from ...common.errors import CalibrationFormatError
from ...common.findings import Finding, error, first, show, warning
from ...common.text import MAX_TAXELS, NumberError, real, whole
from ..model import LinkCalibration
from .link_taxels import taxels_of
from .taxel_set import Draft, line

BLOCK = "[calibration]"
TABLE = "taxel2Repr"
# Format: entries of the table for rows without taxel
UNUSED = -1
BOARD_ROWS = 12  # format: rows of one board, a rigid triangle with ten taxels and two thermal pads
THERMAL_PAD = -2  # Format: entries of the table for rows with a sensor of temperature
Lines = list[tuple[int, str]]  # numbered
_WORD = re.compile(r"""[^\s#()\[\]{}"'\\]+""")  # a word without quotes in YARP


def read_icub(text: str) -> Draft:
    """Read the rows ``x y z nx ny nz`` of the block; the channel of a row is its index, rows of zeros included.

    Twelve rows are one rigid board.

    The table ``taxel2Repr`` is only compared with the rows. In published files it is too short or too long, and the
    iCub software uses each row that is not zero as a taxel.
    """
    draft = Draft(normals=[])
    header, rows = _sections(text)
    words = dict(content.split(None, 1) for _, content in header if len(content.split(None, 1)) == 2)
    draft.frame = words.get("frame", words.get("name"))
    if not rows:
        draft.findings.append(error("no-taxels", "", f"has no row below {BLOCK}; check that it is the correct file"))
    draft.findings += first(_read_rows(draft, rows))
    for number, content in header:
        if not draft.broken and content.startswith(TABLE):
            draft.findings += _compare_table(draft, number, content)
    return draft


def _sections(text: str) -> tuple[Lines, Lines]:
    """Return the lines before the block and in it, without comments and empty lines."""
    header: Lines = []
    rows: Lines = []
    section = None
    for number, whole_line in enumerate(text.split("\n"), 1):
        content = whole_line.partition("#")[0].strip()
        if content.startswith("["):
            section = content
        elif content and section in (None, BLOCK):
            (header if section is None else rows).append((number, content))
    return header, rows


def _read_rows(draft: Draft, rows: Lines) -> Iterator[Finding]:
    """Copy the rows into the draft, and yield errors."""
    if len(rows) > MAX_TAXELS:
        yield error("size", line(rows[MAX_TAXELS][0]), f"exceeds the limit of {MAX_TAXELS} rows")
        return
    for index, (number, content) in enumerate(rows):
        words = content.split(None, 6)
        if len(words) != 6:
            have = "more than 6" if len(words) > 6 else len(words)
            yield error("row", line(number), f"has {have} numbers; a row of {BLOCK} has x y z nx ny nz", content)
            continue
        try:
            numbers = tuple(real(word) for word in words)
        except NumberError as problem:
            yield error(problem.code, line(number), str(problem), content)
            continue
        draft.add(number, str(index), index, numbers[:3], numbers[3:])
        draft.boards.append(index // BOARD_ROWS)


def _compare_table(draft: Draft, number: int, content: str) -> Iterator[Finding]:
    """Yield the differences between the table and the rows."""
    words = content.removeprefix(TABLE).replace("(", " ").replace(")", " ").split(None, MAX_TAXELS)
    if len(words) > MAX_TAXELS:
        yield error("size", line(number), f"has more than {MAX_TAXELS} entries in {TABLE}, which is the limit")
        return
    try:
        table = np.array([whole(word) for word in words], np.int64)
    except NumberError as problem:
        yield error(problem.code, line(number), f"{problem} in {TABLE}", show(content))
        return
    rows = len(draft.positions)
    taxel = np.array(draft.positions).any(axis=1) | np.array(draft.normals).any(axis=1)
    if len(table) != rows:
        without = int(np.count_nonzero(taxel[len(table) :]))
        message = f"has {len(table)} entries in {TABLE} for {rows} rows"
        message += f"; {without} taxels without entry are used, too" if without else ""
        yield warning("table-length", line(number), message, [len(table), rows])
    table, taxel = table[:rows], taxel[: len(table)]
    for code, mark, what in (("thermal-pad", THERMAL_PAD, "thermal pads"), ("unused", UNUSED, "unused")):
        marked = table == mark
        if marked.any():
            count, kept = int(np.count_nonzero(marked)), np.flatnonzero(marked & taxel)
            message = f"marks {count} rows as {what} ({mark})"
            if len(kept):
                message += (
                    f"; {len(kept)} of them have a position and are used, the first in {line(draft.lines[kept[0]])}"
                )
            yield warning(code, line(number), message, count)
    missing = np.flatnonzero(~taxel & (table >= 0))
    if len(missing):
        first_line = line(draft.lines[missing[0]])
        message = f"marks {len(missing)} rows without position as taxels, the first in {first_line}"
        yield warning("no-position", line(number), message, len(missing))


def write_icub(calibration: LinkCalibration) -> bytes:
    """Write one row for each channel, with zeros for channels without taxel.

    The iCub software ignores the last row, and needs an entry in the table for each row. A row of zeros with an
    entry therefore follows the taxels.
    """
    taxels = taxels_of(calibration)
    if not _WORD.fullmatch(taxels.link):
        raise CalibrationFormatError(
            f"the link name {show(taxels.link)} cannot be written: it must be one word without quotes, brackets "
            "or '#'. Rename the link."
        )
    count = int(taxels.channels[-1]) + 1
    if count >= MAX_TAXELS:
        raise CalibrationFormatError(
            f"channel {count - 1} needs {count} rows in a positions file, one for each channel. The limit is "
            f"{MAX_TAXELS - 1} rows. Use lower channels."
        )
    rows = np.zeros((count + 1, 6))
    rows[taxels.channels] = np.column_stack((taxels.positions, taxels.normals))
    table = np.full(count + 1, UNUSED)
    table[taxels.channels] = taxels.channels
    lines = [
        f"name\t{taxels.link}",
        "spatial_sampling\ttaxel",
        f"{TABLE} ( {' '.join(map(str, table.tolist()))} )",
        BLOCK,
        *(" ".join(map(repr, row)) for row in rows.tolist()),
    ]
    return ("\n".join(lines) + "\n").encode()
