"""Check calibration documents of older versions, and migrate them version by version."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..common.encoding import checksum
from ..common.findings import Finding
from ..common.schema_check import check, read_schema
from ..common.schema_types import Schema, has_type
from .validate import CALIBRATION_VERSION, FORMAT, checksum_findings, other_file

Document = dict[str, Any]


@dataclass(frozen=True)
class Step:
    """Migration from one version to the next."""

    schema: Schema  # of the older version
    migrate: Callable[[Document], Document]  # of a valid document; the caller renews the checksum


def _to_version_2(document: Document) -> Document:
    """Add an empty list of warnings: version 1 did not store them."""
    return {**document, "version": 2, "warnings": []}


def _to_version_3(document: Document) -> Document:
    """Add that it is not known where surfaces follow their mesh: version 2 did not store it."""
    return {**document, "version": 3, "surfaces": [{**surface, "trusted": None} for surface in document["surfaces"]]}


# Keys are the older versions, each with its schema, which never changes. The folder tests/golden/versions contains a
# file of each released version.
STEPS: dict[int, Step] = {
    1: Step(read_schema(Path(__file__).with_name("schema_1.json")), _to_version_2),
    2: Step(read_schema(Path(__file__).with_name("schema_2.json")), _to_version_3),
}


def migrated(document: Any) -> tuple[Any, tuple[Finding, ...]]:
    """Migrate a document of an older version to the current version; return others unchanged."""
    other = tuple(other_file(document, FORMAT, CALIBRATION_VERSION))
    if other:
        return document, other
    while step := _step(document):
        findings = check(document, step.schema)
        findings += tuple(checksum_findings(document, findings))
        if findings:
            return document, findings
        document = step.migrate(document)
        document = {**document, "checksum": checksum(document)}
    return document, ()


def _step(document: Any) -> Step | None:
    version: Any = document.get("version") if isinstance(document, dict) else None
    return STEPS.get(int(version)) if has_type(version, "integer") and version < CALIBRATION_VERSION else None
