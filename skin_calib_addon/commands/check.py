"""``check``: report all findings of calibration and plan files, and compare calibrations with their meshes."""

import argparse
import os.path
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from ..calibration import robot_set
from ..calibration.file import check_bytes
from ..common.errors import CalibrationFormatError, OutputError, SkinCalibError, counted
from ..common.findings import Finding, did_you_mean, error, printable, show, warning
from ..common.strict_json import parse, read
from ..pipeline.robot_folder import same_link
from ..pipeline.sources import FILE as SOURCES
from ..pipeline.sources import changed_inputs, find_mesh, is_same_mesh, lost_plan
from ..plan import FORMAT, check_plan_wholly, load_plan
from ..proposal.links import plan_warnings
from ..robot.link_mesh import is_urdf, plan_mesh_files
from ..robot.urdf import read_robot
from .common import DONE, WRONG_DATA, complain, named_path, say

MAX_UNCOUNTED = 10  # findings without a count by code. Larger: longer lists without a count.


def add(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "The mesh of a calibration is searched at the path in sources.json, which fit writes to the same "
        "folder, and in the folder of the calibration."
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


def run(options: argparse.Namespace) -> int:
    files = list(_files(options.files))
    if options.mesh is not None and len(files) != 1:
        raise OutputError(f"--mesh needs exactly one file; {len(files)} files are given.")
    code = max([_check_one(path, options.mesh) for path in files])
    for folder in options.files:
        _check_folder(folder)
    return code


def _files(named: Iterable[Path]) -> Iterator[Path]:
    for path in named:
        inside: list[Path] = []
        if os.path.isdir(path):
            inside = sorted((*path.glob("*.calibration.json"), *path.glob("*.plan.json"), *path.glob(robot_set.FILE)))
        yield from inside or [path]  # an empty folder is rejected later, because it is not a file


def _check_one(path: Path, mesh: Path | None) -> int:
    try:
        data = read(path)
    except CalibrationFormatError as problem:
        complain(str(problem))
        return WRONG_DATA
    notes: list[str] = []
    document, findings = parse(data)
    format = document.get("format") if isinstance(document, dict) else None
    if mesh is not None and format in (FORMAT, robot_set.FORMAT):
        complain(f"warning: --mesh is for a calibration, and {path} is none: {mesh} was not compared")
    if format == FORMAT:
        findings = tuple(findings) or check_plan_wholly(document)
        findings = findings or tuple(_plan_warnings(path, document))
    elif format == robot_set.FORMAT:
        findings = tuple(findings) or robot_set.check_robot_document(document) or tuple(_check_robot(path))
    else:
        document, findings = check_bytes(data)
        if not any(finding.severity == "error" for finding in findings):
            notes = [f"{_taxels(document)} taxels on {document['link']}"]
            outdated, of_mesh = _compare(path, document["link"], document["mesh"], mesh)
            findings, notes = (*findings, *outdated), [*notes, of_mesh]
    for finding in findings:
        say(f"{finding}{_taxel(document, finding.pointer)}")
    errors = sum(f.severity == "error" for f in findings)
    summary = [f"{counted(errors, 'error')}, {counted(len(findings) - errors, 'warning')}", *notes]
    if len(findings) > MAX_UNCOUNTED:
        summary.append(", ".join(f"{n} {code}" for code, n in Counter(f.code for f in findings).most_common()))
    say(f"{path}: {'; '.join(summary)}")
    return WRONG_DATA if errors else DONE


def _check_folder(folder: Path) -> None:
    """Warn of a folder whose calibrations ``fit`` has written without ``robot.json``, for example after Ctrl+C."""
    if os.path.isfile(folder / SOURCES) and not os.path.lexists(folder / robot_set.FILE):
        found = {path.name: robot_set.link_of(path) for path in sorted(folder.glob("*.calibration.json"))}
        links = {name: link for name, link in found.items() if link is not None}
        why = "fit into this folder again, which writes it"
        if both := same_link(links):
            why = f"fit writes none, because {both}"
        if links:
            say(str(warning("no-robot", robot_set.FILE, f"is missing, and the links are no robot without it: {why}")))
            say(f"{folder / robot_set.FILE}: 0 errors, 1 warning")


def _check_robot(path: Path) -> Iterator[Finding]:
    """Yield the problems of the links of a robot together, and those of its URDF."""
    robot = robot_set.load_robot_set(path)
    yield from robot_set.calibrations_of(robot, path.parent)[1]
    yield from robot_set.unlisted(robot, path.parent)
    of_urdf = tuple(robot_set.changed_urdf(robot, path.parent))
    yield from of_urdf
    if robot.urdf is None or any(finding.code == "no-urdf" for finding in of_urdf):
        return
    try:
        content = read_robot(path.parent / robot.urdf.file)
    except CalibrationFormatError as problem:
        yield error("invalid", "/urdf/file", f"cannot be read: {problem}", robot.urdf.file)
        return
    for k, link in enumerate(robot.links):
        parent = content.parents.get(link.link)
        if link.link not in content.links:
            message = f"({show(link.link)}) is not in {robot.urdf.file}{did_you_mean(link.link, content.links)}"
            yield error("unknown-link", f"/links/{k}/link", message, link.link)
        elif link.parent != parent:
            message = f"({show(link.parent)}) does not carry {show(link.link)} in the URDF; write {show(parent)}"
            yield error("parent", f"/links/{k}/parent", message, link.parent)


def _taxels(document: dict[str, Any]) -> int:
    return sum(len(patch["taxels"]["id"]) for patch in document["patches"])


def _plan_warnings(path: Path, document: dict[str, Any]) -> Iterator[Finding]:
    """Yield a warning for each missing file of a plan, and for each one of its proposal."""
    if not os.path.isfile(path.parent / document["mesh"]):
        yield warning("no-mesh", "/mesh", "does not exist; paths are relative to the folder of the plan")
    elif is_urdf(Path(document["mesh"])):
        try:
            plan_mesh_files(load_plan(path))
        except SkinCalibError as problem:
            yield warning("no-mesh", "/mesh", f"has no mesh for the link: {problem}")
    for sentence in plan_warnings(path):
        yield warning("proposal", "/x_proposal", f"warns: {sentence}")
    for k, skin in enumerate(document["skins"]):
        if skin["kind"] == "imported" and not os.path.isfile(path.parent / skin["file"]):
            message = "does not exist; paths are relative to the folder of the plan"
            yield warning("no-taxels", f"/skins/{k}/file", message, skin["file"])


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
