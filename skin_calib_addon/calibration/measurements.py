"""Measurements of sensors: readings beside the forces that gave them, from a CSV file."""

import csv
import os
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from ..arrays import Array, freeze
from ..errors import CalibrationFormatError
from .exchange.table import SEPARATORS
from .exchange.text import BadNumber, read_text, real
from .findings import did_you_mean, show

LEAST, LARGEST = 1e-100, 1e12  # of numbers that are not zero


@dataclass(frozen=True, eq=False)
class Measurements:
    """Readings and forces of one taxel, or of all alike, in the order in which they were taken."""

    taxel: str | None
    readings: Array  # (n,)
    forces: Array  # (n,) [N]

    def __post_init__(self):
        freeze(self, readings=(len(self.forces),), forces=(len(self.forces),))


def read_measurements(path: str | os.PathLike[str], taxels: Collection[str]) -> tuple[Measurements, ...]:
    """Read a table whose header names ``reading`` and ``force``, and ``taxel`` where each taxel has its own.

    Names may stand in any order and case, other columns are left alone; commas, semicolons or tabs separate columns.

    Parameters
    ----------
    path : path
    taxels : collection of str
        The ids that a row may name.

    Returns
    -------
    tuple of Measurements
        One, or one for each taxel in the order of their first rows.

    Raises
    ------
    CalibrationFormatError
        Names file, line and column of the first thing that is wrong.
    """
    rows: list[tuple[str | None, float, float]] = []
    table = _rows(read_text(path))
    try:
        number, header = next(table, (1, [""]))
        header = [name.strip().lower() for name in header]
        columns = [_place(header, name, number) for name in ("reading", "force")]
        owner = _place(header, "taxel", number) if "taxel" in header else None
        for number, row in table:
            if len(row) != len(header):
                column = min(len(row), len(header)) + 1
                raise _Wrong(number, column, f"has {len(row)} columns, the header {len(header)}")
            taxel = None if owner is None else row[owner].strip()
            if owner is not None and taxel not in taxels:
                message = f"names no taxel of the calibration: {show(taxel)}{did_you_mean(str(taxel), taxels)}"
                raise _Wrong(number, owner + 1, message)
            reading, force = (_number(row, column, number) for column in columns)
            rows.append((taxel, reading, force))
        if not rows:
            raise _Wrong(number, 1, "has no measurement below it")
    except _Wrong as problem:
        raise CalibrationFormatError(f"'{path}', line {problem.line}, column {problem.column}: {problem}") from problem
    order = {taxel: k for k, taxel in enumerate(dict.fromkeys(row[0] for row in rows))}
    parts = groupby(sorted(rows, key=lambda row: order[row[0]]), key=lambda row: row[0])
    return tuple(Measurements(taxel, *np.array([row[1:] for row in part]).T) for taxel, part in parts)


class _Wrong(ValueError):
    def __init__(self, line: int, column: int, message: str):
        super().__init__(message)
        self.line, self.column = line, column


def _rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Numbered rows, comments and empty lines left out; the header tells what separates columns."""
    lines = text.split("\n")
    head = next((content for content in lines if content.strip() and not content.startswith("#")), "")
    reader = csv.reader(lines, delimiter=max(SEPARATORS, key=head.count), strict=True)
    try:
        for row in reader:
            if any(cell.strip() for cell in row) and not row[0].startswith("#"):
                yield reader.line_num, row
    except csv.Error as problem:
        raise _Wrong(reader.line_num, 1, f"is no table: {problem}") from problem


def _place(header: list[str], name: str, line: int) -> int:
    if name not in header:
        raise _Wrong(line, len(header) + 1, f"the header names no column {show(name)}{did_you_mean(name, header)}")
    place = header.index(name)
    if name in header[place + 1 :]:
        raise _Wrong(line, header.index(name, place + 1) + 1, f"the header names the column {show(name)} twice")
    return place


def _number(row: list[str], column: int, line: int) -> float:
    try:
        number = real(row[column].strip()) + 0.0  # no minus zero
    except BadNumber as problem:
        raise _Wrong(line, column + 1, str(problem)) from problem
    if number != 0 and not LEAST <= abs(number) <= LARGEST:
        raise _Wrong(line, column + 1, f"has {number:g}, beyond all that sensors read or feel")
    return number
