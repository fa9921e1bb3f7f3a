"""Taxels as another program's file gives them, and what is strange about them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from ...common.arrays import Array, BoolArray, IntArray, freeze, unit
from ...common.findings import Finding, error, first, show, warning
from ..model import MAX_CHANNEL

# No robot link reaches this far from its own frame [m]; a larger number is in millimetres.
MAX_TAXEL_DISTANCE = 5.0
MAX_LABEL_LENGTH = 200
# Two taxels nearer than this have one place [m]: files give six decimals.
SAME_POSITION = 1e-6
# The length of a normal may be off by this: files give three decimals and more.
NORMAL_LENGTH_TOLERANCE = 2e-3
MAX_VECTOR_COMPONENT = 1e6  # beyond scaling: no direction was meant
# What programs write for a normal that they do not have.
PLACEHOLDER = (1.0, 0.0, 0.0)
# Taxels with one normal lie in a plane across it, up to this share of their extent, or the normal is a placeholder.
FLAT_FRACTION = 0.1

Places = NDArray[np.str_]  # where each taxel stands in its file, in words


@dataclass(frozen=True, eq=False)
class TaxelSet:
    """Taxels of a file; row i of every field is the same taxel."""

    positions: Array  # (n, 3) [m], in ``frame``
    normals: Array | None  # (n, 3) unit; None where the file has none or fillers. They may point inwards
    labels: tuple[str, ...]  # stable names, no two alike
    channels: IntArray  # (n,) position of the taxel in a reading
    frame: str | None  # as the file names it; None where it names none
    neighbours: tuple[tuple[str, ...], ...] | None = None  # labels; None where the file has none
    tangents: Array | None = None  # (n, 3) unit, x axes of the taxels; None where the file has none
    findings: tuple[Finding, ...] = ()  # warnings: what was left out, what a person should look at

    def __post_init__(self):
        n = len(self.labels)
        vectors = [name for name in ("normals", "tangents") if getattr(self, name) is not None]
        freeze(self, positions=(n, 3), channels=(n,), **{name: (n, 3) for name in vectors})
        if self.neighbours is not None and len(self.neighbours) != n:
            raise ValueError(f"TaxelSet.neighbours has {len(self.neighbours)} rows, expected {n}")

    def moved(self, rotation: Array, translation: Array) -> "TaxelSet":
        """The same taxels after ``rotation @ p + translation`` [m], in a frame that the file does not name."""
        R = np.asarray(rotation, float)
        return replace(
            self,
            positions=self.positions @ R.T + translation,
            normals=None if self.normals is None else unit(self.normals @ R.T),
            tangents=None if self.tangents is None else unit(self.tangents @ R.T),
            frame=None,
        )


def line(number: int) -> str:
    """A place in a text file, for a finding; lines count from one."""
    return f"line {number}"


@dataclass
class Draft:
    """What a reader has found so far; row i of every list is the same taxel.

    A format without channels leaves them empty: the place of a taxel among those that are kept is its channel.
    """

    lines: list[int] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    channels: list[int] = field(default_factory=list)
    positions: list[tuple[float, ...]] = field(default_factory=list)  # [m]
    normals: list[tuple[float, ...]] | None = None
    tangents: list[tuple[float, ...]] | None = None
    neighbours: list[tuple[str, ...]] | None = None
    links: list[str] = field(default_factory=list)  # the link of each, where a file has those of many
    frame: str | None = None
    findings: list[Finding] = field(default_factory=list)
    at: Callable[[int], str] = line  # what a number in ``lines`` is called in a finding

    @property
    def broken(self) -> bool:
        """Whether the file cannot be used."""
        return any(finding.severity == "error" for finding in self.findings)

    def keep(self, rows: Sequence[int]) -> None:
        """Drop all taxels but these."""
        for name in ("lines", "labels", "channels", "positions", "normals", "tangents", "neighbours", "links"):
            column = getattr(self, name)
            if column:
                setattr(self, name, [column[i] for i in rows])


def finished(draft: Draft, only: str | None = None) -> tuple[TaxelSet | None, tuple[Finding, ...]]:
    """The taxel set of what a reader has found, None if it cannot be used, and everything found.

    With a pattern of file names in ``only``, taxels whose label does not match it are left out.
    """
    if not draft.broken:
        _choose(draft, only)
    if not draft.broken:
        draft.findings += first(_unusable_names(draft))
    if draft.broken:
        return None, tuple(draft.findings)
    places, positions = np.array([draft.at(number) for number in draft.lines]), _vectors(draft.positions)
    normals, tangents = (None if rows is None else _vectors(rows) for rows in (draft.normals, draft.tangents))
    there = positions.any(axis=1) if normals is None else positions.any(axis=1) | normals.any(axis=1)
    draft.findings += _left_out(places, there)
    chosen = np.flatnonzero(there)
    places, positions = places[chosen], positions[chosen]
    draft.findings += _distant_positions(places, positions)
    for vectors in (normals, tangents):
        draft.findings += () if vectors is None else _overlong_vectors(places, vectors[chosen])
    if draft.broken:
        return None, tuple(draft.findings)
    draft.findings += _repeated_positions(places, positions)
    if normals is not None:
        normals = _directions(draft, places, normals[chosen], "normal", _placeholders(positions, normals[chosen]))
    if tangents is not None:
        tangents = _directions(draft, places, tangents[chosen], "tangent", np.zeros(len(chosen), bool))
    taxels = TaxelSet(
        positions=positions,
        normals=normals,
        labels=tuple(draft.labels[i] for i in chosen),
        channels=np.array(draft.channels, np.int64)[chosen],
        frame=draft.frame,
        neighbours=None if draft.neighbours is None else tuple(draft.neighbours[i] for i in chosen),
        tangents=tangents,
        findings=tuple(draft.findings),
    )
    return taxels, taxels.findings


def _choose(draft: Draft, only: str | None) -> None:
    """Keep the taxels that are asked for, which must hang on one link, and give those channels that have none."""
    if only is not None:
        rows = [i for i, label in enumerate(draft.labels) if fnmatchcase(label, only)]
        if not rows:
            message = f"has no taxel whose label matches {show(only)}; the first is called {show(draft.labels[0])}"
            draft.findings.append(error("no-taxels", "", message, only))
            return
        draft.keep(rows)
    links = list(dict.fromkeys(draft.links))
    if len(links) > 1:
        i = draft.links.index(links[1])
        message = f"hangs {show(draft.labels[i])} on {show(links[1])}, those before on {show(links[0])}; pick the "
        message += 'taxels of one link by their labels (--only, or "only" in a plan)'
        draft.findings.append(error("links", draft.at(draft.lines[i]), message, links))
    draft.frame = links[0] if links else draft.frame
    draft.channels = draft.channels or list(range(len(draft.labels)))


def _vectors(rows: list[tuple[float, ...]]) -> Array:
    return np.array(rows, float).reshape(len(rows), 3)


def _left_out(places: Places, there: BoolArray) -> Iterator[Finding]:
    count = int(np.count_nonzero(~there))
    if count:
        message = f"is {_first_of(count, 'row')} of zeros, which stand for no taxel: left out"
        yield warning("no-taxel", str(places[~there][0]), message, count)


def _unusable_names(draft: Draft) -> Iterator[Finding]:
    """Labels and channels that are unusable or not unique."""
    places = [draft.at(number) for number in draft.lines]
    for label, place in zip(draft.labels, places):
        if not label or len(label) > MAX_LABEL_LENGTH or not label.isprintable():
            message = f"has the label {show(label)}; use 1 to {MAX_LABEL_LENGTH} printable characters"
            yield error("label", place, message, label)
    for channel, place in zip(draft.channels, places):
        if not 0 <= channel <= MAX_CHANNEL:
            yield error("channel", place, f"has the channel {channel}; use 0 to {MAX_CHANNEL}", channel)
    # Where there are no labels, a channel is one: it would be told twice.
    yield from list(_repeats(draft.channels, places, "channel")) or _repeats(draft.labels, places, "label")


def _repeats(values: Sequence[str | int], places: list[str], name: str) -> Iterator[Finding]:
    seen: dict[str | int, str] = {}
    for value, place in zip(values, places):
        if value in seen:
            message = f"repeats the {name} {show(value)} of {seen[value]}; each taxel needs its own"
            yield error(f"duplicate-{name}", place, message, value)
        else:
            seen[value] = place


def _distant_positions(places: Places, positions: Array) -> Iterator[Finding]:
    """No taxel at all, or one too far away."""
    if len(places) == 0:
        yield error("no-taxels", "", "holds nothing but rows of zeros; check that it is the right file")
        return
    distance = np.abs(positions).max(axis=1)
    row = int(distance.argmax())
    if distance[row] > MAX_TAXEL_DISTANCE:
        message = f"lies {distance[row]:.6g} m from the frame; divide by 1000 if these are millimetres"
        yield error("units", str(places[row]), message, positions[row].tolist())


def _overlong_vectors(places: Places, vectors: Array) -> Iterator[Finding]:
    """A direction too long to be one."""
    distance = np.abs(vectors).max(axis=1, initial=0)
    if (distance > MAX_VECTOR_COMPONENT).any():
        row = int(distance.argmax())
        yield error("direction", str(places[row]), f"holds {distance[row]:.6g} in a direction", vectors[row].tolist())


def _repeated_positions(places: Places, positions: Array) -> Iterator[Finding]:
    _, first, inverse = np.unique(np.round(positions / SAME_POSITION), axis=0, return_index=True, return_inverse=True)
    twin = first[inverse.reshape(-1)]
    again = np.flatnonzero(twin != np.arange(len(positions)))
    if len(again):
        message = f"is {_first_of(len(again), 'taxel')} in the place of another, that of {places[twin[again[0]]]}"
        yield warning("duplicate-position", str(places[again[0]]), message, len(again))


def _directions(draft: Draft, places: Places, vectors: Array, name: str, placeholder: BoolArray) -> Array | None:
    """Unit vectors, or None where not all can be relied on; what is strange about them goes into the draft."""
    length = np.linalg.norm(vectors, axis=1)
    for code, what, chosen in (("placeholder", "a placeholder", placeholder), ("missing", "zeros", length == 0)):
        if chosen.any():
            row, count = int(np.argmax(chosen)), int(np.count_nonzero(chosen))
            message = f"is {_first_of(count, 'taxel')} with {what} for a {name}; no {name} of the file is used"
            draft.findings.append(warning(f"{code}-{name}s", str(places[row]), message, count))
            return None
    off = np.flatnonzero(np.abs(length - 1) > NORMAL_LENGTH_TOLERANCE)
    if len(off):
        message = f"is {_first_of(len(off), 'taxel')} whose {name} is not unit but {length[off[0]]:.4g} long: scaled"
        draft.findings.append(warning(f"not-unit-{name}s", str(places[off[0]]), message, len(off)))
    return unit(vectors)


def _placeholders(positions: Array, normals: Array) -> BoolArray:
    """Which normals are placeholders: one direction for taxels that do not lie in a plane across it."""
    same = (normals == normals[0]).all(axis=1)
    chosen = same if same.all() else (normals == PLACEHOLDER).all(axis=1)
    if not chosen.any():
        return chosen
    extent = float(np.linalg.norm(np.ptp(positions[chosen], axis=0)))
    depth = float(np.ptp(positions[chosen] @ unit(normals[chosen][0])))
    return chosen & (depth > max(FLAT_FRACTION * extent, SAME_POSITION))


def _first_of(count: int, what: str) -> str:
    return f"the only {what}" if count == 1 else f"the first of {count} {what}s"
