"""Plan files: read, checked, written."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..calibration.modality import modalities_are_distinct
from ..calibration.response_checks import responses_are_monotone
from ..calibration.validate import other_file
from ..common.atomic_file import write_bytes_safely
from ..common.errors import CalibrationFormatError, InvalidPlan
from ..common.findings import Finding, error
from ..common.schema_check import check
from ..common.schema_types import is_same
from ..common.strict_json import parse, read
from .checks import frames_are_rotations
from .document import plan_document, plan_from
from .keys import FORMAT, PLAN_VERSION, PLANS
from .plan import Plan
from .schema import plan_schema
from .skins import ImportedSkin


def load_plan(path: str | Path) -> Plan:
    """Read a plan file; paths in it become relative to the file's folder.

    Raises
    ------
    CalibrationFormatError
        If the file is missing or breaks the schema; ``findings`` lists everything found.
    InvalidPlan
        If its members contradict each other.
    """
    path = Path(path)
    document, findings = parse(read(path))
    findings = tuple(findings) or check_plan(document)
    if findings:
        more = f" (and {len(findings) - 1} more: run check)" if len(findings) > 1 else ""
        raise CalibrationFormatError(f"{path.name} is not a valid plan: {findings[0]}{more}", findings)
    plan = plan_from(document)
    skins = tuple(
        replace(skin, file=path.parent / skin.file) if isinstance(skin, ImportedSkin) else skin for skin in plan.skins
    )
    return replace(plan, mesh=path.parent / plan.mesh, skins=skins)


def save_plan(plan: Plan, path: str | Path) -> None:
    """Write a plan file; an error leaves an old file unchanged.

    Parameters
    ----------
    plan : Plan
        In metres in the link frame; the path of its mesh is written unchanged.
    path : path
        The file.

    Raises
    ------
    InvalidPlan
        If two skins have a channel in common, or one ends beyond the highest channel, or the file could not be read.
    OutputError
        If the file cannot be written.
    """
    document = plan_document(plan)
    for finding in check_plan(document):
        raise InvalidPlan(f"no plan may have what {Path(path).name} would have: {finding}")
    write_bytes_safely(path, (json.dumps(document, indent=2, ensure_ascii=False) + "\n").encode())


def check_plan(document: Any) -> tuple[Finding, ...]:
    """Return every place where a document breaks the schema, or a part of it contradicts itself."""
    other = tuple(other_file(document, FORMAT, PLAN_VERSION))
    if other:
        return other
    version = document.get("version") if isinstance(document, dict) else None
    known = next((known for known in PLANS if is_same(version, known)), 1)
    findings = check_part(document, f"version_{known}")
    checks = (responses_are_monotone, modalities_are_distinct, frames_are_rotations)
    return (*findings, *(finding for more in checks for finding in more(document, findings)))


def check_plan_wholly(document: Any) -> tuple[Finding, ...]:
    """Return the same, or what of its members contradicts another where each is right alone."""
    findings = check_plan(document)
    if not findings:
        try:
            plan_from(document)
        except InvalidPlan as problem:
            findings = (error("plan", "", f"cannot be carried out: {problem}"),)
    return findings


def check_part(document: Any, name: str) -> tuple[Finding, ...]:
    """Return every place where a document breaks a definition of the plan's schema, such as ``frame`` or ``sheet``."""
    definitions = plan_schema()["$defs"]
    return check(document, definitions[name] | {"$defs": definitions})
