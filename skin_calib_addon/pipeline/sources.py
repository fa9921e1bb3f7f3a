"""Where a calibration comes from: the files of its plan, and whether they are those of an earlier fit."""

import os
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from .. import __version__
from ..calibration import robot_set
from ..calibration.model import LinkCalibration
from ..calibration.source_record import Source, load_source
from ..common.atomic_file import is_same_file
from ..common.errors import InvalidMesh, SkinCalibError
from ..common.file_hash import file_hash
from ..common.strict_json import parse, read
from ..geometry.mesh.triangle_mesh import METRES_PER_UNIT, TriangleMesh, read_mesh
from ..plan import Plan, load_plan
from ..plan import keys as plan_keys
from ..plan.skins import ImportedSkin
from ..robot.link_mesh import is_urdf, load_urdf_mesh, plan_mesh_files


@cache
def program() -> str:
    """Return the versions of the program and of its libraries: another one may round or read a mesh differently."""
    own = ", ".join(f"{name} {version(name)}" for name in ("trimesh", "libigl"))
    libraries = f"NumPy {np.__version__}, SciPy {scipy.__version__}, {own}"
    return f"skin-calib {__version__}, {libraries}"


def source_of(path: Path, plan: Plan, folder: Path) -> Source:
    """Return the sources of a new calibration; call it before the fit, so that later changes are found."""
    files = (path, *input_files(plan))
    inputs = {relative_path(folder, file): file_hash(file) or "" for file in files}
    return Source(program(), relative_path(folder, path), relative_path(folder, plan.mesh), inputs, {}, 0, 0.0, ())


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


def names_file(path: Path, file: Path) -> bool:
    """Return whether a plan, a calibration or a robot names an existing file, which must therefore not be replaced.

    A calibration names its mesh, wherever a file of this geometry is, and the sources of its record.
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
                noted = load_source(path)
                files = [folder / name for name in (mesh, *(noted.inputs if noted else ()))]
                return is_any(files) or is_same_mesh(file, sha256)
    except SkinCalibError:
        pass
    return False


def matching_mesh(path: Path, sha256: str, link: str = "") -> TriangleMesh | None:
    """Return the mesh of a file, in any unit, or that of a link of a URDF, if its geometry in metres has a hash."""
    if is_urdf(path):
        candidates = [load_urdf_mesh(path, link)]
    else:
        raw = read_mesh(path)
        candidates = [TriangleMesh(raw.vertices * metres, raw.faces) for metres in METRES_PER_UNIT.values()]
    return next((mesh for mesh in candidates if mesh.sha256 == sha256), None)


def mesh_of(path: Path, calibration: LinkCalibration) -> TriangleMesh:
    """Return the mesh of a calibration file, if it is unchanged where its record names it, or next to the file."""
    record = load_source(path)
    for name in dict.fromkeys(((record.mesh,) if record else ()) + (calibration.mesh.file,)):
        with suppress(SkinCalibError):
            if (mesh := matching_mesh(path.parent / name, calibration.mesh.sha256, calibration.link)) is not None:
                return mesh
    raise InvalidMesh(
        f"{calibration.mesh.file}, the mesh of '{path}', is not found unchanged. "
        "Name the plan instead of the calibration."
    )


def is_same_mesh(path: Path, sha256: str, link: str = "") -> bool:
    """Return whether a mesh file has the geometry of a hash, in any unit; or whether a link of a URDF has it."""
    return matching_mesh(path, sha256, link) is not None


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
