"""Taxels as another program's file gives them, and what is strange about them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...arrays import Array, BoolArray, IntArray, freeze, unit
from ..findings import Finding, error, first, show, warning

# No robot link reaches this far from its own frame [m]; a larger number is in millimetres.
FARTHEST = 5.0
HIGHEST_CHANNEL = 2**31 - 1
LONGEST_LABEL = 200
# Two taxels nearer than this have one place [m]: files give six decimals.
ONE_PLACE = 1e-6
# The length of a normal may be off by this: files give three decimals and more.
UNIT = 2e-3
LONGEST = 1e6  # beyond scaling: no direction was meant
# What programs write for a normal that they do not have.
FILLER = (1.0, 0.0, 0.0)
# Taxels with one normal lie in a plane across it, up to this share of their extent, or the normal is a filler.
FLAT = 0.1


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


@dataclass
class Draft:
    """What a reader has found so far; row i of every list is the same taxel."""

    lines: list[int] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    channels: list[int] = field(default_factory=list)
    positions: list[tuple[float, ...]] = field(default_factory=list)  # [m]
    normals: list[tuple[float, ...]] | None = None
    tangents: list[tuple[float, ...]] | None = None
    neighbours: list[tuple[str, ...]] | None = None
    frame: str | None = None
    findings: list[Finding] = field(default_factory=list)

    @property
    def broken(self) -> bool:
        """Whether the file cannot be used."""
        return any(finding.severity == "error" for finding in self.findings)


def line(number: int) -> str:
    """A place in a text file, for a finding; lines count from one."""
    return f"line {number}"


def finished(draft: Draft) -> tuple[TaxelSet | None, tuple[Finding, ...]]:
    """The taxel set of what a reader has found, None if it cannot be used, and everything found."""
    if not draft.broken:
        draft.findings += first(_misnamed(draft))
    if draft.broken:
        return None, tuple(draft.findings)
    lines, positions = np.array(draft.lines, np.int64), _vectors(draft.positions)
    normals, tangents = (None if rows is None else _vectors(rows) for rows in (draft.normals, draft.tangents))
    there = positions.any(axis=1) if normals is None else positions.any(axis=1) | normals.any(axis=1)
    draft.findings += _left_out(lines, there)
    chosen = np.flatnonzero(there)
    lines, positions = lines[chosen], positions[chosen]
    draft.findings += _misplaced(lines, positions)
    for vectors in (normals, tangents):
        draft.findings += () if vectors is None else _absurd(lines, vectors[chosen])
    if draft.broken:
        return None, tuple(draft.findings)
    draft.findings += _shared_places(lines, positions)
    if normals is not None:
        normals = _directions(draft, lines, normals[chosen], "normal", _fillers(positions, normals[chosen]))
    if tangents is not None:
        tangents = _directions(draft, lines, tangents[chosen], "tangent", np.zeros(len(chosen), bool))
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


def _vectors(rows: list[tuple[float, ...]]) -> Array:
    return np.array(rows, float).reshape(len(rows), 3)


def _left_out(lines: IntArray, there: BoolArray) -> Iterator[Finding]:
    count = int(np.count_nonzero(~there))
    if count:
        message = f"is {_first_of(count, 'row')} of zeros, which stand for no taxel: left out"
        yield warning("no-taxel", line(int(lines[~there][0])), message, count)


def _misnamed(draft: Draft) -> Iterator[Finding]:
    """Labels and channels that are unusable or not unique."""
    for label, number in zip(draft.labels, draft.lines):
        if not label or len(label) > LONGEST_LABEL or not label.isprintable():
            message = f"has the label {show(label)}; use 1 to {LONGEST_LABEL} printable characters"
            yield error("label", line(number), message, label)
    for channel, number in zip(draft.channels, draft.lines):
        if not 0 <= channel <= HIGHEST_CHANNEL:
            yield error("channel", line(number), f"has the channel {channel}; use 0 to {HIGHEST_CHANNEL}", channel)
    # Where there are no labels, a channel is one: it would be told twice.
    yield from list(_repeats(draft.channels, draft.lines, "channel")) or _repeats(draft.labels, draft.lines, "label")


def _repeats(values: Sequence[str | int], lines: list[int], name: str) -> Iterator[Finding]:
    seen: dict[str | int, int] = {}
    for value, number in zip(values, lines):
        if seen.setdefault(value, number) != number:
            message = f"repeats the {name} {show(value)} of line {seen[value]}; each taxel needs its own"
            yield error(f"duplicate-{name}", line(number), message, value)


def _misplaced(lines: IntArray, positions: Array) -> Iterator[Finding]:
    """No taxel at all, or one too far away."""
    if len(lines) == 0:
        yield error("no-taxels", "", "holds nothing but rows of zeros; check that it is the right file")
        return
    reach = np.abs(positions).max(axis=1)
    row = int(reach.argmax())
    if reach[row] > FARTHEST:
        message = f"lies {reach[row]:.6g} m from the frame; divide by 1000 if these are millimetres"
        yield error("units", line(int(lines[row])), message, positions[row].tolist())


def _absurd(lines: IntArray, vectors: Array) -> Iterator[Finding]:
    """A direction too long to be one."""
    reach = np.abs(vectors).max(axis=1, initial=0)
    if (reach > LONGEST).any():
        row = int(reach.argmax())
        yield error("direction", line(int(lines[row])), f"holds {reach[row]:.6g} in a direction", vectors[row].tolist())


def _shared_places(lines: IntArray, positions: Array) -> Iterator[Finding]:
    _, first, inverse = np.unique(np.round(positions / ONE_PLACE), axis=0, return_index=True, return_inverse=True)
    twin = first[inverse.reshape(-1)]
    again = np.flatnonzero(twin != np.arange(len(positions)))
    if len(again):
        message = f"is {_first_of(len(again), 'taxel')} in the place of another, that of line {lines[twin[again[0]]]}"
        yield warning("duplicate-position", line(int(lines[again[0]])), message, len(again))


def _directions(draft: Draft, lines: IntArray, vectors: Array, name: str, filler: BoolArray) -> Array | None:
    """Unit vectors, or None where not all can be relied on; what is strange about them goes into the draft."""
    length = np.linalg.norm(vectors, axis=1)
    for code, what, chosen in (("placeholder", "a placeholder", filler), ("missing", "zeros", length == 0)):
        if chosen.any():
            row, count = int(np.argmax(chosen)), int(np.count_nonzero(chosen))
            message = f"is {_first_of(count, 'taxel')} with {what} for a {name}; no {name} of the file is used"
            draft.findings.append(warning(f"{code}-{name}s", line(int(lines[row])), message, count))
            return None
    off = np.flatnonzero(np.abs(length - 1) > UNIT)
    if len(off):
        message = f"is {_first_of(len(off), 'taxel')} whose {name} is not unit but {length[off[0]]:.4g} long: scaled"
        draft.findings.append(warning(f"not-unit-{name}s", line(int(lines[off[0]])), message, len(off)))
    return unit(vectors)


def _fillers(positions: Array, normals: Array) -> BoolArray:
    """Which normals are placeholders: one direction for taxels that do not lie in a plane across it."""
    same = (normals == normals[0]).all(axis=1)
    chosen = same if same.all() else (normals == FILLER).all(axis=1)
    if not chosen.any():
        return chosen
    extent = float(np.linalg.norm(np.ptp(positions[chosen], axis=0)))
    depth = float(np.ptp(positions[chosen] @ unit(normals[chosen][0])))
    return chosen & (depth > max(FLAT * extent, ONE_PLACE))


def _first_of(count: int, what: str) -> str:
    return f"the only {what}" if count == 1 else f"the first of {count} {what}s"
