"""Taxels of a file of another program, and the checks of their data."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from ...common.arrays import Array, BoolArray, IntArray, freeze, unit
from ...common.findings import Finding, error, first, repeated, show, warning
from ..model import MAX_CHANNEL

# Distance of a taxel from the frame of its link [m]. Larger: positions in millimetres pass.
MAX_TAXEL_DISTANCE = 5.0
MAX_LABEL_LENGTH = 200  # characters. Larger: longer lines in messages and tables.
# Distance of taxels that count as equal positions [m]: files have six decimals. Larger: close taxels give a warning.
SAME_POSITION = 1e-6
# Deviation of the length of a normal from 1: files have three decimals or more. Larger: fewer warnings.
NORMAL_LENGTH_TOLERANCE = 2e-3
MAX_VECTOR_COMPONENT = 1e6  # of a direction. Larger: invalid numbers pass as directions.
# Format: some programs write this vector for an unknown normal
PLACEHOLDER = (1.0, 0.0, 0.0)
# Depth of taxels with equal normals along that normal, as a fraction of their extent. If they are deeper, the normal is
# a placeholder. Larger: placeholders pass.
FLAT_FRACTION = 0.1

Locations = NDArray[np.str_]  # location of each taxel in its file, such as "line 3"


@dataclass(frozen=True, eq=False)
class TaxelSet:
    """Taxels of a file; row i of each field belongs to the same taxel."""

    positions: Array  # (n, 3) [m], in ``frame``
    normals: Array | None  # (n, 3) unit; None without usable normals in the file. They may point inwards
    labels: tuple[str, ...]  # stable names, all different
    channels: IntArray  # (n,) position of the taxel in a reading
    frame: str | None  # name in the file; None without a name
    neighbours: tuple[tuple[str, ...], ...] | None = None  # labels; None without neighbours in the file
    tangents: Array | None = None  # (n, 3) unit, x axes of the taxels; None without tangents in the file
    findings: tuple[Finding, ...] = ()  # warnings, also about taxels that were left out
    boards: IntArray | None = None  # (n,) number of the rigid board of each taxel; None without boards in the file

    def __post_init__(self):
        n = len(self.labels)
        vectors = [name for name in ("normals", "tangents") if getattr(self, name) is not None]
        freeze(self, positions=(n, 3), channels=(n,), **{name: (n, 3) for name in vectors})
        if self.boards is not None:
            freeze(self, boards=(n,))
        if self.neighbours is not None and len(self.neighbours) != n:
            raise ValueError(f"TaxelSet.neighbours has {len(self.neighbours)} rows, expected {n}")

    def moved(self, rotation: Array, translation: Array) -> "TaxelSet":
        """Return the taxels in another frame.

        .. math:: p' = R p + t
        """
        R = np.asarray(rotation, float)
        return replace(
            self,
            positions=self.positions @ R.T + translation,
            normals=None if self.normals is None else unit(self.normals @ R.T),
            tangents=None if self.tangents is None else unit(self.tangents @ R.T),
            frame=None,
        )


def line(number: int) -> str:
    """Return a location in a text file for a finding; the first line is line 1."""
    return f"line {number}"


@dataclass
class Draft:
    """Data that a reader has found so far; row i of each list belongs to the same taxel.

    Without channels in the format, the list of channels is empty. The channel of a taxel is then its index.
    """

    lines: list[int] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    channels: list[int] = field(default_factory=list)
    positions: list[tuple[float, ...]] = field(default_factory=list)  # [m]
    normals: list[tuple[float, ...]] | None = None
    tangents: list[tuple[float, ...]] | None = None
    neighbours: list[tuple[str, ...]] | None = None
    links: list[str] = field(default_factory=list)  # link of each taxel, in formats with several links
    boards: list[int] = field(default_factory=list)  # rigid board of each taxel, in formats with boards
    frame: str | None = None
    findings: list[Finding] = field(default_factory=list)
    at: Callable[[int], str] = line  # converts a number of ``lines`` to a location

    @property
    def broken(self) -> bool:
        """Return whether the file has an error."""
        return any(finding.severity == "error" for finding in self.findings)

    def add(
        self,
        line: int,
        label: str,
        channel: int | None,
        position: Sequence[float],
        normal: Sequence[float] | None = None,
        tangent: Sequence[float] | None = None,
    ) -> None:
        """Add a taxel; directions are added if the format has them."""
        self.lines.append(line)
        self.labels.append(label)
        self.positions.append(tuple(position))
        if channel is not None:
            self.channels.append(channel)
        for column, vector in ((self.normals, normal), (self.tangents, tangent)):
            if column is not None and vector is not None:
                column.append(tuple(vector))

    def keep(self, rows: Sequence[int]) -> None:
        """Keep only the taxels of these rows."""
        vectors = ("positions", "normals", "tangents")
        for name in ("lines", "labels", "channels", *vectors, "neighbours", "links", "boards"):
            column = getattr(self, name)
            if column:
                setattr(self, name, [column[i] for i in rows])


def finished(draft: Draft, only: str | None = None) -> tuple[TaxelSet | None, tuple[Finding, ...]]:
    """Check a draft, and convert it to a taxel set."""
    if not draft.broken:
        _select(draft, only)
    if not draft.broken:
        draft.findings += first(_unusable_names(draft))
    if draft.broken:
        return None, tuple(draft.findings)
    locations, positions = np.array([draft.at(number) for number in draft.lines]), _vectors(draft.positions)
    normals, tangents = (None if rows is None else _vectors(rows) for rows in (draft.normals, draft.tangents))
    there = positions.any(axis=1) if normals is None else positions.any(axis=1) | normals.any(axis=1)
    draft.findings += _left_out(locations, there)
    chosen = np.flatnonzero(there)
    locations, positions = locations[chosen], positions[chosen]
    draft.findings += _distant_positions(locations, positions)
    for vectors in (normals, tangents):
        draft.findings += () if vectors is None else _overlong_vectors(locations, vectors[chosen])
    if draft.broken:
        return None, tuple(draft.findings)
    draft.findings += _repeated_positions(locations, positions)
    if normals is not None:
        normals = _directions(draft, locations, normals[chosen], "normal", _placeholders(positions, normals[chosen]))
    if tangents is not None:
        tangents = _directions(draft, locations, tangents[chosen], "tangent", np.zeros(len(chosen), bool))
    taxels = TaxelSet(
        positions=positions,
        normals=normals,
        labels=tuple(draft.labels[i] for i in chosen),
        channels=np.array(draft.channels, np.int64)[chosen],
        frame=draft.frame,
        neighbours=None if draft.neighbours is None else tuple(draft.neighbours[i] for i in chosen),
        tangents=tangents,
        findings=tuple(draft.findings),
        boards=np.array(draft.boards, np.int64)[chosen] if draft.boards else None,
    )
    return taxels, taxels.findings


def _select(draft: Draft, only: str | None) -> None:
    """Keep the requested taxels, which must belong to one link, and add missing channels."""
    if only is not None:
        rows = [i for i, label in enumerate(draft.labels) if fnmatchcase(label, only)]
        if not rows:
            message = f"has no taxel whose label matches {show(only)}; the first label is {show(draft.labels[0])}"
            draft.findings.append(error("no-taxels", "", message, only))
            return
        draft.keep(rows)
    links = list(dict.fromkeys(draft.links))
    if len(links) > 1:
        i = draft.links.index(links[1])
        message = f"has {show(draft.labels[i])} on {show(links[1])}, but the previous taxels are on {show(links[0])}; "
        message += 'select the taxels of one link by their labels (--only, or "only" in a plan)'
        draft.findings.append(error("links", draft.at(draft.lines[i]), message, links))
    draft.frame = links[0] if links else draft.frame
    draft.channels = draft.channels or list(range(len(draft.labels)))


def _vectors(rows: list[tuple[float, ...]]) -> Array:
    return np.array(rows, float).reshape(len(rows), 3)


def _left_out(locations: Locations, there: BoolArray) -> Iterator[Finding]:
    count = int(np.count_nonzero(~there))
    if count:
        message = f"is {_first_of(count, 'row')} of zeros; such rows are not taxels and are left out"
        yield warning("no-taxel", str(locations[~there][0]), message, count)


def _unusable_names(draft: Draft) -> Iterator[Finding]:
    """Yield errors for labels and channels that are invalid or not unique."""
    locations = [draft.at(number) for number in draft.lines]
    for label, location in zip(draft.labels, locations):
        if not label or len(label) > MAX_LABEL_LENGTH or not label.isprintable():
            message = f"has the label {show(label)}; use 1 to {MAX_LABEL_LENGTH} printable characters"
            yield error("label", location, message, label)
    for channel, location in zip(draft.channels, locations):
        if not 0 <= channel <= MAX_CHANNEL:
            yield error("channel", location, f"has the channel {channel}; use 0 to {MAX_CHANNEL}", channel)
    # Without labels, channels are used as labels. Report only one of the two.
    yield from list(_repeats(draft.channels, locations, "channel")) or _repeats(draft.labels, locations, "label")


def _repeats(values: Sequence[str | int], locations: list[str], name: str) -> Iterator[Finding]:
    for location, value, earlier in repeated(zip(locations, values)):
        message = f"repeats the {name} {show(value)} of {earlier}; each taxel needs its own"
        yield error(f"duplicate-{name}", location, message, value)


def _distant_positions(locations: Locations, positions: Array) -> Iterator[Finding]:
    """Yield an error without any taxel, or with a taxel too far from the frame."""
    if len(locations) == 0:
        yield error("no-taxels", "", "contains only rows of zeros; check that it is the correct file")
        return
    distance = np.abs(positions).max(axis=1)
    row = int(distance.argmax())
    if distance[row] > MAX_TAXEL_DISTANCE:
        message = f"is {distance[row]:.6g} m from the frame; divide lengths by 1000 if they are in millimetres"
        yield error("units", str(locations[row]), message, positions[row].tolist())


def _overlong_vectors(locations: Locations, vectors: Array) -> Iterator[Finding]:
    """Yield an error for a direction that is too long."""
    component = np.abs(vectors).max(axis=1, initial=0)
    if (component > MAX_VECTOR_COMPONENT).any():
        row = int(component.argmax())
        message = f"has the component {component[row]:.6g} in a direction; the limit is {MAX_VECTOR_COMPONENT:g}"
        yield error("direction", str(locations[row]), message, vectors[row].tolist())


def _repeated_positions(locations: Locations, positions: Array) -> Iterator[Finding]:
    _, first, inverse = np.unique(np.round(positions / SAME_POSITION), axis=0, return_index=True, return_inverse=True)
    twin = first[inverse.reshape(-1)]
    again = np.flatnonzero(twin != np.arange(len(positions)))
    if len(again):
        message = (
            f"is {_first_of(len(again), 'taxel')} at the position of another one, that of {locations[twin[again[0]]]}"
        )
        yield warning("duplicate-position", str(locations[again[0]]), message, len(again))


def _directions(draft: Draft, locations: Locations, vectors: Array, name: str, placeholder: BoolArray) -> Array | None:
    """Return unit vectors, or None if some are missing; warnings go into the draft."""
    length = np.linalg.norm(vectors, axis=1)
    for code, what, chosen in (("placeholder", "a placeholder", placeholder), ("missing", "zeros", length == 0)):
        if chosen.any():
            row, count = int(np.argmax(chosen)), int(np.count_nonzero(chosen))
            message = (
                f"is {_first_of(count, 'taxel')} with {what} instead of a {name}; the {name}s of this file are not used"
            )
            draft.findings.append(warning(f"{code}-{name}s", str(locations[row]), message, count))
            return None
    wrong = np.flatnonzero(np.abs(length - 1) > NORMAL_LENGTH_TOLERANCE)
    if len(wrong):
        message = (
            f"is {_first_of(len(wrong), 'taxel')} whose {name} has length {length[wrong[0]]:.4g}; it is normalized"
        )
        draft.findings.append(warning(f"not-unit-{name}s", str(locations[wrong[0]]), message, len(wrong)))
    return unit(vectors)


def _placeholders(positions: Array, normals: Array) -> BoolArray:
    """Return which normals are placeholders: equal normals of taxels that are not in a plane."""
    same = (normals == normals[0]).all(axis=1)
    chosen = same if same.all() else (normals == PLACEHOLDER).all(axis=1)
    if not chosen.any():
        return chosen
    extent = float(np.linalg.norm(np.ptp(positions[chosen], axis=0)))
    depth = float(np.ptp(positions[chosen] @ unit(normals[chosen][0])))
    return chosen & (depth > max(FLAT_FRACTION * extent, SAME_POSITION))


def _first_of(count: int, what: str) -> str:
    return f"the only {what}" if count == 1 else f"the first of {count} {what}s"
