"""Read measurements of sensors (readings and the applied forces) from a CSV file."""

import os
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from ..common.arrays import Array, freeze
from ..common.findings import did_you_mean, show
from ..common.tables import TableError, find_column, names_without, naming_file, number_in, read_named_rows
from ..common.text import read_text
from .model import LinkCalibration

# [reading, N] least nonzero readings and forces that are accepted. Smaller: their products may become zero in the fit.
MIN_MAGNITUDE = 1e-100
# [reading, N] largest readings and forces that are accepted. Larger: their powers may overflow in the fit.
MAX_MAGNITUDE = 1e12


@dataclass(frozen=True, eq=False)
class Measurements:
    """Readings and forces of one taxel, or of all taxels together, in the order of the file."""

    taxel: str | None  # id; None for all taxels
    readings: Array  # (n,)
    forces: Array  # (n,) [N]
    unused: tuple[str, ...] = ()  # columns of the table that are not used

    def __post_init__(self):
        freeze(self, readings=(len(self.forces),), forces=(len(self.forces),))


@dataclass(frozen=True)
class TaxelColumn:
    """The column of a table that names a taxel, by its id or by its channel."""

    name: str
    place: int
    ids: dict[str, str]  # of the taxels, by what the column contains

    @classmethod
    def of(cls, header: list[str], line: int, calibration: LinkCalibration) -> "TaxelColumn":
        """Return the column ``taxel``, or else the column ``channel``."""
        name = "channel" if "channel" in header and "taxel" not in header else "taxel"
        pairs = [pair for p in calibration.patches for pair in zip(p.taxels.ids, p.taxels.channels.tolist())]
        ids = {str(channel) if name == "channel" else taxel: taxel for taxel, channel in pairs}
        return cls(name, find_column(header, name, line), ids)

    def taxel(self, row: list[str], line: int) -> str:
        """Return the id of the taxel of a row."""
        cell = row[self.place]
        if cell in self.ids:
            return self.ids[cell]
        hint = did_you_mean(cell, self.ids) if self.name == "taxel" else ""
        if self.name == "channel" and self.ids:
            first, last = (str(end(map(int, self.ids))) for end in (min, max))
            hint = f"; its channels are {first} to {last}"
        raise TableError(line, f"the calibration has no {self.name} {show(cell)}{hint}", self.place + 1)


def read_measurements(
    path: str | os.PathLike[str], calibration: LinkCalibration, quantity: str = "force"
) -> tuple[Measurements, ...]:
    """Read a table with columns ``reading`` and ``force`` [N], and optionally ``taxel`` or ``channel``.

    The names may have any order and case. The separator is a comma, a semicolon or a tab.
    """
    rows: list[tuple[str | None, float, float]] = []
    with naming_file(path):
        table = read_named_rows(read_text(path))
        line, header = next(table, (1, [""]))
        columns = [find_column(header, name, line) for name in ("reading", quantity)]
        owner = TaxelColumn.of(header, line, calibration) if {"taxel", "channel"} & set(header) else None
        unused = names_without(header, columns if owner is None else [*columns, owner.place])
        for line, row in table:
            taxel = None if owner is None else owner.taxel(row, line)
            reading, force = (_number(row, column, line) for column in columns)
            rows.append((taxel, reading, force))
        if not rows:
            raise TableError(line, "the table has no row below its header", 1)
    order = {taxel: k for k, taxel in enumerate(dict.fromkeys(row[0] for row in rows))}
    parts = groupby(sorted(rows, key=lambda row: order[row[0]]), key=lambda row: row[0])
    measured = ((taxel, np.array([row[1:] for row in part]).T) for taxel, part in parts)
    return tuple(Measurements(taxel, readings, forces, unused) for taxel, (readings, forces) in measured)


def _number(row: list[str], column: int, line: int) -> float:
    number = number_in(row, column, line)
    if number != 0 and not MIN_MAGNITUDE <= abs(number) <= MAX_MAGNITUDE:
        raise TableError(
            line,
            f"the number {number:g} is not plausible; absolute values are 0 or {MIN_MAGNITUDE:g} to {MAX_MAGNITUDE:g}",
            column + 1,
        )
    return number
