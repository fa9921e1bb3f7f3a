"""Read measurements of sensors (readings and the applied forces) from a CSV file."""

import os
from collections.abc import Collection
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from ..common.arrays import Array, freeze
from ..common.findings import did_you_mean, show
from ..common.tables import TableError, find_column, naming_file, number_in, read_named_rows
from ..common.text import read_text

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

    def __post_init__(self):
        freeze(self, readings=(len(self.forces),), forces=(len(self.forces),))


def read_measurements(
    path: str | os.PathLike[str], taxels: Collection[str], quantity: str = "force"
) -> tuple[Measurements, ...]:
    """Read a table with columns ``reading`` and ``force`` [N], and optionally ``taxel``.

    The names may have any order and case. Other columns are ignored. The separator is a comma, a semicolon or a tab.
    """
    rows: list[tuple[str | None, float, float]] = []
    with naming_file(path):
        table = read_named_rows(read_text(path))
        line, header = next(table, (1, [""]))
        columns = [find_column(header, name, line) for name in ("reading", quantity)]
        owner = find_column(header, "taxel", line) if "taxel" in header else None
        for line, row in table:
            taxel = None if owner is None else row[owner]
            if owner is not None and taxel not in taxels:
                message = f"the calibration has no taxel {show(taxel)}{did_you_mean(str(taxel), taxels)}"
                raise TableError(line, message, owner + 1)
            reading, force = (_number(row, column, line) for column in columns)
            rows.append((taxel, reading, force))
        if not rows:
            raise TableError(line, "the table has no row below its header", 1)
    order = {taxel: k for k, taxel in enumerate(dict.fromkeys(row[0] for row in rows))}
    parts = groupby(sorted(rows, key=lambda row: order[row[0]]), key=lambda row: row[0])
    return tuple(Measurements(taxel, *np.array([row[1:] for row in part]).T) for taxel, part in parts)


def _number(row: list[str], column: int, line: int) -> float:
    number = number_in(row, column, line)
    if number != 0 and not MIN_MAGNITUDE <= abs(number) <= MAX_MAGNITUDE:
        raise TableError(
            line,
            f"the number {number:g} is not plausible; absolute values are 0 or {MIN_MAGNITUDE:g} to {MAX_MAGNITUDE:g}",
            column + 1,
        )
    return number
