"""Touches at known positions, from a CSV file: the strongest taxel, and the position of the probe."""

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..calibration.measurements import TaxelColumn
from ..calibration.model import LinkCalibration
from ..common.arrays import Array, IntArray, freeze, unit
from ..common.tables import TableError, find_column, names_without, naming_file, number_in, read_named_rows
from ..common.text import read_text

POINT = ("x", "y", "z")
WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")
# Largest coordinate of a point [m]. A larger one is in millimetres.
MAX_COORDINATE = 10.0
# Smallest force with a reliable line of action [N]. Larger: refuses more touches.
MIN_FORCE = 0.1


@dataclass(frozen=True, eq=False)
class Touches:
    """Positions of touches, in the link frame; row i of every field is the same touch.

    A touch is a point, or the line of action of a wrench. Only a line has a direction.
    """

    taxels: tuple[str, ...]  # ids of the taxels with the largest reading
    lines: IntArray  # (n,) lines of the file
    points: Array  # (n, 3) tip of the probe, or a point of the line [m]
    directions: Array  # (n, 3) unit direction of the line; zero for a point
    unused: tuple[str, ...] = ()  # columns of the file that are not used

    def __post_init__(self):
        n = len(self.taxels)
        freeze(self, lines=(n,), points=(n, 3), directions=(n, 3))


def read_touches(path: str | os.PathLike[str], calibration: LinkCalibration) -> Touches:
    """Read a table of touches.

    The header has ``taxel`` or ``channel``, and one of two sets of columns:

    - ``x``, ``y``, ``z``: the tip of the probe in the link frame [m];
    - ``fx``, ``fy``, ``fz``, ``tx``, ``ty``, ``tz``: the wrench about the origin of the link, measured by a
      force-torque sensor [N, N m].

    The order and the case of the names are free.
    """
    names: list[str] = []
    lines: list[int] = []
    points_and_directions: list[tuple[Array, Array]] = []
    with naming_file(path):
        table = read_named_rows(read_text(path))
        line, header = next(table, (1, [""]))
        owner, columns = TaxelColumn.of(header, line, calibration), _columns(header, line)
        unused = names_without(header, [*columns, owner.place])
        for line, row in table:
            names.append(owner.taxel(row, line))
            lines.append(line)
            points_and_directions.append(_place(row, columns, line))
        if not names:
            raise TableError(line, "the table has no row below its header", 1)
    points, directions = (np.array(part) for part in zip(*points_and_directions))
    return Touches(tuple(names), np.array(lines), points, directions, unused)


def _columns(header: Sequence[str], line: int) -> list[int]:
    """Return the columns of the three coordinates, or of the six components of a wrench."""
    wanted = WRENCH if "fx" in header and "x" not in header else POINT
    return [find_column(list(header), name, line) for name in wanted]


def _place(row: list[str], columns: list[int], line: int) -> tuple[Array, Array]:
    """Return point and direction of one touch.

    The line of action of a wrench (f, t) goes through the point (f x t) / |f|^2. These are equations 6 to 9 of the
    paper, without their division of zero by zero.
    """
    numbers = np.array([number_in(row, column, line) for column in columns])
    if len(columns) == len(POINT):
        far = int(np.abs(numbers).argmax())
        if abs(numbers[far]) > MAX_COORDINATE:
            message = (
                f"the coordinate {numbers[far]:g} m is more than {MAX_COORDINATE:g} m from the origin of the link. "
                "Coordinates are in metres; divide millimetres by 1000"
            )
            raise TableError(line, message, columns[far] + 1)
        return numbers, np.zeros(3)
    force, moment = numbers[:3], numbers[3:]
    strength = float(np.linalg.norm(force))
    if not MIN_FORCE <= strength < np.inf:
        message = (
            f"the force of {strength:.3g} N gives no reliable line of action, which needs {MIN_FORCE:g} N or more. "
            "Remove this touch"
        )
        raise TableError(line, message, columns[0] + 1)
    return np.cross(force / strength, moment / strength), unit(force)
