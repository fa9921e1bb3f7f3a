"""Further quantities that taxels measure next to force, such as proximity: record, document and checks. NumPy only."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from ..common.findings import Finding, child, did_you_mean, error, show
from .parts import Part, sound_items
from .response import AnyResponse, response_document, response_from

# Contract: the name of the readings that `response` and `responses` convert to forces.
FORCE = "force"
# Contract: SI units of modalities, and degrees Celsius. "1" has no unit, such as a relative humidity.
UNITS = {
    "m": "Metres",
    "m/s": "Metres per second",
    "m/s^2": "Metres per second squared",
    "rad/s": "Radians per second",
    "K": "Kelvin",
    "degC": "Degrees Celsius",
    "N": "Newtons",
    "Pa": "Pascals",
    "1": "No unit",
}


@dataclass(frozen=True)
class Modality:
    """A quantity that taxels measure next to force. Each modality has readings of its own."""

    name: str
    unit: str
    response: AnyResponse  # value of a reading, in the unit
    # Position in the readings of this modality of each taxel that has it, by id; None: all taxels, with the channel of
    # their force.
    channels: dict[str, int] | None = None


def modality_document(modality: Modality) -> dict[str, Any]:
    """Convert a modality to a member of a calibration file."""
    return {
        "name": modality.name,
        "unit": modality.unit,
        "response": response_document(modality.response),
        **(
            {}
            if modality.channels is None
            else {"channels": {id: int(k) for id, k in sorted(modality.channels.items())}}
        ),
    }


def modality_from(document: dict[str, Any]) -> Modality:
    """Convert a valid member to a modality."""
    channels = document.get("channels")
    return Modality(
        document["name"],
        document["unit"],
        response_from(document["response"]),
        None if channels is None else {id: int(channel) for id, channel in channels.items()},
    )


def modalities_are_distinct(document: Any, findings: Iterable[Finding]) -> Iterator[Finding]:
    """Yield an error for each name and each channel of a modality that repeats another one."""
    names: dict[Any, str] = {}
    for pointer, modality in sound_items(document, "modalities", findings):
        name, where = modality["name"], child(pointer, "name")
        if name == FORCE:
            yield error("value", where, f"is {show(FORCE)}, which `response` converts; choose another name", name)
        elif names.setdefault(name, where) != where:
            yield error("duplicate-name", where, f"repeats {show(name)} of {names[name]}", name)
        channels: dict[Any, str] = {}
        for taxel, channel in modality.get("channels", {}).items():
            where = child(pointer, "channels", taxel)
            if channels.setdefault(channel, where) != where:
                yield error("duplicate-channel", where, f"repeats {show(channel)} of {channels[channel]}", channel)


def modality_taxels_exist(document: Any, findings: Iterable[Finding], patches: Iterable[Part]) -> Iterator[Finding]:
    """Yield an error for each taxel of a modality that no patch has."""
    patches = list(patches)
    if not all("id" in patch.members for patch in patches):
        return
    known = dict.fromkeys(id for patch in patches for id in patch.members["id"])
    for pointer, modality in sound_items(document, "modalities", findings):
        for taxel in modality.get("channels", {}):
            if taxel not in known:
                message = f"names the unknown taxel {show(taxel)}{did_you_mean(taxel, known)}"
                yield error("unknown-taxel", child(pointer, "channels", taxel), message, taxel)
