"""Check calibration documents of older versions, and migrate them version by version."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..common.encoding import checksum
from ..common.findings import Finding
from ..common.schema_check import check
from ..common.schema_types import Schema, has_type
from .validate import VERSION, checksum_findings

Document = dict[str, Any]


@dataclass(frozen=True)
class Step:
    """Migration from one version to the next."""

    schema: Schema  # of the older version
    migrate: Callable[[Document], Document]  # of a valid document; the caller renews the checksum


# Keys are the older versions. Version 1 is the first version, so that no step exists yet. The folder
# tests/golden/versions contains a file of each released version.
STEPS: dict[int, Step] = {}


def migrated(document: Any) -> tuple[Any, tuple[Finding, ...]]:
    """Migrate a document of an older version to the current version; return others unchanged.

    Returns
    -------
    document : JSON value
        Of the current version, or of the version at which the migration stopped.
    findings : tuple of Finding
        Problems of the returned document. Empty if the document has the current version.
    """
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
    return STEPS.get(int(version)) if has_type(version, "integer") and version < VERSION else None
