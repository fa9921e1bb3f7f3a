"""``check``: every finding of calibration and plan files, and whether the mesh is still the one that was calibrated."""

import argparse
import os.path
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from ..calibration.file import check_bytes
from ..common.errors import CalibrationFormatError, InvalidMesh, OutputError
from ..common.findings import Finding, printable, warning
from ..common.strict_json import parse, read
from ..pipeline.sources import changed_inputs, find_mesh, is_same_mesh
from ..plan import FORMAT, check_plan_wholly
from .common import DONE, WRONG_DATA, complain

MAX_UNCOUNTED = 10  # findings that one counts by their codes


def add(commands) -> None:
    check = commands.add_parser(
        "check",
        help="validate calibrations and plans, and compare calibrations with their meshes",
        description="The mesh of a calibration is looked for where sources.json, which fit leaves beside calibrations, "
        "has it, and beside the calibration.",
    )
    check.add_argument(
        "files", nargs="+", type=Path, metavar="FILE", help="or a folder of *.calibration.json and *.plan.json"
    )
    check.add_argument("--mesh", type=Path, metavar="MESH", help="mesh of the one calibration named")
    check.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    files = list(_files(options.files))
    if options.mesh is not None and len(files) != 1:
        raise OutputError(f"--mesh is that of one calibration; {len(files)} files are named")
    return max([_check_one(path, options.mesh) for path in files])


def _files(named: Iterable[Path]) -> Iterator[Path]:
    for path in named:
        inside = sorted((*path.glob("*.calibration.json"), *path.glob("*.plan.json"))) if os.path.isdir(path) else []
        yield from inside or [path]  # a folder without any is refused as what is no file


def _check_one(path: Path, mesh: Path | None) -> int:
    try:
        data = read(path)
    except CalibrationFormatError as problem:
        complain(str(problem))
        return WRONG_DATA
    notes: list[str] = []
    document, findings = parse(data)
    if isinstance(document, dict) and document.get("format") == FORMAT:
        findings = tuple(findings) or check_plan_wholly(document)
        findings = findings or tuple(_missing_files(path, document))
    else:
        document, findings = check_bytes(data)
        if not any(finding.severity == "error" for finding in findings):
            notes = [f"{_taxels(document)} taxels on {document['link']}"]
            outdated, of_mesh = _compare(path, document["mesh"], mesh)
            findings, notes = (*findings, *outdated), [*notes, of_mesh]
    for finding in findings:
        print(f"{finding}{_taxel(document, finding.pointer)}")
    errors = sum(f.severity == "error" for f in findings)
    counted = [f"{errors} errors, {len(findings) - errors} warnings", *notes]
    if len(findings) > MAX_UNCOUNTED:
        counted.append(", ".join(f"{n} {code}" for code, n in Counter(f.code for f in findings).most_common()))
    print(printable(f"{path}: {'; '.join(counted)}"))
    return WRONG_DATA if errors else DONE


def _taxels(document: dict[str, Any]) -> int:
    return sum(len(patch["taxels"]["id"]) for patch in document["patches"])


def _missing_files(path: Path, document: dict[str, Any]) -> Iterator[Finding]:
    """The files that a plan names and that are not there."""
    if not os.path.isfile(path.parent / document["mesh"]):
        yield warning("no-mesh", "/mesh", "names no file; a plan names its mesh relative to its own folder")
    for k, skin in enumerate(document["skins"]):
        if skin["kind"] == "imported" and not os.path.isfile(path.parent / skin["file"]):
            message = "names no file; a plan names files of taxels relative to its own folder"
            yield warning("no-taxels", f"/skins/{k}/file", message, skin["file"])


def _compare(path: Path, mesh: dict[str, Any], named: Path | None) -> tuple[list[Finding], str]:
    """Whether plan and mesh are still those that the calibration was made from, and what became of the mesh."""
    try:
        plans = [
            warning("outdated", "", f"was made from {name}, which has changed since; fit it again")
            for name in changed_inputs(path)
        ]
        place = named or find_mesh(path, mesh["file"])
    except CalibrationFormatError as problem:
        return [warning("outdated", "", str(problem))], "mesh not compared"
    if place is None:
        return plans, f"mesh {mesh['file']} not found and not compared: name it with --mesh"
    shown = os.path.normpath(place)
    try:
        if is_same_mesh(place, mesh["sha256"]):
            return plans, f"mesh {shown} is the one that was calibrated"
        message = f"is not that of {shown}: the mesh is no longer the one that was calibrated; fit its plan again"
    except InvalidMesh as problem:
        message = f"cannot be compared: {problem}"
    return [*plans, warning("outdated", "/mesh/sha256", message, mesh["sha256"])], "mesh is another one"


def _taxel(document: Any, pointer: str) -> str:
    """The id of the taxel that a pointer leads to, for people who know the taxels by name."""
    keys = pointer.split("/")
    if len(keys) < 6 or keys[1] != "patches" or keys[3] != "taxels":
        return ""
    try:
        name = document["patches"][int(keys[2])]["taxels"]["id"][int(keys[5])]
    except (LookupError, TypeError, ValueError):
        return ""
    return f" (taxel {printable(name)[:80]})" if isinstance(name, str) else ""
