"""Difference of two calibrations of one link: taxels, channels, places, normals, responses, and other members."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..calibration.file import to_document
from ..calibration.model import LinkCalibration
from ..calibration.response import AnyResponse
from ..calibration.taxel_responses import responses_of
from ..common.arrays import Array
from ..common.errors import counted, listed
from .all_taxels import AllTaxels
from .comparison import angles_between, best_motion, in_mm, in_words

MIN_FOR_MOTION = 3  # Derived: fewer points do not define a motion
SEPARATE = {"checksum", "patches", "response", "responses"}  # members whose content has its own lines
OWN_LINE = {"id", "channel", "position", "normal", "response"}  # columns of taxels that have one


@dataclass(frozen=True, eq=False)
class Difference:
    """What distinguishes calibration B from A; taxels are paired by their ids, row i of every array is the same one."""

    links: tuple[str, str]
    counts: tuple[int, int]
    added: tuple[str, ...]
    removed: tuple[str, ...]
    renumbered: tuple[tuple[str, int, int], ...]  # id, channel of A, channel of B
    common: tuple[str, ...]
    distances: Array  # (m,) moved [m]
    edges: Array  # (m,) how far the turn of the normal moves the edge of the cell [m]
    angles: Array  # (m,) between the normals [rad]
    motion: tuple[Array, Array] | None  # rotation (3, 3) and shift (3,) [m] that bring A to B; None if too few taxels
    remaining: Array  # (m,) distances after it [m]
    responses: tuple[str, ...]  # ids of taxels with another response
    others: tuple[str, ...]  # further members of the files that differ

    def beyond(self, tolerance: float) -> list[str]:
        """Return why the taxels differ by more than a tolerance [m]: an empty list if they do not."""
        moved, turned = np.count_nonzero(self.distances > tolerance), np.count_nonzero(self.edges > tolerance)
        numbers = {
            "added": len(self.added),
            "removed": len(self.removed),
            "renumbered": len(self.renumbered),
            "moved": int(moved),
            "turned": int(turned),
            "with another response": len(self.responses),
        }
        reasons = [f"{counted(number, 'taxel')} {what}" for what, number in numbers.items() if number]
        return reasons if self.links[0] == self.links[1] else ["another link", *reasons]

    def lines(self) -> list[str]:
        """Return the difference as lines for a person."""
        a, b = self.links
        lines = [f"link             {a}" if a == b else f"link             {a} and {b}, which are different links"]
        lines.append(f"taxels           {self.counts[0]} and {self.counts[1]}, {len(self.common)} in both by their ids")
        lines += _list("added", self.added) + _list("removed", self.removed)
        lines += _list("renumbered", [f"{name} from channel {i} to {j}" for name, i, j in self.renumbered])
        if self.common:
            lines += [self._line("moved", self.distances, in_mm), self._line("normals", self.angles, _degrees)]
        if self.motion is not None and self.distances.any():
            left = f"mean {in_mm(self.remaining.mean())}, maximum {in_mm(self.remaining.max())}"
            lines.append(f"best motion      {in_words(*self.motion, digits=3)}; it leaves {left}")
        lines += _list("other response", self.responses)
        if self.others:
            lines.append(f"also different   {', '.join(self.others)}")
        return lines

    def _line(self, name: str, values: Array, words: Any) -> str:
        most = int(values.argmax())
        at = f" ({self.common[most]})" if values[most] else ""
        return f"{name:16} mean {words(values.mean())}, maximum {words(values[most])}{at}"


def differ(a: LinkCalibration, b: LinkCalibration) -> Difference:
    """Return the difference of two calibrations."""
    ours, theirs = AllTaxels.of(a.patches), AllTaxels.of(b.patches)
    common = tuple(name for name in ours.ids if name in theirs.rows)
    i, j = ([taxels.rows[name] for name in common] for taxels in (ours, theirs))
    before, after = ours.positions[i], theirs.positions[j]
    motion = best_motion(before, after) if len(common) >= MIN_FOR_MOTION else None
    turned = before if motion is None else before @ motion[0].T + motion[1]
    angles = angles_between(ours.normals[i], theirs.normals[j])
    channels = zip(common, ours.channels[i].tolist(), theirs.channels[j].tolist())
    of_a, of_b = _responses(a), _responses(b)
    return Difference(
        links=(a.link, b.link),
        counts=(len(ours.ids), len(theirs.ids)),
        added=tuple(name for name in theirs.ids if name not in ours.rows),
        removed=tuple(name for name in ours.ids if name not in theirs.rows),
        renumbered=tuple((name, x, y) for name, x, y in channels if x != y),
        common=common,
        distances=np.linalg.norm(after - before, axis=1),
        edges=np.sin(angles / 2) * np.sqrt(ours.areas[i]),  # the chord of the angle at half the side of a square
        angles=angles,
        motion=motion,
        remaining=np.linalg.norm(after - turned, axis=1),
        responses=tuple(name for name, x, y in zip(common, i, j) if of_a[x] != of_b[y]),
        others=_others(to_document(a), to_document(b), set(common)),
    )


def _responses(calibration: LinkCalibration) -> list[AnyResponse]:
    """Return the response of each taxel."""
    responses, index = responses_of(calibration)
    return [responses[k] for k in index.tolist()]


def _others(a: dict[str, Any], b: dict[str, Any], common: set[str]) -> tuple[str, ...]:
    """Return the names of members that differ and have no line of their own."""
    names = [name for name in {**a, **b} if name not in SEPARATE and a.get(name) != b.get(name)]
    patches_a, patches_b = ([dict(p, taxels=None) for p in document["patches"]] for document in (a, b))
    names += ["patches"] if patches_a != patches_b else []
    columns_a, columns_b = _columns(a), _columns(b)
    empty: dict[str, Any] = {}
    for name in {**columns_a, **columns_b}:
        x, y = columns_a.get(name, empty), columns_b.get(name, empty)
        if name not in OWN_LINE and any(x.get(taxel) != y.get(taxel) for taxel in common):
            names.append(f"{name} of taxels")
    return tuple(names)


def _columns(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the columns of the taxels of all patches, each by ids."""
    columns: dict[str, dict[str, Any]] = {}
    for patch in document["patches"]:
        for name, values in patch["taxels"].items():
            columns.setdefault(name, {}).update(zip(patch["taxels"]["id"], values))
    return columns


def _list(name: str, words: Sequence[str]) -> list[str]:
    return [f"{name:16} {len(words)}: {listed(words)}"] if words else []


def _degrees(angle: float) -> str:
    return f"{round(float(np.rad2deg(angle)), 4):.3g}°"
