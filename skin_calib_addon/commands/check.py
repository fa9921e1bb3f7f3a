"""``check``: report all findings of calibration and plan files, and compare calibrations with their meshes."""

import argparse
import json
import os.path
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from ..calibration import robot_set
from ..calibration.file import check_bytes
from ..calibration.source_record import changed_inputs, find_mesh, is_as_recorded, is_of_fits, lost_plan
from ..common.errors import CalibrationFormatError, OutputError, SkinCalibError, counted
from ..common.findings import Finding, error, printable, warning
from ..common.strict_json import parse, read
from ..runtime import noise_file
from .common import DONE, WRONG_DATA, complain, named_path, say

PLAN_FORMAT = "skin-plan"  # as in plan/keys, which needs more packages than the check of a calibration
MAX_UNCOUNTED = 10  # findings without a count by code. Larger: longer lists without a count.


def add(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "The mesh of NAME.calibration.json is searched at the path in NAME.sources.json, which fit writes next to it, "
        "and in the folder of the calibration."
    )
    parser.add_argument(
        "files",
        nargs="+",
        type=named_path,
        metavar="FILE",
        help="file, or folder of *.calibration.json, *.plan.json and robot.json",
    )
    parser.add_argument(
        "--mesh", type=named_path, metavar="MESH", help="mesh of the calibration; only for a single file"
    )
    parser.add_argument("--json", action="store_true", help="print the findings as JSON, for another program")


def run(options: argparse.Namespace) -> int:
    files = list(_files(options.files))
    if options.mesh is not None and len(files) != 1:
        raise OutputError(f"--mesh needs exactly one file; {len(files)} files are given.")
    of_files = (_check_one(path, options.mesh) for path in files)
    checked = []
    for one in chain(of_files, filter(None, map(_check_folder, options.files))):
        checked.append(one)
        if not options.json:
            one.print()
    if options.json:
        say(json.dumps([one.document for one in checked], indent=2))
    return WRONG_DATA if any(one.errors for one in checked) else DONE


class Checked(NamedTuple):
    """What was found in a file."""

    path: Path
    findings: tuple[Finding, ...]
    notes: tuple[str, ...] = ()
    content: Any = None  # JSON value
    unread: str = ""  # why it could not be read

    @property
    def errors(self) -> int:
        """Return the number of errors."""
        return sum(f.severity == "error" for f in self.findings)

    @property
    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        names = ("code", "severity", "pointer", "message")
        found = [{name: getattr(finding, name) for name in names} for finding in self.findings]
        return {"file": str(self.path), "findings": found, "notes": list(self.notes)}

    def print(self) -> None:
        """Print a line for each finding, and a summary."""
        if self.unread:
            return complain(self.unread)
        for finding in self.findings:
            say(f"{finding}{_taxel(self.content, finding.pointer)}")
        counts = f"{counted(self.errors, 'error')}, {counted(len(self.findings) - self.errors, 'warning')}"
        summary = [counts, *self.notes]
        if len(self.findings) > MAX_UNCOUNTED:
            summary.append(", ".join(f"{n} {code}" for code, n in Counter(f.code for f in self.findings).most_common()))
        say(f"{self.path}: {'; '.join(summary)}")


def _files(named: Iterable[Path]) -> Iterator[Path]:
    for path in named:
        inside: list[Path] = []
        if os.path.isdir(path):
            inside = sorted((*path.glob("*.calibration.json"), *path.glob("*.plan.json"), *path.glob(robot_set.FILE)))
        yield from inside or [path]  # an empty folder is rejected later, because it is not a file


def _check_one(path: Path, mesh: Path | None) -> Checked:
    try:
        data = read(path)
    except CalibrationFormatError as problem:
        return Checked(path, (error("unreadable", "", str(problem)),), unread=str(problem))
    notes: list[str] = []
    document, findings = parse(data)
    format = document.get("format") if isinstance(document, dict) else None
    if mesh is not None and format in (PLAN_FORMAT, robot_set.FORMAT, noise_file.FORMAT):
        complain(f"warning: --mesh is for a calibration, and {path} is none: {mesh} was not compared")
    if format == PLAN_FORMAT:
        from .check_authoring import plan_findings

        findings = tuple(findings) or plan_findings(path, document)
    elif format == robot_set.FORMAT:
        findings = tuple(findings) or robot_set.check_robot_document(document) or tuple(_robot_findings(path))
    elif format == noise_file.FORMAT:
        findings = tuple(findings) or noise_file.check_noise(document)
    else:
        document, findings = check_bytes(data)
        if not any(finding.severity == "error" for finding in findings):
            notes = [f"{_taxels(document)} taxels on {document['link']}"]
            outdated, of_mesh = _compare(path, document["link"], document["mesh"], mesh)
            findings, notes = (*findings, *outdated), [*notes, of_mesh]
    return Checked(path, tuple(findings), tuple(notes), document)


def _check_folder(folder: Path) -> Checked | None:
    """Warn of a folder whose calibrations ``fit`` has written without ``robot.json``, for example after Ctrl+C."""
    if is_of_fits(folder) and not os.path.lexists(folder / robot_set.FILE):
        found = {path.name: robot_set.link_of(path) for path in sorted(folder.glob("*.calibration.json"))}
        links = {name: link for name, link in found.items() if link is not None}
        why = "fit into this folder again, which writes it"
        if both := robot_set.same_link(links):
            why = f"fit writes none, because {both}"
        if links:
            missing = warning("no-robot", robot_set.FILE, f"is missing, and the links are no robot without it: {why}")
            return Checked(folder / robot_set.FILE, (missing,))
    return None


def _robot_findings(path: Path) -> Iterator[Finding]:
    """Yield the problems of the links of a robot together, and those of its URDF."""
    robot, folder, _, findings = robot_set.examined(path)
    yield from findings
    of_urdf = tuple(robot_set.changed_urdf(robot, folder))
    yield from of_urdf
    if robot.urdf and not any(finding.code == "no-urdf" for finding in of_urdf):
        from .check_authoring import urdf_findings

        yield from urdf_findings(robot, robot.urdf, folder)


def _taxels(document: dict[str, Any]) -> int:
    return sum(len(patch["taxels"]["id"]) for patch in document["patches"])


def _compare(path: Path, link: str, mesh: dict[str, Any], named: Path | None) -> tuple[list[Finding], str]:
    """Return warnings for changed sources, and the result of the comparison of the mesh."""
    try:
        plans = [
            warning("outdated", "", f"was made from {name}, which has changed; fit it again")
            for name in changed_inputs(path)
        ]
        if name := lost_plan(path):
            plans.append(
                warning("no-plan", "", f"was made from {name}, which is missing; remove one, or propose again")
            )
        found = named or find_mesh(path, mesh["file"])
    except CalibrationFormatError as problem:
        message = f"cannot be compared with its sources: {problem}"
        return [warning("outdated", "", message)], "mesh not compared"
    if found is None:
        return plans, f"mesh {mesh['file']} not found and not compared: specify it with --mesh"
    shown = os.path.normpath(found)
    if named is None and is_as_recorded(path):
        return plans, f"mesh {shown} is unchanged"
    from .check_authoring import is_same_mesh

    try:
        if is_same_mesh(found, mesh["sha256"], link):
            return plans, f"mesh {shown} is unchanged"
        message = f"differs from that of {shown}: the mesh has changed; fit the plan again"
    except SkinCalibError as problem:
        message = f"cannot be compared: {problem}"
    return [*plans, warning("outdated", "/mesh/sha256", message, mesh["sha256"])], "mesh has changed"


def _taxel(document: Any, pointer: str) -> str:
    """Return the id of the taxel of a pointer, for the user."""
    keys = pointer.split("/")
    if len(keys) < 6 or keys[1] != "patches" or keys[3] != "taxels":
        return ""
    try:
        name = document["patches"][int(keys[2])]["taxels"]["id"][int(keys[5])]
    except (LookupError, TypeError, ValueError):
        return ""
    return f" (taxel {printable(name)[:80]})" if isinstance(name, str) else ""
