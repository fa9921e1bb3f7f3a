"""What each calibration of a folder was made from, so that none is made twice and a changed mesh is noticed."""

import hashlib
import json
import os
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import trimesh

from .. import __version__
from ..common.atomic_file import write_bytes_safely
from ..common.errors import CalibrationFormatError
from ..common.schema_check import check, read_schema
from ..common.strict_json import parse, read
from ..common.warnings import Warning, from_document, to_document
from ..geometry.mesh.triangle_mesh import METRES_PER_UNIT, TriangleMesh, read_mesh
from ..plan import Plan
from ..plan.skins import ImportedSkin

FILE = "sources.json"
FORMAT, VERSION = "skin-sources", 2
# Another release of a library rounds otherwise, or reads a mesh otherwise.
PROGRAM = f"skin-calib {__version__}, NumPy {np.__version__}, SciPy {scipy.__version__}, trimesh {trimesh.__version__}"


@dataclass(frozen=True)
class Source:
    """What one calibration was made from and what was written; paths are relative to its folder, hashes of bytes."""

    program: str
    plan: str
    mesh: str
    inputs: dict[str, str]  # of plan, mesh and taxel files, by path
    outputs: dict[str, str]  # of calibration, picture and report, by path
    taxels: int
    mean: float  # distance from surface to mesh [m]
    warnings: tuple[Warning, ...]

    def has_files(self, folder: Path, hashes: dict[str, str]) -> bool:
        """Whether files are there as they were."""
        return all(file_hash(folder / path) == told for path, told in hashes.items())


def source_of(path: Path, plan: Plan, folder: Path) -> Source:
    """What a calibration that is made now comes from; taken before it is made, so that no later change is missed.

    Parameters
    ----------
    path, plan : Path, Plan
        The plan's file, and what `load_plan` read from it.
    folder : Path
        Where the calibration goes.
    """
    files = (path, plan.mesh, *taxel_files(plan))
    inputs = {relative_path(folder, file): file_hash(file) or "" for file in files}
    return Source(PROGRAM, relative_path(folder, path), relative_path(folder, plan.mesh), inputs, {}, 0, 0.0, ())


def taxel_files(plan: Plan) -> tuple[Path, ...]:
    """The files that the imported skins of a plan come from."""
    return tuple(skin.file for skin in plan.skins if isinstance(skin, ImportedSkin))


def add_outputs(source: Source, folder: Path, outputs: list[Path], **numbers: Any) -> Source:
    """The same once files are written."""
    hashes = {relative_path(folder, path): file_hash(path) or "" for path in outputs}
    return replace(source, outputs=hashes, **numbers)


def is_current(now: Source, before: Source, folder: Path, outputs: list[Path]) -> bool:
    """Whether the same program made these files from the same plan, mesh and taxel files, and they still stand."""
    wanted = {relative_path(folder, path) for path in outputs}
    same = (now.program, now.inputs) == (before.program, before.inputs)
    return same and wanted <= before.outputs.keys() and before.has_files(folder, {p: before.outputs[p] for p in wanted})


def load_sources(folder: Path) -> dict[str, Source]:
    """By the name of the calibration file; empty where nothing was noted.

    Raises
    ------
    CalibrationFormatError
        If the notes cannot be read or are damaged.
    """
    path = folder / FILE
    if not os.path.lexists(path):
        return {}
    document, findings = parse(read(path))
    document = _migrated(document)
    findings = tuple(findings) or check(document, _schema())
    if findings:
        message = f"cannot tell what the calibrations of '{folder}' were made from: {FILE} has {findings[0]}; delete it"
        raise CalibrationFormatError(message, findings)
    known = document["calibrations"].items()
    return {name: Source(**{**member, "warnings": from_document(member["warnings"])}) for name, member in known}


def _migrated(document: Any) -> Any:
    """A document of version 1, whose warnings were plain strings, as one of version 2; others as they are."""
    if not isinstance(document, dict) or document.get("format") != FORMAT or document.get("version") != 1:
        return document
    calibrations = document.get("calibrations")
    for member in calibrations.values() if isinstance(calibrations, dict) else ():
        if isinstance(member, dict) and isinstance(texts := member.pop("doubts", None), list):
            member["warnings"] = to_document(Warning("earlier-fit", "warning", str(text)) for text in texts)
    return document | {"version": VERSION}


def save_source(folder: Path, name: str, source: Source) -> None:
    """Note what a calibration was made from; what is noted of others stays."""
    sources = load_sources(folder) | {name: source}
    document = {
        "format": FORMAT,
        "version": VERSION,
        "calibrations": {
            key: asdict(sources[key]) | {"warnings": to_document(sources[key].warnings)} for key in sorted(sources)
        },
    }
    text = json.dumps(document, indent=2, ensure_ascii=False) + "\n"
    with suppress(UnicodeEncodeError):  # a file whose name is no text is fitted anew each time
        write_bytes_safely(folder / FILE, text.encode())


def find_mesh(calibration: Path, file: str) -> Path | None:
    """Where the mesh of a calibration lies: where `sources.json` has it, or beside the calibration; None if nowhere."""
    noted = load_sources(calibration.parent).get(calibration.name)
    places = ([noted.mesh] if noted else []) + [file]
    return next((path for place in places if os.path.isfile(path := calibration.parent / place)), None)


def changed_inputs(calibration: Path) -> tuple[str, ...]:
    """Of the files that a calibration was made from, those that are others now."""
    noted = load_sources(calibration.parent).get(calibration.name)
    files = {path: told for path, told in noted.inputs.items() if path != noted.mesh} if noted else {}
    return tuple(path for path, told in files.items() if file_hash(calibration.parent / path) not in (told, None))


def is_same_mesh(path: Path, sha256: str) -> bool:
    """Whether a mesh file holds the geometry of this hash, whatever the unit of its numbers.

    Raises
    ------
    InvalidMesh
        If it cannot be read.
    """
    raw = read_mesh(path)
    return any(TriangleMesh(raw.vertices * metres, raw.faces).sha256 == sha256 for metres in METRES_PER_UNIT.values())


def file_hash(path: Path) -> str | None:
    """Of a file's bytes; None where there is no file that can be read: a device or a pipe might never end."""
    if not os.path.isfile(path):
        return None
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None


def relative_path(folder: Path, path: Path) -> str:
    """A path relative to a folder, with slashes; as it is where it is on another drive.

    Folders are followed where they are links: what lies above one is not above the folder that it leads to.
    """
    try:
        return Path(
            os.path.relpath(Path(os.path.realpath(path.parent), path.name), os.path.realpath(folder))
        ).as_posix()
    except ValueError:  # on another drive
        return path.absolute().as_posix()


@cache
def _schema() -> dict[str, Any]:
    return read_schema(Path(__file__).with_name("sources.schema.json"))
