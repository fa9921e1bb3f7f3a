"""Touches at known positions, from a table: the taxels that felt them, and the position of the probe or the wrench."""

import os
import re
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..calibration.measurements import TaxelColumn
from ..calibration.model import LinkCalibration
from ..common.arrays import Array, IntArray, freeze, unit
from ..common.errors import CalibrationFormatError, listed
from ..common.file_hash import file_hash
from ..common.findings import show
from ..common.tables import TableError, find_column, names_without, naming_file, number_in, read_named_rows
from ..common.text import read_text
from .presses import PLATEAU, Presses, Recorded, find_presses, places_of
from .tool import OF_LINK, OF_TOOL, ToolContacts, ToolPoses, ToolRows

POINT = ("x", "y", "z")
WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")
# Contract: units that the header can name in brackets, by the kind of the column.
UNITS = {
    **dict.fromkeys((*POINT, *OF_TOOL[:3], *OF_LINK[:3]), {"m": 1.0, "cm": 1e-2, "mm": 1e-3}),
    **dict.fromkeys(WRENCH[:3], {"n": 1.0}),
    **dict.fromkeys(WRENCH[3:], {"n m": 1.0, "nm": 1.0, "n mm": 1e-3, "nmm": 1e-3}),
    **dict.fromkeys(("ax", "ay", "az"), {"m/s^2": 1.0, "g": 9.80665}),
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
}
# Largest coordinate of a point [m]. A larger one is in millimetres.
MAX_COORDINATE = 10.0
# Largest force [N] along an axis. A larger one is in millinewtons. Larger: accepts more wrong units.
MAX_FORCE = 2000.0
# Smallest force with a reliable line of action [N]. Larger: refuses more touches.
MIN_FORCE = 0.1
# Numbers of a table. It protects the memory. Larger: accepts longer sessions.
MAX_NUMBERS = 2**26
# [m] Distance of the last from the first third of a press from which on it is named. Larger: fewer notes.
MAX_PRESS_MOTION = 3e-3
MIN_MOTION_ROWS = 6  # of a press. Larger: less is said about short presses.
# [standard errors] of this distance. Larger: fewer notes about weak presses, whose lines of action are noisy.
MIN_MOTION_SIGMA = 5.0
# Touches of a file. Larger: more time.
MAX_TOUCHES = 5000


@dataclass(frozen=True, eq=False)
class Touches:
    """Positions of touches, in the link frame; row i of every field is the same touch.

    A touch is a point, or the line of action of a wrench. Only a line has a direction.
    """

    taxels: tuple[str, ...]  # ids of the taxels with the largest reading
    lines: IntArray  # (n,) lines of the file, the first of each press
    points: Array  # (n, 3) tip of the probe, or a point of the line [m]
    directions: Array  # (n, 3) unit direction of the line; zero for a point
    unused: tuple[str, ...] = ()  # columns of the file that are not used
    wrenches: Array = field(default_factory=lambda: np.empty((0, 6)))  # (n, 6) [N, N m]; empty without
    felt: tuple[str, ...] = ()  # ids of the taxels with a reading
    readings: Array = field(default_factory=lambda: np.empty((0, 0)))  # (n, k) of these taxels; empty without
    force_noise: float | None = None  # standard deviation per axis of the force of a touch [N]; None: not known
    rows: int = 0  # of the file
    recording: Presses | None = None  # the rows of the file
    sha256: str = ""  # of the file; empty: not from a file
    tool: ToolContacts | None = None  # from whose mesh the points are; None: they are in the file
    notes: tuple[str, ...] = ()  # what a person should know of the file

    def __post_init__(self):
        n = len(self.taxels)
        freeze(
            self,
            lines=(n,),
            points=(n, 3),
            directions=(n, 3),
            wrenches=(n if len(self.wrenches) else 0, 6),
            readings=(n if self.felt else 0, len(self.felt)),
        )


FindContacts = Callable[[ToolPoses], ToolContacts]


def read_touches(
    path: str | os.PathLike[str], calibration: LinkCalibration, find_contacts: FindContacts | None = None
) -> Touches:
    """Read a table of touches, or a recording of them.

    The header has ``taxel`` or ``channel`` (the one with the largest reading), or the ids of all taxels of a skin
    (their readings), and at least one of two sets of columns:

    - ``x``, ``y``, ``z``: the tip of the probe in the link frame [m];
    - ``fx``, ``fy``, ``fz``, ``tx``, ``ty``, ``tz``: the wrench about the origin of the link, measured by a
      force-torque sensor [N, N m].

    Instead of a point, the pose of a tool in the frame of the link is ``tool_x``, ``tool_y``, ``tool_z`` [m],
    ``tool_qx``, ``tool_qy``, ``tool_qz``, ``tool_qw``. With ``link_x`` and so on, that of the link, both are in the
    world. A comment ``# tool: FILE UNIT`` names the mesh of the tool, ``find_contacts`` returns its points of touch.

    ``press`` numbers the presses, ``time`` [s] finds them. The header can name other units in brackets, ``x [mm]``. A
    comment ``# link: NAME`` or a column ``link`` names the link. The order and the case of the names are free.
    """
    with naming_file(path):
        text = read_text(path)
        _check_link(text, calibration.link)
        recorded, columns = _read(text, calibration, Path(path).parent)
    if recorded.tool is not None and find_contacts is None:
        message = "has poses of a tool, whose points of touch need the mesh of the link. Name the plan"
        raise CalibrationFormatError(f"'{path}' {message} instead of the calibration.")
    return touches_of(recorded, tuple(columns.felt), calibration, path, columns, find_contacts)


def touches_of(
    recorded: Recorded,
    felt: tuple[str, ...],
    calibration: LinkCalibration,
    path: str | os.PathLike[str],
    columns: "_Columns | None" = None,
    find_contacts: FindContacts | None = None,
) -> Touches:
    """Return the touches in the rows of a file; ``felt`` has the ids of taxels with readings, ``columns`` a table."""
    taxels = [patch.taxels for patch in calibration.patches]
    centres = {name: at for part in taxels for name, at in zip(part.ids, part.positions_link)}
    with naming_file(path):
        presses = find_presses(recorded, centres)
    if (count := len(np.unique(presses.numbers[presses.numbers >= 0]))) > MAX_TOUCHES:
        raise CalibrationFormatError(
            f"'{path}' has {count} touches, more than {MAX_TOUCHES}. Split the file. If these are the rows of fewer "
            'presses, give the time or the number of the press in a column "time" or "press".'
        )
    with naming_file(path):
        found = _touches(presses, felt, columns, find_contacts)
    notes = (*found.notes, *_moving(presses, found, centres))
    return replace(found, sha256=file_hash(Path(path)) or "", notes=notes)


class _Columns(NamedTuple):
    """Where a table has what."""

    owner: TaxelColumn | None
    link: int | None
    numbers: dict[str, int]  # places of the columns with numbers
    scales: dict[str, float]  # their units
    felt: dict[str, int]  # places of the readings, by the ids of the taxels
    unused: tuple[str, ...]

    @classmethod
    def of(cls, header: list[str], line: int, calibration: LinkCalibration) -> "_Columns":
        names, scales = zip(*(with_unit(name, line, k + 1) for k, name in enumerate(header)))
        header = list(names)
        ids = {name.lower(): name for patch in calibration.patches for name in patch.taxels.ids}
        felt = {ids[name]: find_column(header, name, line) for name in header if name in ids}
        for patch in calibration.patches:
            missing = [name for name in patch.taxels.ids if name not in felt]
            if 0 < len(missing) < len(patch.taxels.ids):
                raise TableError(line, f"the header has some taxels of {patch.name}, but not {listed(missing)}", 1)
        wanted: list[str] = [name for name in ("time", "press") if name in header]
        if "fx" in header:
            wanted += WRENCH
        if {*OF_TOOL} & {*header}:
            wanted += (*OF_TOOL, *(OF_LINK if {*OF_LINK} & {*header} else ()))
            if "x" in header:
                message = "the header has a point and the pose of a tool. Remove one of them"
                raise TableError(line, message, header.index("x") + 1)
        elif "x" in header or "fx" not in header:
            wanted += POINT
        numbers = {name: find_column(header, name, line) for name in wanted}
        owner = None if felt and not {"taxel", "channel"} & set(header) else TaxelColumn.of(header, line, calibration)
        link = find_column(header, "link", line) if "link" in header else None
        others = ([] if owner is None else [owner.place]) + ([] if link is None else [link])
        unused = names_without(header, [*numbers.values(), *felt.values(), *others])
        return cls(owner, link, numbers, {n: scales[k] for n, k in numbers.items()}, felt, unused)


def with_unit(name: str, line: int, column: int) -> tuple[str, float]:
    """Return the name of a column without its unit, and the size of the unit."""
    found = re.fullmatch(r"(.*?)\s*[\[(](.*)[\])]", name)
    if found is None or found[1] not in UNITS:
        return name, 1.0
    units, given = UNITS[found[1]], found[2].strip()
    if given not in units:
        raise TableError(line, f"the unit {show(given)} is not known here; use one of {', '.join(units)}", column)
    return found[1], units[given]


def _check_link(text: str, link: str) -> None:
    """Check the link that comments name."""
    for number, content in enumerate(text.split("\n"), 1):
        found = re.fullmatch(r"#\s*link\s*:\s*(.+?)\s*", content, re.IGNORECASE) if content.startswith("#") else None
        if found and found[1] != link:
            raise _of_another(found[1], link, number)


def _of_another(found: str, link: str, line: int, column: int = 0) -> TableError:
    return TableError(line, f"the touches are of the link {show(found)}, the calibration of {show(link)}", column)


def _read(text: str, calibration: LinkCalibration, folder: Path) -> tuple[Recorded, _Columns]:
    """Return the rows of a table, in SI units; ``folder`` is that of the file."""
    table = read_named_rows(text)
    line_of_header, header = next(table, (1, [""]))
    columns = _Columns.of(header, line_of_header, calibration)
    line = line_of_header
    places = [*columns.numbers.items(), *columns.felt.items()]
    numbers, lines, owners = array("d"), array("q"), list[str]()
    before = -np.inf
    for line, row in table:
        if columns.link is not None and row[columns.link] != calibration.link:
            raise _of_another(row[columns.link], calibration.link, line, columns.link + 1)
        for name, k in places:
            is_between = name == "press" and not row[k]
            number = -1.0 if is_between else number_in(row, k, line) * columns.scales.get(name, 1.0)
            if name == "time":
                if number < before:
                    raise TableError(
                        line, f"the time {number:g} s is before {before:g} s, that of the row above", k + 1
                    )
                before = number
            elif name in (*POINT, *OF_TOOL, *OF_LINK) and abs(number) > MAX_COORDINATE:
                message = (
                    f"the coordinate {number:g} m is more than {MAX_COORDINATE:g} m from the origin of its frame. "
                    f'Coordinates are in metres; for millimetres name the column "{name} [mm]"'
                )
                raise TableError(line, message, k + 1)
            elif name in WRENCH[:3] and abs(number) > MAX_FORCE:
                message = f"the force {number:g} N is more than {MAX_FORCE:g} N. Forces are in newtons"
                raise TableError(line, message, k + 1)
            numbers.append(number)
        if columns.owner is not None:
            owners.append(columns.owner.taxel(row, line))
        lines.append(line)
        if len(numbers) > MAX_NUMBERS:
            raise TableError(line, f"the table has more than {MAX_NUMBERS} numbers. Split it")
    if not lines:
        raise TableError(line, "the table has no row below its header", 1)
    values = np.array(numbers).reshape(len(lines), -1)
    of = {name: values[:, k] for k, (name, _) in enumerate(places)}
    readings = values[:, len(columns.numbers) :]
    felt = tuple(columns.felt)
    taxels = np.array(owners or [felt[k] for k in readings.argmax(axis=1)])
    tool = None
    if OF_TOOL[0] in of:
        poses = _columns(of, OF_TOOL), _columns(of, OF_LINK)
        tool = ToolRows.read(text, line_of_header, folder, np.array(lines), *poses)
    recorded = Recorded(
        np.array(lines),
        taxels,
        _columns(of, POINT) if tool is None else tool.positions,
        _columns(of, WRENCH),
        readings,
        of.get("time"),
        of.get("press"),
        tool,
    )
    return recorded, columns


def _columns(of: dict[str, Array], names: Sequence[str]) -> Array | None:
    return np.stack([of[name] for name in names], axis=1) if names[0] in of else None


def _touches(
    presses: Presses, felt: tuple[str, ...], columns: _Columns | None, find_contacts: FindContacts | None
) -> Touches:
    """Return the medians of all presses."""
    recorded, numbers = presses.recorded, presses.numbers
    groups = _groups(numbers)
    readings = _medians(recorded.readings, groups) if felt else np.empty((0, 0))
    if columns is None or columns.owner is None:
        taxels = tuple(felt[k] for k in readings.argmax(axis=1))
    else:
        taxels = tuple(Counter(recorded.taxels[rows].tolist()).most_common(1)[0][0] for rows in groups)
    lines = recorded.lines[[rows[0] for rows in groups]]
    wrenches = np.empty((0, 6)) if recorded.wrenches is None else _medians(recorded.wrenches, groups)
    tool = None
    if recorded.tool is not None:
        assert find_contacts is not None
        tool = find_contacts(recorded.tool.of_presses(lines, groups))
        points, directions = tool.points, np.zeros((len(groups), 3))
    elif recorded.points is not None:
        points, directions = _medians(recorded.points, groups), np.zeros((len(groups), 3))
    else:
        for line, force in zip(lines.tolist(), np.linalg.norm(wrenches[:, :3], axis=1).tolist()):
            if not MIN_FORCE <= force < np.inf:
                message = f"the force of {force:.3g} N gives no reliable line of action, which needs {MIN_FORCE:g} N"
                column = 0 if columns is None else columns.numbers["fx"] + 1
                raise TableError(line, f"{message} or more. Remove this touch", column)
        points, directions = lines_of_action(wrenches)
    return Touches(
        taxels,
        lines,
        points,
        directions,
        () if columns is None else columns.unused,
        wrenches=wrenches,
        felt=felt,
        readings=readings,
        force_noise=presses.force_noise,
        rows=len(recorded.lines),
        recording=presses,
        tool=tool,
        notes=presses.notes,
    )


def _groups(numbers: IntArray) -> list[IntArray]:
    """Return the rows of each press, in the order of the first ones."""
    order = np.argsort(numbers, kind="stable")
    order = order[numbers[order] >= 0]
    groups = np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)
    return sorted(groups, key=lambda rows: int(rows[0]))


def _moving(presses: Presses, touches: Touches, centres: dict[str, Array]) -> tuple[str, ...]:
    """Return a note about presses whose point of touch moves: they slide, or are several."""
    recorded, farthest, lines = presses.recorded, 0.0, list[int]()
    if recorded.tool is not None:  # whose origin moves if it turns about its tip
        return ()
    for taxel, rows in zip(touches.taxels, _groups(presses.numbers)):
        if recorded.wrenches is not None:  # weak forces have no reliable line of action
            forces = np.linalg.norm(recorded.wrenches[rows, :3], axis=1)
            rows = rows[forces >= PLATEAU * forces.max()]
        if len(rows) < MIN_MOTION_ROWS:
            continue
        places = places_of(recorded, rows, [taxel] * len(rows), centres)
        part = len(rows) // 3
        moved = float(np.linalg.norm(np.median(places[-part:], axis=0) - np.median(places[:part], axis=0)))
        noise = float(np.median(np.linalg.norm(np.diff(places, axis=0), axis=1)))  # of the difference of two rows
        if moved > max(MAX_PRESS_MOTION, MIN_MOTION_SIGMA * noise * part**-0.5):
            farthest = max(farthest, moved)
            lines.append(int(recorded.lines[rows[0]]))
    if not lines:
        return ()
    count = f"{len(lines)} of {len(touches.taxels)} presses"
    message = f"the point of touch moves by up to {farthest * 1e3:.0f} mm in {count}, the first from line {lines[0]} on"
    return (f"{message}: they slide, or are several. Press without sliding, with pauses, or number the presses",)


def of_taxels(calibration: LinkCalibration, ids: Iterable[str], name: str) -> Array:
    """Return the rows of the field ``name`` of `TaxelArray` for taxels of any patches."""
    taxels = [patch.taxels for patch in calibration.patches]
    rows = {id: row for part in taxels for id, row in zip(part.ids, getattr(part, name))}
    return np.array([rows[id] for id in ids])


def lines_of_action(wrenches: Array) -> tuple[Array, Array]:
    """Return a point of each line of action, shape (n, 3) [m], and its unit direction.

    The line of action of a wrench (f, t) goes through the point (f x t) / |f|^2. These are equations 6 to 9 of the
    paper, without their division of zero by zero.
    """
    forces, moments = wrenches[:, :3], wrenches[:, 3:]
    strengths = np.maximum(np.linalg.norm(forces, axis=1), np.finfo(float).tiny)[:, None]
    return np.cross(forces / strengths, moments / strengths), unit(forces)


def _medians(values: Array, groups: Sequence[IntArray]) -> Array:
    return np.array([np.median(values[rows], axis=0) for rows in groups]).reshape(len(groups), values.shape[1])
