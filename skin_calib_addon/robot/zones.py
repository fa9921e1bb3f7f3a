"""Zones of a robot that stay without skin: connectors, vents, screws. All proposals respect them.

They are in ``NAME.zones.json`` next to the URDF or mesh of this name.
"""

import json
import os.path
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..common.arrays import Array, BoolArray
from ..common.atomic_file import write_bytes_safely
from ..common.errors import InvalidPlan, UnknownLink
from ..common.findings import did_you_mean, show
from ..common.schema_check import check
from ..common.strict_json import parse, read
from .link_mesh import is_urdf
from .urdf import read_robot

ENDING = ".zones.json"  # Contract: of the file
POINT = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
NAMED = {"link": {"type": "string", "minLength": 1}, "name": {"type": "string", "minLength": 1}}
# Format: members of each kind of zone, all of them required; lengths in metres, in the frame of the link.
KINDS: dict[str, dict[str, Any]] = {
    "sphere": {"center": POINT, "radius": {"type": "number", "minimum": 1e-4, "maximum": 10}},
    "box": {"low": POINT, "high": POINT},
    "half-space": {"point": POINT, "normal": POINT},
}
DOCUMENT = {
    "type": "object",
    "properties": {
        "format": {"const": "skin-zones"},
        "version": {"const": 1},
        "zones": {"type": "array", "items": {"type": "object"}},
    },
    "required": ["format", "version", "zones"],
    "additionalProperties": False,
}


@dataclass(frozen=True)
class LinkZone:
    """A part of space, in the frame of a link, without skin."""

    link: str
    name: str
    kind: str
    numbers: dict[str, Any]  # as in ``KINDS`` [m]

    def contains(self, points: Array) -> BoolArray:
        """Return which points (k, 3) [m] are in it; a half-space is on the side of its normal."""
        n = {name: np.array(value, float) for name, value in self.numbers.items()}
        if self.kind == "sphere":
            inside: BoolArray = np.linalg.norm(points - n["center"], axis=1) <= n["radius"]
        elif self.kind == "box":
            inside = ((points >= n["low"]) & (points <= n["high"])).all(axis=1)
        else:
            inside = (points - n["point"]) @ n["normal"] >= 0
        return inside


def zones_file(file: Path) -> Path:
    """Return the path of the zones of a URDF or mesh."""
    return file.with_name(f"{file.stem}{ENDING}")


def load_zones(file: Path, link: str = "") -> tuple[LinkZone, ...]:
    """Return the zones of a URDF or mesh, of all links or of one; none without a file.

    Raise `InvalidPlan` where the file is wrong, and `UnknownLink` for a link that the robot does not have.
    """
    path = zones_file(file)
    if not os.path.isfile(path):
        return ()
    document, findings = parse(read(path))
    for finding in findings or check(document, DOCUMENT):
        raise InvalidPlan(f"{path.name}: {finding}")
    return tuple(zone for zone in _zones(file, document) if link in ("", zone.link))


def save_zones(file: Path, zones: Iterable[LinkZone]) -> None:
    """Write all zones of a URDF or mesh in one step; raise what `load_zones` raises, and then write nothing."""
    own = [{"link": z.link, "name": z.name, "kind": z.kind, **z.numbers} for z in zones]
    document = {"format": "skin-zones", "version": 1, "zones": own}
    _zones(file, document)
    write_bytes_safely(zones_file(file), (json.dumps(document, indent=2, ensure_ascii=False) + "\n").encode())


def _zones(file: Path, document: dict[str, Any]) -> tuple[LinkZone, ...]:
    links = tuple(read_robot(file).links) if is_urdf(file) else (file.stem,)
    return tuple(_zone(zones_file(file).name, k, zone, links) for k, zone in enumerate(document["zones"]))


def _zone(name: str, number: int, zone: dict[str, Any], links: tuple[str, ...]) -> LinkZone:
    kind, place = zone.get("kind"), f"{name}: /zones/{number}"
    if kind not in KINDS:
        raise InvalidPlan(f"{place} has the kind {show(kind)}. Use one of {', '.join(KINDS)}.")
    members = NAMED | {"kind": {"const": kind}} | KINDS[kind]
    schema = {"type": "object", "properties": members, "required": list(members), "additionalProperties": False}
    for finding in check(zone, schema):
        raise InvalidPlan(f"{place}{finding}")
    if zone["link"] not in links:
        raise UnknownLink(f"{place} names the link {show(zone['link'])}{did_you_mean(zone['link'], links)}")
    numbers = {member: zone[member] for member in KINDS[kind]}
    if kind == "box" and not all(a < b for a, b in zip(zone["low"], zone["high"])):
        raise InvalidPlan(f"{place} has a low corner that is not below the high one. Swap the numbers.")
    if kind == "half-space" and not any(zone["normal"]):
        raise InvalidPlan(f"{place} has a normal of length 0. Write the direction into the zone.")
    return LinkZone(zone["link"], zone["name"], kind, numbers)
