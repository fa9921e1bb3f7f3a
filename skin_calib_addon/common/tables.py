"""Tables with named columns in CSV files; what is wrong is told with its line and column."""

import csv
import os
from collections.abc import Iterator
from contextlib import contextmanager

from .errors import CalibrationFormatError
from .findings import did_you_mean, show
from .text import BadNumber, real

SEPARATORS = ",;\t"


class BadTable(ValueError):
    """A text is no table from ``line`` on."""

    def __init__(self, line: int, message: str):
        super().__init__(message)
        self.line = line


def numbered_rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Rows with the number of their line, comments and empty lines left out; the header tells what separates columns.

    Raises
    ------
    BadTable
        If quotation marks are not closed, or are where they do not belong.
    """
    lines = text.split("\n")
    head = next((content for content in lines if content.strip() and not content.startswith("#")), "")
    reader, last = csv.reader(lines, delimiter=max(SEPARATORS, key=head.count), strict=True), 0
    try:
        for row in reader:
            last = reader.line_num
            if any(cell.strip() for cell in row) and not row[0].startswith("#"):
                yield last, row
    except csv.Error as problem:  # of the row that begins after the last one, wherever it was noticed
        raise BadTable(last + 1, f"begins what is no table: {problem}") from problem


class WrongCell(ValueError):
    """What is wrong at a place of a table."""

    def __init__(self, line: int, column: int, message: str):
        super().__init__(message)
        self.line, self.column = line, column


@contextmanager
def naming(path: str | os.PathLike[str]) -> Iterator[None]:
    """Name the file in which a cell is wrong, or that is no table, as a CalibrationFormatError."""
    try:
        yield
    except WrongCell as problem:
        raise CalibrationFormatError(f"'{path}', line {problem.line}, column {problem.column}: {problem}") from problem
    except BadTable as problem:
        raise CalibrationFormatError(f"'{path}', line {problem.line}: {problem}") from problem


def named_rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Line and cells of the header, in lower case, and of each row below it.

    Raises
    ------
    WrongCell
        If a row has not as many cells as the header.
    BadTable
        As :func:`numbered_rows` does.
    """
    width = None
    for line, row in numbered_rows(text):
        cells = [cell.strip() for cell in row]
        if width is None:
            cells, width = [cell.lower() for cell in cells], len(cells)
        elif len(cells) != width:
            column = min(len(cells), width) + 1
            raise WrongCell(line, column, f"has {len(cells)} columns, the header {width}")
        yield line, cells


def place_of(header: list[str], name: str, line: int) -> int:
    """Where a column stands.

    Raises
    ------
    WrongCell
        If there is none of that name, or two.
    """
    if name not in header:
        raise WrongCell(line, len(header) + 1, f"the header names no column {show(name)}{did_you_mean(name, header)}")
    place = header.index(name)
    if name in header[place + 1 :]:
        raise WrongCell(line, header.index(name, place + 1) + 1, f"the header names the column {show(name)} twice")
    return place


def number_in(row: list[str], column: int, line: int) -> float:
    """The number in a cell.

    Raises
    ------
    WrongCell
        If it is none, or not finite.
    """
    try:
        return real(row[column]) + 0.0  # no minus zero
    except BadNumber as problem:
        raise WrongCell(line, column + 1, str(problem)) from problem
