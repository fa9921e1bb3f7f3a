"""Write calibrations to files, and read them back without any loss."""

import os
from collections.abc import Callable, Iterable
from dataclasses import asdict
from typing import Any, TypeVar

import numpy as np

from ..common.arrays import Array
from ..common.atomic_file import write_bytes_safely
from ..common.encoding import checksum, encode
from ..common.errors import CalibrationFormatError
from ..common.findings import Finding, in_short
from ..common.mesh_uncertainty import MeshUncertainty
from ..common.schema_check import check
from ..common.strict_json import parse, read
from ..common.surface_errors import DistanceStatistics, SurfaceErrors
from ..common.warnings import from_document as warnings_from
from ..common.warnings import to_document as warnings_document
from .migration import migrated
from .modality import modality_document, modality_from
from .model import LinkCalibration, MeshSource, Patch, Registration, SurfaceModel, TaxelArray, Touched, Trusted
from .parts import STORED_ROUNDING
from .response import response_document, response_from
from .validate import CALIBRATION_VERSION, FORMAT, SCHEMA, validate, validate_content

Document = dict[str, Any]
T = TypeVar("T")

_VECTORS = {
    "uv": "uv",
    "position": "positions_link",
    "normal": "normals_link",
    "tangent": "tangents_link",
    "corners": "corners_link",
    "area": "areas",
}
_DISTANCES = ("mean", "rms", "max")
_REGISTRATION = ("origin", "direction", "anchor")
_QUALITY = ("collision", "gap", "overhang", "pitch_error", "size", "strain", "tilt")


def save_calibration(calibration: LinkCalibration, path: str | os.PathLike[str]) -> None:
    """Write a calibration file in one step; the old file stays until the new one is complete.

    Parameters
    ----------
    calibration : LinkCalibration
        It is validated before it is written.
    path : path
        Its folder must exist.

    Raises
    ------
    CalibrationFormatError
        If the calibration is invalid. No file is written.
    OutputError
        If the file cannot be written.
    """
    document = to_document(calibration)
    _refuse_errors(validate_content(document), f"the calibration of '{calibration.link}'")
    write_bytes_safely(path, encode(document))


def load_calibration(path: str | os.PathLike[str]) -> LinkCalibration:
    """Read and validate a calibration file.

    Raises
    ------
    CalibrationFormatError
        If the file cannot be read, or is invalid; ``findings`` lists all problems.
    """
    return load_with_warnings(path)[0]


def load_with_warnings(path: str | os.PathLike[str]) -> tuple[LinkCalibration, tuple[Finding, ...]]:
    """Read a calibration file as `load_calibration`, and return its warnings too."""
    document, findings = check_bytes(read(path))
    _refuse_errors(findings, f"'{path}'")
    return from_document(document), findings


def check_calibration(path: str | os.PathLike[str]) -> tuple[Finding, ...]:
    """Return all errors and warnings of a calibration file; raise only if it cannot be read."""
    return check_bytes(read(path))[1]


def check_bytes(data: bytes) -> tuple[Any, tuple[Finding, ...]]:
    """Parse and validate the bytes of a calibration file.

    Returns
    -------
    document : JSON value
        None if the bytes cannot be parsed. A document of an older version is migrated.
    findings : tuple of Finding
        All problems. Problems of an older version refer to the document before its migration.
    """
    document, findings = parse(data)
    if document is None and findings:
        return None, findings
    if not findings:
        document, findings = migrated(document)
        if findings:
            return document, findings
    known = {finding.pointer for finding in findings}
    return document, findings + tuple(f for f in validate(document) if f.pointer not in known)


def to_document(calibration: LinkCalibration) -> Document:
    """Convert a calibration to the JSON document of its file, with checksum.

    Raises
    ------
    CalibrationFormatError
        If the calibration contains NaN, a Python object, or a free member whose name does not begin with ``x_``.
    """
    name, stated = f"the calibration of '{calibration.link}'", calibration.mesh.uncertainty
    document = {
        "format": FORMAT,
        "version": CALIBRATION_VERSION,
        "generator": calibration.generator,
        "units": {"length": "m", "force": "N", "angle": "rad"},
        "link": calibration.link,
        "mesh": {
            "file": calibration.mesh.file,
            "sha256": calibration.mesh.sha256,
            "vertices": int(calibration.mesh.vertices),
            "faces": int(calibration.mesh.faces),
            **({"uncertainty": asdict(stated)} if stated else {}),
        },
        "surfaces": [_surface_document(surface) for surface in calibration.surfaces],
        "patches": [_patch_document(patch) for patch in calibration.patches],
        "response": response_document(calibration.response),
        **({"responses": [response_document(r) for r in calibration.responses]} if calibration.responses else {}),
        **({"modalities": [modality_document(m) for m in calibration.modalities]} if calibration.modalities else {}),
        "warnings": warnings_document(calibration.warnings),
        **_free(calibration.extra),
    }
    try:
        return {**document, "checksum": checksum(document)}
    except (TypeError, ValueError, RecursionError) as problem:
        findings = [finding for finding in check(document, SCHEMA) if finding.code != "missing"]
        _refuse_errors(findings, name)
        raise CalibrationFormatError(f"{name} cannot be written as JSON: {problem}") from problem


def from_document(document: Document) -> LinkCalibration:
    """Convert a document without errors (see `validate`) to a calibration."""
    mesh = document["mesh"]
    stated = MeshUncertainty(**mesh["uncertainty"]) if "uncertainty" in mesh else None
    return LinkCalibration(
        link=document["link"],
        mesh=MeshSource(mesh["file"], mesh["sha256"], int(mesh["vertices"]), int(mesh["faces"]), stated),
        surfaces=tuple(_surface(surface) for surface in document["surfaces"]),
        patches=tuple(_patch(patch) for patch in document["patches"]),
        response=response_from(document["response"]),
        responses=tuple(response_from(response) for response in document.get("responses", ())),
        modalities=tuple(modality_from(modality) for modality in document.get("modalities", ())),
        warnings=warnings_from(document["warnings"]),
        generator=document["generator"],
        extra=_extra(document),
    )


def _surface_document(surface: SurfaceModel) -> Document:
    return {
        "name": surface.name,
        "degree": [int(degree) for degree in surface.degree],
        "knots": [_floats(surface.knots_u), _floats(surface.knots_v)],
        "control_net": _floats(surface.control_net),
        "closed": [bool(closed) for closed in surface.closed],
        "errors": {
            "mesh_to_surface": _numbers(surface.errors.mesh_to_surface, _DISTANCES),
            "surface_to_mesh": _numbers(surface.errors.surface_to_mesh, _DISTANCES),
            "hausdorff": float(surface.errors.hausdorff),
        },
        "trusted": _trusted_document(surface.trusted),
        **_free(surface.extra),
    }


def _surface(document: Document) -> SurfaceModel:
    errors = document["errors"]
    there, back = _distances(errors["mesh_to_surface"]), _distances(errors["surface_to_mesh"])
    return SurfaceModel(
        name=document["name"],
        degree=_pair(document["degree"], int),
        knots_u=np.array(document["knots"][0], float),
        knots_v=np.array(document["knots"][1], float),
        control_net=np.array(document["control_net"], float),
        closed=_pair(document["closed"], bool),
        errors=SurfaceErrors(there, back, float(errors["hausdorff"])),
        trusted=_trusted(document["trusted"]),
        extra=_extra(document),
    )


def _trusted_document(trusted: Trusted | None) -> Document | None:
    if trusted is None:
        return None
    return {"boundary": [_floats(loop) for loop in trusted.boundary], "sites": list(trusted.sites)}


def _trusted(document: Document | None) -> Trusted | None:
    if document is None:
        return None
    return Trusted(tuple(np.array(loop, float) for loop in document["boundary"]), tuple(document["sites"]))


def _patch_document(patch: Patch) -> Document:
    taxels = patch.taxels
    columns = {
        "id": list(taxels.ids),
        "channel": taxels.channels.tolist(),
        "index": taxels.index.tolist(),
        **{name: _floats(getattr(taxels, field)) for name, field in _VECTORS.items()},
        "neighbours": [list(ids) for ids in taxels.neighbours],
        **({"ports": [list(ids) for ids in taxels.ports]} if taxels.ports else {}),
        **({"response": taxels.responses.tolist()} if len(taxels.responses) else {}),
        **({"sigma": _rows_or_null(taxels.sigma)} if len(taxels.sigma) else {}),
        **{name: _floats(column) for name, column in sorted(taxels.quality.items())},
    }
    return {
        "name": patch.name,
        "kind": patch.kind,
        "surface": patch.surface,
        "shape": [int(count) for count in patch.shape],
        "pitch": _floats(patch.pitch),
        **({"offset": float(patch.offset)} if patch.offset else {}),
        **({"registration": _numbers(patch.registration, _REGISTRATION)} if patch.registration else {}),
        **({"max_load": float(patch.max_load)} if patch.max_load else {}),
        **({"touches": _touched_document(patch.touches)} if patch.touches else {}),
        "taxels": columns,
        **_free(patch.extra),
    }


def _patch(document: Document) -> Patch:
    columns = document["taxels"]
    taxels = TaxelArray(
        ids=tuple(columns["id"]),
        channels=np.array(columns["channel"], np.int64),
        index=np.array(columns["index"], np.int64),
        **_unit_frames({field: np.array(columns[name], float) for name, field in _VECTORS.items()}),
        neighbours=tuple(map(tuple, columns["neighbours"])),
        ports=tuple(map(tuple, columns.get("ports", ()))),
        responses=np.array(columns.get("response", ()), np.int64),
        sigma=_rows_or_nan(columns.get("sigma", ())),
        quality={name: np.array(columns[name], float) for name in _QUALITY if name in columns},
    )
    return Patch(
        name=document["name"],
        kind=document["kind"],
        surface=document["surface"],
        shape=_pair(document["shape"], int),
        pitch=_pair(document["pitch"], float),
        offset=float(document.get("offset", 0.0)),
        registration=_registration(document["registration"]) if "registration" in document else None,
        max_load=float(document["max_load"]) if "max_load" in document else None,
        touches=_touched(document["touches"]) if "touches" in document else None,
        taxels=taxels,
        extra=_extra(document),
    )


def _unit_frames(vectors: dict[str, Array]) -> dict[str, Array]:
    """Normalize normals and tangents that were written in single precision; others stay as they are, to the bit."""
    normals, tangents = vectors["normals_link"], vectors["tangents_link"]
    unit_normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    across = tangents - (tangents * unit_normals).sum(axis=1)[:, None] * unit_normals
    unit_tangents = across / np.linalg.norm(across, axis=1)[:, None]
    for name, exact in (("normals_link", unit_normals), ("tangents_link", unit_tangents)):
        rounded = np.abs(vectors[name] - exact).max(axis=1) > STORED_ROUNDING
        vectors[name][rounded] = exact[rounded]
    return vectors


def _registration(document: Document) -> Registration:
    x, y, z = map(float, document["anchor"])
    return Registration(float(document["origin"]), float(document["direction"]), (x, y, z))


def _touched_document(touched: Touched) -> Document:
    """Return the members that are known; numbers become floats."""
    counts = {name: int(getattr(touched, name)) for name in ("used", "left_out")}
    names = ("shift", "turn", "covariance", "anchor", "along", "normal", "angle")
    known = [name for name in names if getattr(touched, name) is not None]
    return {
        "date": touched.date,
        **({"session": touched.session} if touched.session else {}),
        **counts,
        **_numbers(touched, known),
    }


def _touched(document: Document) -> Touched:
    kinds = {"date": str, "session": str, "used": int, "left_out": int}
    return Touched(**{"session": ""} | {name: kinds.get(name, _tuples)(value) for name, value in document.items()})


def _tuples(value: Any) -> Any:
    """Return nested tuples of floats."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else float(value)


def _distances(document: Document) -> DistanceStatistics:
    return DistanceStatistics(*(float(document[name]) for name in _DISTANCES))


def _numbers(record: object, names: Iterable[str]) -> Document:
    """Return the named fields of a record as floats."""
    return {name: _floats(getattr(record, name)) for name in names}


def _floats(values: Any) -> Any:
    """Return nested lists of floats; 1 becomes 1.0, so that equal calibrations have equal files."""
    return np.asarray(values, float).tolist()


def _rows_or_null(rows: Array) -> list[Any]:
    """Return nested lists of floats; null for a row of NaN."""
    return [None if np.isnan(row).any() else row.tolist() for row in rows]


def _rows_or_nan(rows: Iterable[list[float] | None]) -> Array:
    """Return rows (n, 3) of numbers; NaN for null."""
    return np.array([[np.nan] * 3 if row is None else row for row in rows], float).reshape(-1, 3)


def _pair(values: list[Any], kind: Callable[[Any], T]) -> tuple[T, T]:
    return kind(values[0]), kind(values[1])


def _free(extra: Document) -> Document:
    for name in extra:
        if not name.startswith("x_"):
            raise CalibrationFormatError(f"the name of a free member must begin with 'x_', not be '{name}'")
    return extra


def _extra(document: Document) -> Document:
    return {name: member for name, member in document.items() if name.startswith("x_")}


def _refuse_errors(findings: Iterable[Finding], name: str) -> None:
    findings = tuple(findings)
    if any(finding.severity == "error" for finding in findings):
        raise CalibrationFormatError(f"{name} has {in_short(findings)}", findings)
