"""Record the source files of calibrations, to skip repeated fits and to find changed meshes."""

import json
import os
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import trimesh

from .. import __version__
from ..calibration import robot_set
from ..common.atomic_file import is_same_file, write_bytes_safely
from ..common.errors import CalibrationFormatError, SkinCalibError
from ..common.file_hash import file_hash
from ..common.schema_check import check, read_schema
from ..common.strict_json import parse, read
from ..common.warnings import Warning, from_document, to_document
from ..geometry.mesh.triangle_mesh import METRES_PER_UNIT, TriangleMesh, read_mesh
from ..plan import Plan, load_plan
from ..plan import keys as plan_keys
from ..plan.skins import ImportedSkin
from ..robot.link_mesh import is_urdf, load_urdf_mesh, plan_mesh_files

FILE = "sources.json"
FORMAT = "skin-sources"
SOURCES_VERSION = 2  # Format: version of sources.json
# Other versions of a library may round differently, or read a mesh differently.
PROGRAM = f"skin-calib {__version__}, NumPy {np.__version__}, SciPy {scipy.__version__}, trimesh {trimesh.__version__}"


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


def source_of(path: Path, plan: Plan, folder: Path) -> Source:
    """Return the sources of a new calibration; call it before the fit, so that later changes are found."""
    files = (path, *input_files(plan))
    inputs = {relative_path(folder, file): file_hash(file) or "" for file in files}
    return Source(PROGRAM, relative_path(folder, path), relative_path(folder, plan.mesh), inputs, {}, 0, 0.0, ())


def input_files(plan: Plan) -> tuple[Path, ...]:
    """Return all files that a plan names: of its mesh, and of its imported skins."""
    return (*plan_mesh_files(plan), *taxel_files(plan))


def taxel_files(plan: Plan) -> tuple[Path, ...]:
    """Return the files of the imported skins of a plan."""
    return tuple(skin.file for skin in plan.skins if isinstance(skin, ImportedSkin))


def add_outputs(source: Source, folder: Path, outputs: list[Path], **numbers: Any) -> Source:
    """Return a source with the hashes of its outputs, which must exist."""
    hashes = {relative_path(folder, path): file_hash(path) or "" for path in outputs}
    return replace(source, outputs=hashes, **numbers)


def is_current(now: Source, before: Source, folder: Path, outputs: list[Path]) -> bool:
    """Return whether the outputs exist, are unchanged, and have the same program and inputs."""
    wanted = {relative_path(folder, path) for path in outputs}
    same = (now.program, now.inputs) == (before.program, before.inputs)
    return same and wanted <= before.outputs.keys() and before.has_files(folder, {p: before.outputs[p] for p in wanted})


def load_sources(folder: Path) -> dict[str, Source]:
    """Read the sources of a folder by the name of the calibration file; empty without a record."""
    path = folder / FILE
    if not os.path.lexists(path):
        return {}
    document, findings = parse(read(path))
    document = _migrated(document)
    findings = tuple(findings) or check(document, _schema())
    if findings:
        message = (
            f"the sources of the calibrations in '{folder}' are unknown: {FILE} has {findings[0]}. Delete this file."
        )
        raise CalibrationFormatError(message, findings)
    known = document["calibrations"].items()
    return {name: Source(**{**member, "warnings": from_document(member["warnings"])}) for name, member in known}


def _migrated(document: Any) -> Any:
    """Migrate a document of version 1, whose warnings are strings; return others unchanged."""
    if not isinstance(document, dict) or document.get("format") != FORMAT or document.get("version") != 1:
        return document
    calibrations = document.get("calibrations")
    for member in calibrations.values() if isinstance(calibrations, dict) else ():
        if isinstance(member, dict) and isinstance(texts := member.pop("doubts", None), list):
            member["warnings"] = to_document(Warning("earlier-fit", "warning", str(text)) for text in texts)
    return document | {"version": SOURCES_VERSION}


def save_source(folder: Path, name: str, source: Source) -> None:
    """Record the source of a calibration; the records of others stay."""
    sources = load_sources(folder) | {name: source}
    document = {
        "format": FORMAT,
        "version": SOURCES_VERSION,
        "calibrations": {
            key: asdict(sources[key]) | {"warnings": to_document(sources[key].warnings)} for key in sorted(sources)
        },
    }
    text = json.dumps(document, indent=2, ensure_ascii=False) + "\n"
    with suppress(UnicodeEncodeError):  # a file whose name is not valid text is fitted again each time
        write_bytes_safely(folder / FILE, text.encode())


def find_mesh(calibration: Path, file: str) -> Path | None:
    """Return the mesh file of a calibration: that of `sources.json`, or in the same folder."""
    noted = load_sources(calibration.parent).get(calibration.name)
    candidates = ([noted.mesh] if noted else []) + [file]
    return next((path for name in candidates if os.path.isfile(path := calibration.parent / name)), None)


def changed_inputs(calibration: Path) -> tuple[str, ...]:
    """Return the source files of a calibration, except the mesh, that have changed."""
    noted = load_sources(calibration.parent).get(calibration.name)
    files = {path: known for path, known in noted.inputs.items() if path != noted.mesh} if noted else {}
    return tuple(path for path, known in files.items() if file_hash(calibration.parent / path) not in (known, None))


def lost_plan(calibration: Path) -> str:
    """Return the plan of a calibration if it is missing next to other plans; empty otherwise.

    Without other plans, the calibrations alone were copied to a robot.
    """
    noted = load_sources(calibration.parent).get(calibration.name)
    plan = calibration.parent / noted.plan if noted and noted.plan else None
    if noted is None or plan is None or os.path.lexists(plan) or not any(plan.parent.glob("*.plan.json")):
        return ""
    return noted.plan


def names_file(path: Path, file: Path) -> bool:
    """Return whether a plan, a calibration or a robot names an existing file, which must therefore not be replaced.

    A calibration names its mesh, wherever a file of this geometry is, and the sources that ``sources.json`` has of it.
    A robot names its URDF, its calibrations, and what these name. What cannot be read names nothing.
    """
    if not os.path.isfile(file):
        return False
    path = robot_set.robot_file(path) if robot_set.is_robot(path) else path
    folder = path.parent

    def is_any(files: Iterable[Path]) -> bool:
        return any(is_same_file(file, other) for other in files)

    try:
        match parse(read(path))[0]:
            case {"format": robot_set.FORMAT}:
                robot = robot_set.load_robot_set(path)
                calibrations = [folder / link.calibration for link in robot.links]
                files = [*calibrations, *([folder / robot.urdf.file] if robot.urdf else [])]
                return is_any(files) or any(names_file(calibration, file) for calibration in calibrations)
            case {"format": plan_keys.FORMAT}:
                return is_any(input_files(load_plan(path)))
            case {"mesh": {"file": str(mesh), "sha256": str(sha256)}}:
                noted = load_sources(folder).get(path.name)
                files = [folder / name for name in (mesh, *(noted.inputs if noted else ()))]
                return is_any(files) or is_same_mesh(file, sha256)
    except SkinCalibError:
        pass
    return False


def is_same_mesh(path: Path, sha256: str, link: str = "") -> bool:
    """Return whether a mesh file has the geometry of a hash, in any unit; or whether a link of a URDF has it."""
    if is_urdf(path):
        return load_urdf_mesh(path, link).sha256 == sha256
    raw = read_mesh(path)
    return any(TriangleMesh(raw.vertices * metres, raw.faces).sha256 == sha256 for metres in METRES_PER_UNIT.values())


def relative_path(folder: Path, path: Path) -> str:
    """Return a path relative to a folder, with slashes; absolute on another drive.

    Symbolic links are resolved, because the parent of a link differs from the parent of its target.
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
