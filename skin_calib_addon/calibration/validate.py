"""Everything that is wrong with a calibration document, in one pass: first its form, then its meaning."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..common.encoding import checksum
from ..common.findings import Finding, did_you_mean, error, first, show, warning
from ..common.schema_check import check, read_schema
from ..common.schema_types import has_type
from . import patch_checks, surface_checks
from .parts import Part, parts_of
from .response_checks import responses_are_monotone, responses_exist

Findings = tuple[Finding, ...]

FORMAT, VERSION = "skin-calibration", 1
# What the files of this program are, by their format, and what to do with one in the place of another.
OURS = {
    FORMAT: "a calibration; name the plan that it was made from",
    "skin-plan": "a plan; fit it, and name the calibration that comes of it",
    "skin-sources": "what fit notes of calibrations; name one of those beside it",
}
SCHEMA = read_schema(Path(__file__).with_name("schema.json"))


def validate(document: Any) -> Findings:
    """Check a calibration document against its schema and for what a schema cannot say.

    Parameters
    ----------
    document : JSON value
        Of any kind; nothing in it raises.

    Returns
    -------
    tuple of Finding
        Empty if all is well. Where one member is unsound, what the others say is still checked.
    """
    other = tuple(other_file(document, FORMAT, VERSION))
    if other:
        return other
    findings = validate_content(document)
    return (*findings, *checksum_findings(document, findings))


def other_file(document: Any, format: str, known: int) -> Iterator[Finding]:
    """That a document is another file of ours, or of a later version; nothing else in it can then be judged."""
    members = document if isinstance(document, dict) else {}
    found: Any = members.get("format")
    if isinstance(found, str) and found != format and found in OURS:
        yield error("value", "/format", f"must be {show(format)}, not {show(found)}: the file is {OURS[found]}", found)
        return
    version: Any = members.get("version")
    if has_type(version, "integer") and version > known:
        message = f"is {show(version)}, newer than the {known} that this program reads; update the program"
        yield error("version", "/version", message, version)


def validate_content(document: Any) -> Findings:
    """The same for a document of our version, without summing its content."""
    findings = check(document, SCHEMA)
    if any(finding.code == "more" for finding in findings):  # what else is unsound is not known
        return findings
    with np.errstate(all="ignore"):  # absurd numbers overflow; the comparisons below are written for that
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
        *first(responses_are_monotone(document, findings)),
        *first(responses_exist(document, patches)),
    )


def _run(checks: Iterable[Callable[[Part], Iterator[Finding]]], parts: list[Part]) -> Findings:
    return tuple(finding for check in checks for finding in first(f for part in parts for f in check(part)))


def _repeats(parts: list[Part], name: str, code: str) -> Iterator[Finding]:
    seen: dict[Any, str] = {}
    for part in parts:
        for where, value in _entries(part, name):
            if seen.setdefault(value, where) != where:
                yield error(code, where, f"repeats {show(value)} of {seen[value]}", value)


def _entries(part: Part, name: str) -> Iterable[tuple[str, Any]]:
    """A member and its pointer, or each element of a column."""
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
            message = f"names no surface here: {show(name)}{did_you_mean(name, names)}"
            yield error("unknown-surface", patch.at("surface"), message, name)


def _unknown_neighbours(patches: list[Part], near: dict[str, set[str]]) -> Iterator[Finding]:
    for patch, row, column, taxel, other in _pairs(patches) if near else ():
        if other not in near:
            message = f"names no taxel here: {show(other)}"
            yield error("unknown-neighbour", patch.at("neighbours", row, column), message, other)
        elif other == taxel:
            message = f"names the taxel itself: {show(other)}"
            yield error("self-neighbour", patch.at("neighbours", row, column), message, other)


def _one_sided_neighbours(patches: list[Part], near: dict[str, set[str]]) -> Iterator[Finding]:
    for patch, row, column, taxel, other in _pairs(patches) if near else ():
        if other in near and taxel not in near[other]:
            message = f"is {show(other)}, which does not name this one"
            yield warning("one-sided-neighbour", patch.at("neighbours", row, column), message, other)


def _neighbours(patches: list[Part]) -> dict[str, set[str]]:
    """The neighbours of every taxel; empty where not every patch can tell."""
    if not all(patch.members.keys() >= {"id", "neighbours"} for patch in patches):
        return {}
    return {taxel: set(ids) for p in patches for taxel, ids in zip(p.members["id"], p.members["neighbours"])}


def _pairs(patches: list[Part]) -> Iterator[tuple[Part, int, int, str, str]]:
    """Patch, row, column, taxel and neighbour of every entry."""
    for patch in patches:
        for row, (taxel, ids) in enumerate(zip(patch.members["id"], patch.members["neighbours"])):
            for column, other in enumerate(ids):
                yield patch, row, column, taxel, other


def checksum_findings(document: Any, findings: Findings) -> Iterator[Finding]:
    """Whether the checksum is that of the content, unless something was found about the checksum itself."""
    stated = document.get("checksum") if isinstance(document, dict) else None
    if stated is None or any(finding.pointer == "/checksum" for finding in findings):
        return
    try:
        actual = checksum(document)
    except (TypeError, ValueError, RecursionError) as problem:
        yield error("checksum", "/checksum", f"cannot be told, for the document is not JSON: {problem}", stated)
        return
    if stated != actual:
        message = f"is not that of the content, which was changed after writing; if that was meant, write {actual}"
        yield error("checksum", "/checksum", message, stated)
