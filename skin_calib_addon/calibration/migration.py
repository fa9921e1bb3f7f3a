"""Files of older versions: each is checked as what it is, and brought to ours a version at a time."""

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
    """From one version to the next."""

    schema: Schema  # of the older version, as it was released
    migrate: Callable[[Document], Document]  # of a document that keeps that schema; its checksum is made anew


# By the version that a step begins at. Version 1 is the first, so there is none yet; tests/golden/versions has a file
# of each version that was released.
STEPS: dict[int, Step] = {}


def migrated(document: Any) -> tuple[Any, tuple[Finding, ...]]:
    """A document of an older version as one of ours; any other as it is.

    Returns
    -------
    document
        Of our version, or the last that could be reached.
    findings : tuple of Finding
        Everything that is wrong with the document as it came; pointers lead into it. Empty if it got to our version.
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
