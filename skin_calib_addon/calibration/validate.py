"""Validate a calibration document: first its form with a schema, then its meaning."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..common.encoding import checksum
from ..common.findings import Finding, did_you_mean, error, first, repeated, show, warning
from ..common.schema_check import check, read_schema
from ..common.schema_types import has_type
from . import patch_checks, surface_checks
from .modality import modalities_are_distinct, modality_taxels_exist
from .parts import Part, parts_of, sound_items
from .response_checks import responses_are_monotone, responses_exist

Findings = tuple[Finding, ...]

FORMAT = "skin-calibration"
CALIBRATION_VERSION = 3  # Format: version of calibration files
# Description of each file format of this program, and advice if it is used in place of another.
FILE_FORMATS = {
    FORMAT: "a calibration. Use the plan from which it was made.",
    "skin-plan": "a plan. Fit it, and use the resulting calibration.",
    "skin-sources": "the record of the sources of a calibration, which fit writes. Use the calibration next to it.",
}
SCHEMA = read_schema(Path(__file__).with_name("schema.json"))


def validate(document: Any) -> Findings:
    """Check a calibration document against its schema, and for consistency."""
    other = tuple(other_file(document, FORMAT, CALIBRATION_VERSION))
    if other:
        return other
    findings = validate_content(document)
    return (*findings, *checksum_findings(document, findings))


def other_file(document: Any, format: str, known: int) -> Iterator[Finding]:
    """Yield an error if a document has another format of this program, or a newer version."""
    members = document if isinstance(document, dict) else {}
    found: Any = members.get("format")
    if isinstance(found, str) and found != format and found in FILE_FORMATS:
        yield error(
            "value", "/format", f"must be {show(format)}, not {show(found)}: the file is {FILE_FORMATS[found]}", found
        )
        return
    version: Any = members.get("version")
    if has_type(version, "integer") and version > known:
        message = f"is {show(version)}, newer than version {known} of this program; update the program"
        yield error("version", "/version", message, version)


def validate_content(document: Any) -> Findings:
    """Check a document of the current version as `validate`, without its checksum."""
    findings = check(document, SCHEMA)
    if any(finding.code == "more" for finding in findings):  # the other invalid members are not known
        return findings
    with np.errstate(all="ignore"):  # huge numbers overflow; the comparisons below handle that
        findings += _shapes(document, findings)
        findings += _meaning(document, findings)
    return findings


def _shapes(document: Any, findings: Findings) -> Findings:
    surfaces = _run(surface_checks.SHAPE_CHECKS, parts_of(document, "surfaces", findings))
    return surfaces + _run(patch_checks.SHAPE_CHECKS, parts_of(document, "patches", findings))


def _meaning(document: Any, findings: Findings) -> Findings:
    surfaces = [part.as_arrays() for part in parts_of(document, "surfaces", findings)]
    patches = [part.as_arrays() for part in parts_of(document, "patches", findings)]
    near = _neighbours(patches)
    return (
        *_run(surface_checks.CHECKS, surfaces),
        *_run(patch_checks.CHECKS, patches),
        *first(_repeats(surfaces, "name", "duplicate-name")),
        *first(_repeats(patches, "name", "duplicate-name")),
        *first(_repeats(patches, "id", "duplicate-id")),
        *first(_repeats(patches, "channel", "duplicate-channel")),
        *first(_unknown_surfaces(patches, surfaces)),
        *first(_unknown_neighbours(patches, near)),
        *first(_one_sided_neighbours(patches, near)),
        *first(_repeated_neighbours(patches, near)),
        *first(patch_checks.taxels_are_apart(patches)),
        *first(responses_are_monotone(document, findings)),
        *first(responses_exist(document, patches)),
        *first(modalities_are_distinct(document, findings)),
        *first(modality_taxels_exist(document, findings, patches)),
        *first(_stored_warnings(document, findings)),
    )


def _run(checks: Iterable[Callable[[Part], Iterator[Finding]]], parts: list[Part]) -> Findings:
    return tuple(finding for check in checks for finding in first(f for part in parts for f in check(part)))


def _stored_warnings(document: Any, findings: Findings) -> Iterator[Finding]:
    """Yield the warnings of fit and placement that the document has; a note is no problem."""
    for pointer, stored in sound_items(document, "warnings", findings):
        if stored["severity"] != "note":
            message = f"reports: {stored['message']} {stored['advice']}".strip()
            yield Finding(stored["code"], stored["severity"], pointer, message, stored["value"])


def _repeats(parts: list[Part], name: str, code: str) -> Iterator[Finding]:
    for where, value, earlier in repeated(entry for part in parts for entry in _entries(part, name)):
        yield error(code, where, f"repeats {show(value)} of {earlier}", value)


def _entries(part: Part, name: str) -> Iterable[tuple[str, Any]]:
    """Return a member with its pointer, or all elements of a column with theirs."""
    if name not in part.members:
        return ()
    if name not in part.columns:
        return [(part.at(name), part.members[name])]
    column, pointer = part.members[name], part.at(name)
    values = column.astype(int).tolist() if isinstance(column, np.ndarray) else column
    return [(f"{pointer}/{row}", value) for row, value in enumerate(values)]


def _unknown_surfaces(patches: list[Part], surfaces: list[Part]) -> Iterator[Finding]:
    names = {surface.members.get("name"): surface for surface in surfaces}
    for patch in patches:
        name = patch.members.get("surface")
        if name is not None and None not in names and name not in names:
            message = f"names the unknown surface {show(name)}{did_you_mean(name, names)}"
            yield error("unknown-surface", patch.at("surface"), message, name)


def _unknown_neighbours(patches: list[Part], near: dict[str, set[str]]) -> Iterator[Finding]:
    for patch, row, column, taxel, other in _pairs(patches) if near else ():
        if other not in near:
            message = f"names the unknown taxel {show(other)}"
            yield error("unknown-neighbour", patch.at("neighbours", row, column), message, other)
        elif other == taxel:
            message = f"names the taxel itself: {show(other)}"
            yield error("self-neighbour", patch.at("neighbours", row, column), message, other)


def _one_sided_neighbours(patches: list[Part], near: dict[str, set[str]]) -> Iterator[Finding]:
    for patch, row, column, taxel, other in _pairs(patches) if near else ():
        if other in near and taxel not in near[other]:
            message = f"is {show(other)}, which does not list this taxel as neighbour"
            yield warning("one-sided-neighbour", patch.at("neighbours", row, column), message, other)


def _repeated_neighbours(patches: list[Part], near: dict[str, set[str]]) -> Iterator[Finding]:
    for patch in patches if near else ():
        for row, ids in enumerate(patch.members["neighbours"]):
            for column, other in enumerate(ids) if len(set(ids)) < len(ids) else ():
                if other in ids[:column]:
                    message = f"names {show(other)} a second time"
                    yield error("duplicate-neighbour", patch.at("neighbours", row, column), message, other)


def _neighbours(patches: list[Part]) -> dict[str, set[str]]:
    """Return the neighbours of all taxels; empty if one patch has no valid neighbours."""
    if not all(patch.members.keys() >= {"id", "neighbours"} for patch in patches):
        return {}
    return {taxel: set(ids) for p in patches for taxel, ids in zip(p.members["id"], p.members["neighbours"])}


def _pairs(patches: list[Part]) -> Iterator[tuple[Part, int, int, str, str]]:
    """Yield patch, row, column, taxel and neighbour of every entry."""
    for patch in patches:
        for row, (taxel, ids) in enumerate(zip(patch.members["id"], patch.members["neighbours"])):
            for column, other in enumerate(ids):
                yield patch, row, column, taxel, other


def checksum_findings(document: Any, findings: Findings) -> Iterator[Finding]:
    """Yield an error if the checksum differs from that of the content."""
    stated = document.get("checksum") if isinstance(document, dict) else None
    if stated is None or any(finding.pointer == "/checksum" for finding in findings):
        return
    try:
        actual = checksum(document)
    except (TypeError, ValueError, RecursionError) as problem:
        yield error("checksum", "/checksum", f"cannot be computed because the document is not JSON: {problem}", stated)
        return
    if stated != actual:
        message = (
            f"differs from that of the content, which was changed after writing; for an intended change, use {actual}"
        )
        yield error("checksum", "/checksum", message, stated)
