"""Touches of a robot on its own skins, from a table: angles of the joints, what touched, and what was felt."""

import os
import re
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..calibration.model import LinkCalibration, Patch
from ..common.arrays import Array, IntArray
from ..common.errors import CalibrationFormatError, listed
from ..common.file_hash import file_hash
from ..common.findings import did_you_mean, show
from ..common.tables import TableError, find_column, names_without, naming_file, number_in, read_named_rows
from ..common.text import NumberError, read_text, real
from ..robot.urdf import ONE_AXIS, Joint, Robot
from .presses import Recorded, find_presses
from .touches import MAX_COORDINATE, MAX_NUMBERS, MAX_TOUCHES, UNITS

# Contract: units that the header can name in brackets after a joint.
LENGTHS, ANGLES = UNITS["x"], {"rad": 1.0, "deg": float(np.pi / 180)}
# [rad, m] beyond the limits of a joint, which errors of its zero explain. Larger: accepts more wrong units.
LIMIT_MARGIN = 0.15
# [rad, m] of a joint without limits. Larger: accepts more wrong units.
MAX_ANGLE, MAX_SLIDE = 4 * np.pi, 10.0
# [rad, m] Successive rows of the same taxels whose joints differ less are one press, if nothing else separates presses.
# Larger: touches next to each other become one. Smaller: noise makes several of one.
SAME_POSTURE = 5e-3
COLUMNS = ("time", "press", "taxel", "link", "tip", "taxel2", "link2")  # Contract: names in the header


@dataclass(frozen=True)
class Tip:
    """A point of a link that touches skins."""

    name: str
    link: str
    position: tuple[float, float, float]  # nominal, in the frame of the link [m]


@dataclass(frozen=True)
class Felt:
    """What one skin felt of a touch."""

    patch: int  # position in `Session.patches`
    rows: tuple[int, ...]  # taxels of the patch that felt it
    readings: tuple[float, ...]  # of these; 1 where the table names taxels only


@dataclass(frozen=True, eq=False)
class Session:
    """Touches of a robot on itself; row i of every field is the same touch."""

    patches: tuple[tuple[str, Patch], ...]  # all skins, with their links
    positions: dict[str, Array]  # (n,) of joints, by name [rad] or [m]
    felt: tuple[Felt, ...]
    bodies: tuple[Tip | Felt, ...]  # what touched the skin: a tip, or another skin that felt it, too
    lines: IntArray  # (n,) lines of the file, the first of each press
    rows: int = 0  # of the file
    unused: tuple[str, ...] = ()  # columns of the file that are not used
    sha256: str = ""  # of the file; empty: not from a file


def read_session(path: str | os.PathLike[str], robot: Robot, calibrations: Mapping[str, LinkCalibration]) -> Session:
    """Read a table of touches of a robot on itself.

    The header has the names of the joints (``elbow [deg]``; radians or metres without a unit) and what was felt:
    ``taxel``, the id of a taxel or several with spaces between them, with ``link`` if several links have it; or the
    readings of all taxels of a skin, in columns ``ID`` or ``LINK/ID``. What touched is ``tip``, or ``taxel2`` and
    ``link2`` of another skin; with readings alone it is the skin with the second largest ones. A comment ``# tip: NAME
    LINK X Y Z UNIT`` states where a tip is in its link. Without one, the name of a link is a tip at its origin.
    ``press`` numbers the presses, ``time`` [s] finds them in the readings.
    """
    with naming_file(path):
        session = _Table(read_text(path), robot, calibrations).session()
    if len(session.lines) > MAX_TOUCHES:
        message = (
            f"'{path}' has {len(session.lines)} touches, more than {MAX_TOUCHES}. Number the presses, or split it."
        )
        raise CalibrationFormatError(message)
    return replace(session, sha256=file_hash(Path(path)) or "")


class _Table:
    """The header of a table, and the rows below."""

    def __init__(self, text: str, robot: Robot, calibrations: Mapping[str, LinkCalibration]):
        self.robot, self.tips = robot, _tips(text, robot)
        self.patches = tuple((link, patch) for link, found in calibrations.items() for patch in found.patches)
        self.owners: dict[str, dict[str, tuple[int, int]]] = {}  # of ids, by link: patch and row
        for k, (link, patch) in enumerate(self.patches):
            for row, name in enumerate(patch.taxels.ids):
                self.owners.setdefault(name, {})[link] = k, row
        self.table = read_named_rows(text)
        self.line, header = next(self.table, (1, [""]))
        self.columns: dict[str, tuple[int, float]] = {}  # places and units of COLUMNS
        self.joints: dict[str, tuple[int, float]] = {}  # likewise, by name
        self.felt: dict[int, tuple[int, int]] = {}  # patch and row, by place
        joints = {name.lower(): joint for name, joint in robot.joints.items() if joint.type in ONE_AXIS}
        ids = {name.lower(): owners for name, owners in self.owners.items()}
        ids |= {f"{link}/{name}".lower(): {link: at} for name, of in self.owners.items() for link, at in of.items()}
        named = set[tuple[int, int]]()
        for place, cell in enumerate(header):
            found = re.fullmatch(r"(.*?)\s*[\[(](.*)[\])]", cell)
            name, unit = (found[1], found[2].strip()) if found else (cell, "")
            if cell in ids:
                if len(ids[cell]) > 1:
                    message = f"{listed(tuple(ids[cell]))} have a taxel {show(cell)}; name the column LINK/{cell}"
                    raise TableError(self.line, message, place + 1)
                (owner,) = ids[cell].values()
                if owner in named:
                    raise TableError(self.line, f"the header names the taxel {show(cell)} twice", place + 1)
                named.add(owner)
                self.felt[place] = owner
            elif name in COLUMNS:
                self._add(self.columns, name, place, unit, UNITS["time"] if name == "time" else {})
            elif name in joints and not joints[name].mimic:
                is_slide = joints[name].type == "prismatic"
                self._add(self.joints, joints[name].name, place, unit, LENGTHS if is_slide else ANGLES)
            elif unit in ANGLES and name not in {known.lower() for known in robot.joints}:  # fixed ones are not used
                message = f"{robot.file} has no joint {show(name)}{did_you_mean(name, joints)}"
                raise TableError(self.line, message, place + 1)
        for k in sorted({k for k, _ in self.felt.values()}):
            link, patch = self.patches[k]
            has = {row for other, row in self.felt.values() if other == k}
            if missing := [name for row, name in enumerate(patch.taxels.ids) if row not in has]:
                message = f"the header has some taxels of {link}/{patch.name}, but not {listed(missing)}"
                raise TableError(self.line, message, 1)
        if not self.felt:
            find_column(header, "taxel", self.line)
        places = [place for place, _ in (*self.columns.values(), *self.joints.values())]
        self.unused = names_without(header, [*places, *self.felt])

    def _add(
        self, columns: dict[str, tuple[int, float]], name: str, place: int, unit: str, units: dict[str, float]
    ) -> None:
        """Add a column, in a unit that the header may name."""
        if name in columns:
            raise TableError(self.line, f"the header names the column {show(name)} twice", place + 1)
        if unit and unit not in units:
            known = f"use one of {', '.join(units)}" if units else "it has none"
            raise TableError(self.line, f"the unit {show(unit)} of {show(name)} is not known here; {known}", place + 1)
        columns[name] = place, units[unit] if unit else 1.0

    def session(self) -> Session:
        """Read the rows, and join those of one press."""
        numbers, lines, named = array("d"), array("q"), list[tuple[Felt | None, Tip | Felt | None]]()
        timing = {name: self.columns[name] for name in ("time", "press") if name in self.columns}
        before = -np.inf
        for line, row in self.table:
            for name, (place, unit) in timing.items():
                number = -1.0 if name == "press" and not row[place] else number_in(row, place, line) * unit
                if name == "time" and number < before:
                    message = f"the time {number:g} s is before {before:g} s, that of the row above"
                    raise TableError(line, message, place + 1)
                before = number if name == "time" else before
                numbers.append(number)
            for joint, (place, unit) in self.joints.items():
                numbers.append(_position(self.robot.joints[joint], number_in(row, place, line) * unit, line, place))
            numbers.extend(number_in(row, place, line) for place in self.felt)
            named.append((self._named(row, line, "taxel", "link"), self._body(row, line)))
            lines.append(line)
            if len(numbers) > MAX_NUMBERS:
                raise TableError(line, f"the table has more than {MAX_NUMBERS} numbers. Split it")
        if not lines:
            raise TableError(self.line, "the table has no row below its header", 1)
        parts = np.split(np.array(numbers).reshape(len(lines), -1), np.cumsum((len(timing), len(self.joints))), axis=1)
        of_time, positions, readings = parts
        order = {key: k for k, key in enumerate(dict.fromkeys(named))}
        keys = np.array([order[key] for key in named])
        if "press" in timing or ("time" in timing and self.felt):
            times, given = (of_time[:, list(timing).index(n)] if n in timing else None for n in ("time", "press"))
            found = find_presses(Recorded(np.array(lines), keys, None, None, readings, times, given), {})
            presses, readings = found.numbers, found.recorded.readings
        else:
            presses = _by_posture(keys, positions)
        groups = [np.flatnonzero(presses == k) for k in dict.fromkeys(presses[presses >= 0].tolist())]
        touches = [
            self._touch(named[rows[np.bincount(keys[rows]).argmax() == keys[rows]][0]], readings[rows], lines[rows[0]])
            for rows in groups
        ]
        medians = np.array([np.median(positions[rows], axis=0) for rows in groups])
        return Session(
            self.patches,
            {name: medians[:, k] for k, name in enumerate(self.joints)},
            tuple(felt for felt, _ in touches),
            tuple(body for _, body in touches),
            np.array(lines)[[rows[0] for rows in groups]],
            len(lines),
            self.unused,
        )

    def _named(self, row: list[str], line: int, taxel: str, link: str) -> Felt | None:
        """Return what a row names; None if it names no taxel."""
        if taxel not in self.columns or not (text := row[place := self.columns[taxel][0]]):
            return None
        of_link = row[self.columns[link][0]] if link in self.columns else ""
        if of_link and of_link not in {name for name, _ in self.patches}:
            known = did_you_mean(of_link, {name for name, _ in self.patches})
            raise TableError(line, f"the link {show(of_link)} has no skin{known}", self.columns[link][0] + 1)
        places = list[tuple[int, int]]()
        for name in [text] if text in self.owners else text.split():
            owners = self.owners.get(name, {})
            if of_link and owners:
                owners = {of_link: owners[of_link]} if of_link in owners else {}
            if len(owners) > 1:
                raise TableError(
                    line, f"{listed(tuple(owners))} have a taxel {show(name)}; add a column {link!r}", place + 1
                )
            if not owners:
                known = did_you_mean(name, self.owners)
                raise TableError(line, f"{of_link or 'the robot'} has no taxel {show(name)}{known}", place + 1)
            places += owners.values()
        patches = [patch for patch, _ in places]
        if len({self.patches[patch][0] for patch in patches}) > 1:
            raise TableError(line, f"the taxels {text} are of several links; name those of one", place + 1)
        most = max(patches, key=patches.count)  # a contact on two skins counts for the one with more of it
        rows = tuple(row for patch, row in places if patch == most)
        return Felt(most, rows, (1.0,) * len(rows))

    def _body(self, row: list[str], line: int) -> Tip | Felt | None:
        """Return what touched, as far as the row names it."""
        name = row[self.columns["tip"][0]] if "tip" in self.columns else ""
        if not name:
            other = self._named(row, line, "taxel2", "link2")
            is_only = other is None and len(self.tips) == 1 and not {"tip", "taxel2"} & set(self.columns)
            return next(iter(self.tips.values())) if is_only else other
        if name in self.tips:
            return self.tips[name]
        if name in self.robot.links:
            return Tip(name, name, (0.0, 0.0, 0.0))
        known = did_you_mean(name, (*self.tips, *self.robot.links))
        message = f'no comment "# tip: ..." places the tip {show(name)}, and no link has this name{known}'
        raise TableError(line, message, self.columns["tip"][0] + 1)

    def _touch(
        self, named: tuple[Felt | None, Tip | Felt | None], readings: Array, line: int
    ) -> tuple[Felt, Tip | Felt]:
        """Return what was felt of a press, with its median readings, and what touched."""
        felt, body = named
        measured: dict[int, dict[int, float]] = {}
        for (k, row), reading in zip(self.felt.values(), np.median(readings, axis=0).tolist()):
            if reading > 0:
                measured.setdefault(k, {})[row] = reading
        found = {k: Felt(k, tuple(rows), tuple(rows.values())) for k, rows in measured.items()}
        order = sorted(found, key=lambda k: -max(found[k].readings))
        if felt is None:
            others = [k for k in order if not (isinstance(body, Felt) and k == body.patch)]
            if not others:
                raise TableError(line, "no taxel felt this touch. Remove it")
            felt = found[others[0]]
        if body is None:
            link = self.patches[felt.patch][0]
            others = [k for k in order if self.patches[k][0] != link]
            if not others:
                raise TableError(
                    line, "the table does not state what touched: name a tip, or the taxel of another skin"
                )
            body = found[others[0]]
        felt = found.get(felt.patch, felt)
        return felt, found.get(body.patch, body) if isinstance(body, Felt) else body


def _tips(text: str, robot: Robot) -> dict[str, Tip]:
    """Return the tips that comments place, by their names."""
    tips = dict[str, Tip]()
    for number, content in enumerate(text.split("\n"), 1):
        found = re.fullmatch(r"#\s*tip\s*:\s*(.*?)\s*", content, re.IGNORECASE)
        if not found:
            continue
        words = found[1].split()
        if len(words) != 6 or words[5] not in LENGTHS:
            raise TableError(
                number, 'a tip has the form "# tip: NAME LINK X Y Z UNIT", such as "# tip: finger hand 0 0 60 mm"'
            )
        if words[1] not in robot.links:
            message = f"{robot.file} has no link {show(words[1])}{did_you_mean(words[1], robot.links)}"
            raise TableError(number, message)
        try:
            x, y, z = (real(word) * LENGTHS[words[5]] for word in words[2:5])
        except NumberError as problem:
            raise TableError(number, f"the tip {show(words[0])}: {problem}") from problem
        if max(map(abs, (x, y, z))) > MAX_COORDINATE:
            raise TableError(number, f"the tip {show(words[0])} is more than {MAX_COORDINATE:g} m from its link")
        if words[0] in tips:
            raise TableError(number, f"a comment above places the tip {show(words[0])}, too. Remove one of them")
        tips[words[0]] = Tip(words[0], words[1], (x, y, z))
    return tips


def _position(joint: Joint, value: float, line: int, place: int) -> float:
    """Return the position of a joint; it has to be within its limits."""
    is_slide = joint.type == "prismatic"
    most = MAX_SLIDE if is_slide else MAX_ANGLE
    low, high = joint.limits if joint.limits and joint.limits[0] < joint.limits[1] else (-most, most)
    if not low - LIMIT_MARGIN <= value <= high + LIMIT_MARGIN:
        unit, other = ("m", "mm") if is_slide else ("rad", "deg")
        message = (
            f"the joint {show(joint.name)} at {value:.4g} {unit} is beyond its limits, {low:.4g} to {high:.4g} {unit}; "
            f'for other units name the column "{joint.name} [{other}]"'
        )
        raise TableError(line, message, place + 1)
    return value


def _by_posture(keys: IntArray, positions: Array) -> IntArray:
    """Return a number for each run of rows with the same taxels in one posture."""
    first, numbers = 0, np.zeros(len(keys), np.int64)
    for k in range(1, len(keys)):
        is_same = keys[k] == keys[first] and bool((np.abs(positions[k] - positions[first]) < SAME_POSTURE).all())
        numbers[k] = numbers[k - 1] + (not is_same)
        first = first if is_same else k
    return numbers
