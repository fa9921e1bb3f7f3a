"""Tables with named columns in CSV files; what is wrong is told with its line and column."""

import csv
import os
from collections.abc import Iterator
from contextlib import contextmanager

from .errors import CalibrationFormatError
from .findings import did_you_mean, show
from .text import NumberError, real

SEPARATORS = ",;\t"


class TableError(ValueError):
    """A text is no table from ``line`` on."""

    def __init__(self, line: int, message: str):
        super().__init__(message)
        self.line = line


def read_rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Rows with the number of their line, comments and empty lines left out; the header tells what separates columns.

    Raises
    ------
    TableError
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
        raise TableError(last + 1, f"begins what is no table: {problem}") from problem


class CellError(ValueError):
    """What is wrong at a place of a table."""

    def __init__(self, line: int, column: int, message: str):
        super().__init__(message)
        self.line, self.column = line, column


@contextmanager
def naming_file(path: str | os.PathLike[str]) -> Iterator[None]:
    """Name the file in which a cell is wrong, or that is no table, as a CalibrationFormatError."""
    try:
        yield
    except CellError as problem:
        raise CalibrationFormatError(f"'{path}', line {problem.line}, column {problem.column}: {problem}") from problem
    except TableError as problem:
        raise CalibrationFormatError(f"'{path}', line {problem.line}: {problem}") from problem


def read_named_rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Line and cells of the header, in lower case, and of each row below it.

    Raises
    ------
    CellError
        If a row has not as many cells as the header.
    TableError
        As :func:`read_rows` does.
    """
    width = None
    for line, row in read_rows(text):
        cells = [cell.strip() for cell in row]
        if width is None:
            cells, width = [cell.lower() for cell in cells], len(cells)
        elif len(cells) != width:
            column = min(len(cells), width) + 1
            raise CellError(line, column, f"has {len(cells)} columns, the header {width}")
        yield line, cells


def find_column(header: list[str], name: str, line: int) -> int:
    """Where a column stands.

    Raises
    ------
    CellError
        If there is none of that name, or two.
    """
    if name not in header:
        raise CellError(line, len(header) + 1, f"the header names no column {show(name)}{did_you_mean(name, header)}")
    place = header.index(name)
    if name in header[place + 1 :]:
        raise CellError(line, header.index(name, place + 1) + 1, f"the header names the column {show(name)} twice")
    return place


def number_in(row: list[str], column: int, line: int) -> float:
    """The number in a cell.

    Raises
    ------
    CellError
        If it is none, or not finite.
    """
    try:
        return real(row[column]) + 0.0  # no minus zero
    except NumberError as problem:
        raise CellError(line, column + 1, str(problem)) from problem
