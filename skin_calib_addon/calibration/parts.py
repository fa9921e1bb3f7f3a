"""The surfaces and patches of a document that may be wrong: of each, only the members that are sound so far."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..common.findings import Finding, child

NUMERIC = ("degree", "control_net", "pitch", "channel", "position", "normal", "tangent", "corners", "area", "response")


@dataclass(frozen=True, eq=False)
class Part:
    """A surface, or a patch together with its taxel columns."""

    pointer: str
    members: dict[str, Any]
    columns: frozenset[str]  # the members that stand in ``taxels``

    def at(self, name: str, *keys: Any) -> str:
        """The pointer to a member, or further into it."""
        return child(self.pointer, *(("taxels",) if name in self.columns else ()), name, *keys)

    def as_arrays(self) -> "Part":
        """The same with arrays for the numeric members, once their lengths are known to fit."""
        arrays = {name: np.array(self.members[name], float) for name in NUMERIC if name in self.members}
        return Part(self.pointer, {**self.members, **arrays}, self.columns)


def parts_of(document: Any, name: str, findings: Iterable[Finding]) -> list[Part]:
    """The surfaces or the patches of a document, without every member in which something was found.

    A list that is itself unsound counts as one part without members, so that nobody takes it for an empty list.
    """
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


def needs(*names: str) -> Callable[[Callable[..., Iterable[Finding]]], Callable[[Part], Iterator[Finding]]]:
    """Make a check of these members into one of a part: silent where one of them is missing or unsound."""

    def wrap(check: Callable[..., Iterable[Finding]]) -> Callable[[Part], Iterator[Finding]]:
        def run(part: Part) -> Iterator[Finding]:
            if part.members.keys() >= set(names):
                yield from check(part, *(part.members[name] for name in names))

        return run

    return wrap


def pointers_with_findings(findings: Iterable[Finding]) -> set[str]:
    """The pointers to everything in which, or further into which, something was found."""
    return {place for finding in findings for place in _ancestors(finding.pointer)}


def _sound(value: Any, pointer: str, touched: set[str]) -> dict[str, Any]:
    members = value.items() if isinstance(value, dict) else ()
    return {name: member for name, member in members if child(pointer, name) not in touched}


def _ancestors(pointer: str) -> Iterator[str]:
    while pointer:
        yield pointer
        pointer = pointer.rpartition("/")[0]
