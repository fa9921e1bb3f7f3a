"""Read CSV tables with named columns; errors state line and column."""

import csv
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from .errors import CalibrationFormatError
from .findings import did_you_mean, show
from .text import NumberError, real

SEPARATORS = ",;\t"
MAX_HEAD = 2**20  # [bytes] in which a header ends. Larger: finds those after longer comments.


class TableError(ValueError):
    """Text is not a table from ``line`` on, or a cell of it is invalid."""

    def __init__(self, line: int, message: str, column: int = 0):
        super().__init__(message)
        self.line, self.place = line, f"line {line}, column {column}" if column else f"line {line}"


def read_rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield line number and cells of each row, without comments and empty lines.

    The separator is the one of `SEPARATORS` that is most frequent in the header.
    """
    lines = text.split("\n")
    head = next((content for content in lines if content.strip() and not content.startswith("#")), "")
    last, is_inside = 0, False  # of a row

    def without_comments() -> Iterator[str]:
        """Yield the lines; a quotation mark in a comment opens no cell."""
        nonlocal is_inside
        for content in lines:
            is_comment, is_inside = content.startswith("#") and not is_inside, True
            yield "" if is_comment else content

    reader = csv.reader(without_comments(), delimiter=max(SEPARATORS, key=head.count), strict=True)
    try:
        for row in reader:
            last, is_inside = reader.line_num, False
            if any(cell.strip() for cell in row) and not row[0].startswith("#"):
                yield last, row
    except csv.Error as problem:  # belongs to the row after the last one
        raise TableError(last + 1, f"is not a row of a table: {problem}") from problem


@contextmanager
def naming_file(path: str | os.PathLike[str]) -> Iterator[None]:
    """Convert table errors to a CalibrationFormatError that names the file."""
    try:
        yield
    except TableError as problem:
        raise CalibrationFormatError(f"'{path}', {problem.place}: {problem}") from problem


def read_named_rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield line number and cells of the header, in lower case, and of each row below."""
    width = None
    for line, row in read_rows(text):
        cells = [cell.strip() for cell in row]
        if width is None:
            cells, width = [cell.lower() for cell in cells], len(cells)
        elif len(cells) != width:
            column = min(len(cells), width) + 1
            raise TableError(line, f"the row has {len(cells)} columns, but the header has {width}", column)
        yield line, cells


def find_column(header: list[str], name: str, line: int) -> int:
    """Return the position of a column."""
    if name not in header:
        raise TableError(line, f"the header names no column {show(name)}{did_you_mean(name, header)}", len(header) + 1)
    place = header.index(name)
    if name in header[place + 1 :]:
        raise TableError(line, f"the header names the column {show(name)} twice", header.index(name, place + 1) + 1)
    return place


def names_without(header: list[str], columns: list[int]) -> tuple[str, ...]:
    """Return the names of all columns but some."""
    return tuple(name for k, name in enumerate(header) if name and k not in columns)


def number_in(row: list[str], column: int, line: int) -> float:
    """Return the number in a cell."""
    try:
        return real(row[column]) + 0.0  # no minus zero
    except NumberError as problem:
        raise TableError(line, str(problem), column + 1) from problem


def has_columns(path: str | os.PathLike[str], names: Iterable[str]) -> bool:
    """Return whether the header of a table has all these names, with or without units; False for other files."""
    try:
        with open(path, "rb") as file:
            head = file.read(MAX_HEAD).decode("utf-8", "replace")
        _, header = next(read_named_rows(head.replace("\r", "\n")), (1, [""]))
    except (OSError, TableError):  # whoever reads it says so
        return False
    return {name.split("[")[0].split("(")[0].strip() for name in header}.issuperset(names)
