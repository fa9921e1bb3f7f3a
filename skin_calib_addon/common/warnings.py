"""Warnings about a result: one record for fits, skins, meshes, responses and touches."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any, Literal

from .arrays import Array
from .errors import millimetres
from .findings import printable

Severity = Literal["error", "warning", "note"]

SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")  # from the worst
# Codes of a fit and of its skins, from the worst, within a severity; all other codes are after them.
ORDER = (
    "outdated-proposal",  # all of it is of another mesh
    "moved-object",  # or in another place
    "scaled-object",
    "moved-mesh",
    # the surface is wrong
    "folded",
    "off-mesh",
    "not-converged",
    "nearly-folded",
    "undercut",
    "inner-part",
    "missing-samples",
    "outside-outline",
    "planes-nearly-parallel",
    # taxels are wrong
    "overlap",
    "skins-overlap",
    "over-hole",
    "oblique",
    "strain",
    "overhang",
    "board-gap",
    "board-overhang",
    "empty-group",
    "placed-anew",
    "no-uncertainty",
    # what the fit leaves out
    "short-surface",
    "dropped-curves",
    "outlier-vertices",
    "chords-refused",
    "nearly-symmetric",
)


@dataclass(frozen=True)
class Place:
    """Where a warning applies; unknown fields are empty."""

    point: tuple[float, float, float] | None = None  # [m], link frame
    names: str = ""  # planes, lines or rows near the point, by the names in the window
    skin: str = ""  # name of the skin
    taxels: tuple[str, ...] = ()  # ids, the most affected one first
    surface: str = ""  # its name, if the link has several; files have it in the message
    normal: tuple[float, float, float] | None = None  # outward, of the face that a refusal proposes; not in files

    @property
    def words(self) -> str:
        """Return point and names for a message, such as "at (0.0, 0.0, 80.0) mm, near u-plane 3"."""
        at = f"at {millimetres(self.point)}" if self.point is not None else ""
        near = f"near {self.names}" if self.names else ""
        return ", ".join(part for part in (at, near) if part)


NOWHERE = Place()


@dataclass(frozen=True)
class Warning:
    """One problem of a result: what, where, how large, and what to do."""

    code: str
    severity: Severity
    message: str
    where: Place = NOWHERE
    value: float | None = None
    advice: str = ""

    def __str__(self) -> str:
        """Return message, advice and code on one line."""
        return printable(f"{self.message} {self.advice}".strip()) + f" [{self.code}]"


def worst_first(warnings: Iterable[Warning]) -> list[Warning]:
    """Return warnings by their severity, and of one severity by ``ORDER``; otherwise in the order that they have."""
    rank = {code: k for k, code in enumerate(ORDER)}
    return sorted(warnings, key=lambda w: (SEVERITIES.index(w.severity), rank.get(w.code, len(ORDER))))


def point_of(vector: Array) -> tuple[float, float, float]:
    """Return a point or a direction (3,) as a tuple of floats, for records."""
    x, y, z = (float(c) for c in vector)
    return x, y, z


def to_document(warnings: Iterable[Warning]) -> list[dict[str, Any]]:
    """Convert warnings to JSON values; a value that is not finite becomes null."""
    documents = []
    for warning in warnings:
        place = warning.where
        where: dict[str, Any] = {} if place.point is None else {"point": [float(x) for x in place.point]}
        where |= {name: text for name, text in (("names", place.names), ("skin", place.skin)) if text}
        where |= {"taxels": list(place.taxels)} if place.taxels else {}
        value = None if warning.value is None or not isfinite(warning.value) else float(warning.value)
        documents.append(asdict(warning) | {"where": where, "value": value})
    return documents


def from_document(documents: Iterable[dict[str, Any]]) -> tuple[Warning, ...]:
    """Return the warnings of JSON values that `to_document` made."""
    found = []
    for document in documents:
        where = document["where"]
        place = Place(
            point=tuple(where["point"]) if "point" in where else None,
            names=where.get("names", ""),
            skin=where.get("skin", ""),
            taxels=tuple(where.get("taxels", ())),
        )
        found.append(Warning(**{**document, "where": place}))
    return tuple(found)
