"""Valid members of the surfaces and patches of a document that may have errors."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..common.findings import Finding, child

# Relative rounding of stored numbers: of lengths of unit vectors, knots, seams, sums of distances, and forces.
# Larger: less exact files pass, and simpler responses count as exact.
STORED_ROUNDING = 1e-9
NUMERIC = ("degree", "control_net", "pitch", "channel", "position", "normal", "tangent", "corners", "area", "response")


@dataclass(frozen=True, eq=False)
class Part:
    """A surface, or a patch together with its taxel columns."""

    pointer: str
    members: dict[str, Any]
    columns: frozenset[str]  # the members that belong to ``taxels``

    def at(self, name: str, *keys: Any) -> str:
        """Return the pointer to a member."""
        return child(self.pointer, *(("taxels",) if name in self.columns else ()), name, *keys)

    def as_arrays(self) -> "Part":
        """Return a copy with arrays for the numeric members, whose lengths must be valid."""
        arrays = {name: np.array(self.members[name], float) for name in NUMERIC if name in self.members}
        return Part(self.pointer, {**self.members, **arrays}, self.columns)


def parts_of(document: Any, name: str, findings: Iterable[Finding]) -> list[Part]:
    """Return the surfaces or patches of a document, without members that have findings."""
    items = document.get(name) if isinstance(document, dict) else None
    if not isinstance(items, list) or any(finding.pointer == f"/{name}" for finding in findings):
        return [Part(f"/{name}", {}, frozenset())]
    touched = pointers_with_findings(findings)
    parts = []
    for index, item in enumerate(items):
        pointer = child("", name, index)
        columns = _sound(item.get("taxels"), pointer + "/taxels", touched) if isinstance(item, dict) else {}
        parts.append(Part(pointer, {**_sound(item, pointer, touched), **columns}, frozenset(columns)))
    return parts


def items_of(document: Any, name: str) -> list[Any]:
    """Return a list that is a member of a document; an empty one if the document has none."""
    items = document.get(name) if isinstance(document, dict) else None
    return items if isinstance(items, list) else []


def sound_items(document: Any, name: str, findings: Iterable[Finding]) -> Iterator[tuple[str, Any]]:
    """Yield pointer and value of each item without findings in a list of a document."""
    wrong = pointers_with_findings(findings)
    for index, item in enumerate(items_of(document, name)):
        if (pointer := child("", name, index)) not in wrong:
            yield pointer, item


def needs(*names: str) -> Callable[[Callable[..., Iterable[Finding]]], Callable[[Part], Iterator[Finding]]]:
    """Turn a check of members into a check of a part that is skipped if a member is missing or invalid."""

    def wrap(check: Callable[..., Iterable[Finding]]) -> Callable[[Part], Iterator[Finding]]:
        def run(part: Part) -> Iterator[Finding]:
            if part.members.keys() >= set(names):
                yield from check(part, *(part.members[name] for name in names))

        return run

    return wrap


def pointers_with_findings(findings: Iterable[Finding]) -> set[str]:
    """Return the pointers of all findings and of all members that contain them."""
    return {pointer for finding in findings for pointer in _ancestors(finding.pointer)}


def _sound(value: Any, pointer: str, touched: set[str]) -> dict[str, Any]:
    members = value.items() if isinstance(value, dict) else ()
    return {name: member for name, member in members if child(pointer, name) not in touched}


def _ancestors(pointer: str) -> Iterator[str]:
    while pointer:
        yield pointer
        pointer = pointer.rpartition("/")[0]
