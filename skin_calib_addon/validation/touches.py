"""Touches of a known place: the taxel that felt each most, and where the probe was, from a CSV file."""

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..calibration.model import LinkCalibration
from ..common.arrays import Array, IntArray, freeze, unit
from ..common.findings import did_you_mean, show
from ..common.tables import CellError, find_column, naming_file, number_in, read_named_rows
from ..common.text import read_text

POINT = ("x", "y", "z")
WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")
MAX_COORDINATE = 10.0  # of a point from the link's origin [m]: what is further is in millimetres
MIN_FORCE = 0.1  # force whose line of action a sensor still tells [N]


@dataclass(frozen=True, eq=False)
class Touches:
    """Places that were touched, in the link frame; row i of every field is the same touch.

    A place is a point, or a line along which something pressed: then its ``way`` is not zero.
    """

    taxels: tuple[str, ...]  # ids of those that felt most
    lines: IntArray  # (n,) of the file
    points: Array  # (n, 3) where the probe's tip was, or a point of the line [m]
    directions: Array  # (n, 3) along the line, unit; zero for a point

    def __post_init__(self):
        n = len(self.taxels)
        freeze(self, lines=(n,), points=(n, 3), directions=(n, 3))


def read_touches(path: str | os.PathLike[str], calibration: LinkCalibration) -> Touches:
    """Read a table of touches.

    Its header names ``taxel`` or ``channel``, and either ``x``, ``y``, ``z``: the tip of the probe in the link frame
    [m]; or ``fx``, ``fy``, ``fz``, ``tx``, ``ty``, ``tz``: the wrench about the link's origin that a force-torque
    sensor measured [N, N m], whose line of action goes through the place. Names may stand in any order and case, other
    columns are left alone.

    Parameters
    ----------
    path : path
    calibration : LinkCalibration
        Whose taxels a row may name.

    Raises
    ------
    CalibrationFormatError
        Names file, line and column of the first thing that is wrong.
    """
    ids = [name for patch in calibration.patches for name in patch.taxels.ids]
    by_channel = {
        str(channel): name
        for patch in calibration.patches
        for name, channel in zip(patch.taxels.ids, patch.taxels.channels.tolist())
    }
    names: list[str] = []
    lines: list[int] = []
    points_and_directions: list[tuple[Array, Array]] = []
    with naming_file(path):
        table = read_named_rows(read_text(path))
        line, header = next(table, (1, [""]))
        who = "channel" if "channel" in header and "taxel" not in header else "taxel"
        known = by_channel if who == "channel" else dict(zip(ids, ids))
        owner, columns = find_column(header, who, line), _columns(header, line)
        for line, row in table:
            if row[owner] not in known:
                hint = did_you_mean(row[owner], known) if who == "taxel" else ""
                raise CellError(line, owner + 1, f"names no {who} of the calibration: {show(row[owner])}{hint}")
            names.append(known[row[owner]])
            lines.append(line)
            points_and_directions.append(_place(row, columns, line))
        if not names:
            raise CellError(line, 1, "has no touch below it")
    points, directions = (np.array(part) for part in zip(*points_and_directions))
    return Touches(tuple(names), np.array(lines), points, directions)


def _columns(header: Sequence[str], line: int) -> list[int]:
    """Where the three coordinates stand, or the six components of a wrench."""
    wanted = WRENCH if "fx" in header and "x" not in header else POINT
    return [find_column(list(header), name, line) for name in wanted]


def _place(row: list[str], columns: list[int], line: int) -> tuple[Array, Array]:
    """Point and way of one touch."""
    numbers = np.array([number_in(row, column, line) for column in columns])
    if len(columns) == len(POINT):
        far = int(np.abs(numbers).argmax())
        if abs(numbers[far]) > MAX_COORDINATE:
            message = (
                f"has {numbers[far]:g} m, more than {MAX_COORDINATE:g} m from the link's origin. Coordinates are in "
                "metres; divide millimetres by 1000"
            )
            raise CellError(line, columns[far] + 1, message)
        return numbers, np.zeros(3)
    force, moment = numbers[:3], numbers[3:]
    strength = float(np.linalg.norm(force))
    if not MIN_FORCE <= strength < np.inf:
        message = (
            f"has a force of {strength:.3g} N, too small for a reliable line of action. Remove touches below "
            f"{MIN_FORCE:g} N"
        )
        raise CellError(line, columns[0] + 1, message)
    return np.cross(force / strength, moment / strength), unit(force)  # the paper's (6) to (9) without its 0/0
