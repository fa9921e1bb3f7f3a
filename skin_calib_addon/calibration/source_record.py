"""The record of a calibration: the files from which ``fit`` made it, and those that it wrote.

Each calibration has a file of its own, so that several processes, also on several machines, can fit one folder.
"""

import json
import os
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from ..common.atomic_file import write_bytes_safely
from ..common.errors import CalibrationFormatError
from ..common.file_hash import file_hash
from ..common.schema_check import check, read_schema
from ..common.strict_json import parse, read
from ..common.warnings import Warning, from_document, to_document

ENDING = ".sources.json"  # Contract: NAME.sources.json is the record of NAME.calibration.json
OF_FOLDER = "sources.json"  # one record of all calibrations of a folder, which earlier versions wrote
FORMAT = "skin-sources"
SOURCES_VERSION = 3  # Format: version of these files; 1 and 2 were of a folder


@dataclass(frozen=True)
class Source:
    """Sources and outputs of one calibration; paths are relative to its folder, hashes are of bytes."""

    program: str
    plan: str
    mesh: str
    inputs: dict[str, str]  # of plan, mesh and taxel files, by path
    outputs: dict[str, str]  # of calibration, picture and report, by path
    taxels: int
    mean: float  # distance from surface to mesh [m]
    warnings: tuple[Warning, ...]

    def has_files(self, folder: Path, hashes: dict[str, str]) -> bool:
        """Return whether files are unchanged."""
        return all(file_hash(folder / path) == expected for path, expected in hashes.items())


def source_file(calibration: Path) -> Path:
    """Return the file of the record of a calibration."""
    return calibration.with_name(calibration.name.removesuffix(".json").removesuffix(".calibration") + ENDING)


def is_of_fits(folder: Path) -> bool:
    """Return whether ``fit`` has written calibrations into a folder."""
    return any(path.name.endswith(OF_FOLDER) for path in folder.glob("*sources.json"))


def load_source(calibration: Path) -> Source | None:
    """Read the record of a calibration; None without one."""
    file = source_file(calibration)
    is_own = os.path.lexists(file)
    if not is_own and not os.path.lexists(file := calibration.with_name(OF_FOLDER)):
        return None
    document, findings = parse(read(file))
    if not is_own and (document := _member(document, calibration.name)) is None and not findings:
        return None
    findings = tuple(findings) or check(document, _schema())
    if findings:
        message = f"the sources of '{calibration}' are unknown: {file.name} has {findings[0]}. Delete this file."
        raise CalibrationFormatError(message, findings)
    values = {name: document[name] for name in Source.__dataclass_fields__}
    return Source(**values | {"warnings": from_document(document["warnings"])})


def save_source(calibration: Path, source: Source) -> None:
    """Record the sources of a calibration."""
    document = {"format": FORMAT, "version": SOURCES_VERSION, **asdict(source)}
    document["warnings"] = to_document(source.warnings)
    text = json.dumps(document, indent=2, ensure_ascii=False) + "\n"
    with suppress(UnicodeEncodeError):  # a file whose name is not valid text is fitted again each time
        write_bytes_safely(source_file(calibration), text.encode())


def find_mesh(calibration: Path, file: str) -> Path | None:
    """Return the mesh file of a calibration: that of its record, or in the same folder."""
    noted = load_source(calibration)
    candidates = ([noted.mesh] if noted else []) + [file]
    return next((path for name in candidates if os.path.isfile(path := calibration.parent / name)), None)


def changed_inputs(calibration: Path) -> tuple[str, ...]:
    """Return the source files of a calibration, except the mesh, that have changed."""
    noted = load_source(calibration)
    files = {path: known for path, known in noted.inputs.items() if path != noted.mesh} if noted else {}
    return tuple(path for path, known in files.items() if file_hash(calibration.parent / path) not in (known, None))


def lost_plan(calibration: Path) -> str:
    """Return the plan of a calibration if it is missing next to other plans; empty otherwise.

    Without other plans, the calibrations alone were copied to a robot.
    """
    noted = load_source(calibration)
    plan = calibration.parent / noted.plan if noted and noted.plan else None
    if noted is None or plan is None or os.path.lexists(plan) or not any(plan.parent.glob("*.plan.json")):
        return ""
    return noted.plan


def is_as_recorded(calibration: Path) -> bool:
    """Return whether a calibration and all its sources have the bytes that they had after its fit."""
    noted = load_source(calibration)
    if noted is None or calibration.name not in noted.outputs:
        return False
    return noted.has_files(calibration.parent, noted.inputs | {calibration.name: noted.outputs[calibration.name]})


def _member(document: Any, name: str) -> Any:
    """Return the record of one calibration in that of a folder; None without one. Warnings of version 1 are texts."""
    match document:
        case {"format": "skin-sources", "version": 1 | 2, "calibrations": {} as members}:
            member = members.get(name)
        case _:
            return document  # the schema says what is wrong
    if not isinstance(member, dict):
        return member
    if isinstance(texts := member.pop("doubts", None), list):
        member["warnings"] = to_document(Warning("earlier-fit", "warning", str(text)) for text in texts)
    return {"format": FORMAT, "version": SOURCES_VERSION, **member}


@cache
def _schema() -> dict[str, Any]:
    return read_schema(Path(__file__).with_name("source_schema.json"))
