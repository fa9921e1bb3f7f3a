"""Positions of iCub skin parts: ``app/skinGui/conf/positions/*.txt``, metres in the frame of a link."""

import re
from collections.abc import Iterator

import numpy as np

from ...common.errors import CalibrationFormatError
from ...common.findings import Finding, error, first, show, warning
from ...common.text import MAX_TAXELS, NumberError, real, shown, whole
from ..model import LinkCalibration
from .link_taxels import taxels_of
from .taxel_set import Draft, line

BLOCK = "[calibration]"
TABLE = "taxel2Repr"
UNUSED, THERMAL_PAD = -1, -2  # in the table
Lines = list[tuple[int, str]]  # numbered
_WORD = re.compile(r"""[^\s#()\[\]{}"'\\]+""")  # what YARP takes for one word


def read_icub(text: str) -> Draft:
    """Rows ``x y z nx ny nz`` of the block; the channel of a row is its index among all rows, those of zeros included.

    The table ``taxel2Repr`` is only held against the rows: in files that are in use it is too short or too long, and
    upstream takes every row that is not zero for a taxel.
    """
    draft = Draft(normals=[])
    header, rows = _sections(text)
    words = dict(content.split(None, 1) for _, content in header if len(content.split(None, 1)) == 2)
    draft.frame = words.get("frame", words.get("name"))
    if not rows:
        draft.findings.append(error("no-taxels", "", f"has no row below {BLOCK}; check that it is the right file"))
    draft.findings += first(_take(draft, rows))
    for number, content in header:
        if not draft.broken and content.startswith(TABLE):
            draft.findings += _compare_table(draft, number, content)
    return draft


def _sections(text: str) -> tuple[Lines, Lines]:
    """The lines before the block, and those within it; comments and empty lines are left out."""
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


def _take(draft: Draft, rows: Lines) -> Iterator[Finding]:
    """Put the rows into the draft; what is wrong with one."""
    if len(rows) > MAX_TAXELS:
        yield error("size", line(rows[MAX_TAXELS][0]), f"is one row too many; at most {MAX_TAXELS} are read")
        return
    assert draft.normals is not None
    for index, (number, content) in enumerate(rows):
        words = content.split(None, 6)
        if len(words) != 6:
            have = "more than 6" if len(words) > 6 else len(words)
            yield error("row", line(number), f"has {have} numbers; a row of {BLOCK} is x y z nx ny nz", content)
            continue
        try:
            numbers = tuple(real(word) for word in words)
        except NumberError as problem:
            yield error(problem.code, line(number), str(problem), content)
            continue
        draft.lines.append(number)
        draft.labels.append(str(index))
        draft.channels.append(index)
        draft.positions.append(numbers[:3])
        draft.normals.append(numbers[3:])


def _compare_table(draft: Draft, number: int, content: str) -> Iterator[Finding]:
    """What the table says otherwise than the rows."""
    words = content.removeprefix(TABLE).replace("(", " ").replace(")", " ").split(None, MAX_TAXELS)
    if len(words) > MAX_TAXELS:
        yield error("size", line(number), f"has more than {MAX_TAXELS} entries in {TABLE}")
        return
    try:
        table = np.array([whole(word) for word in words], np.int64)
    except NumberError as problem:
        yield error(problem.code, line(number), f"{problem} in {TABLE}", shown(content))
        return
    rows = len(draft.positions)
    taxel = np.array(draft.positions).any(axis=1) | np.array(draft.normals).any(axis=1)
    if len(table) != rows:
        bare = int(np.count_nonzero(taxel[len(table) :]))
        message = f"has {len(table)} entries in {TABLE} for {rows} rows"
        message += f"; {bare} taxels have none, and are taken as well" if bare else ""
        yield warning("table-length", line(number), message, [len(table), rows])
    table, taxel = table[:rows], taxel[: len(table)]
    for code, mark, what in (("thermal-pad", THERMAL_PAD, "thermal pads"), ("unused", UNUSED, "unused")):
        marked = table == mark
        if marked.any():
            count, kept = int(np.count_nonzero(marked)), np.flatnonzero(marked & taxel)
            message = f"marks {count} rows as {what} ({mark})"
            if len(kept):
                message += f"; {len(kept)} have a position and are kept, the first on {line(draft.lines[kept[0]])}"
            yield warning(code, line(number), message, count)
    lost = np.flatnonzero(~taxel & (table >= 0))
    if len(lost):
        message = f"marks {len(lost)} rows as taxels that have no position, the first on {line(draft.lines[lost[0]])}"
        yield warning("no-position", line(number), message, len(lost))


def write_icub(calibration: LinkCalibration) -> bytes:
    """A row for each channel, zeros where it has no taxel; each taxel stands for itself.

    The reader of the skin drops the last row, so that one of zeros follows the taxels, and it looks up every row in the
    table, so that the table has an entry for that one too.

    Raises
    ------
    CalibrationFormatError
        If the link's name is more than one plain word, or channels run too high for a row each.
    """
    taxels = taxels_of(calibration)
    if not _WORD.fullmatch(taxels.link):
        raise CalibrationFormatError(
            f"the link name {show(taxels.link)} cannot be written: positions files take one word without quotes, "
            "brackets or '#'; rename the link"
        )
    count = int(taxels.channels[-1]) + 1
    if count >= MAX_TAXELS:
        raise CalibrationFormatError(
            f"channel {count - 1} needs {count} rows in a positions file, which has one for each channel; at most "
            f"{MAX_TAXELS - 1} are written. Use lower channels."
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
