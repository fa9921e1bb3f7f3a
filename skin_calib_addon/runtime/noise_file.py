"""Keep what a skin learned at rest in a file, and read it back for the same calibration."""

import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..common.arrays import Array
from ..common.atomic_file import write_bytes_safely
from ..common.encoding import checksum, encode
from ..common.errors import CalibrationFormatError
from ..common.findings import Finding, error, in_short
from ..common.schema_check import check, read_schema
from ..common.strict_json import parse, read
from .noise import Noise

FORMAT = "skin-noise"  # Format
NOISE_VERSION = 1  # Format: version of these files
# Format: what null stands for in the members that may not be finite
INFINITE = {"repeats": np.inf, "frame_repeats": np.inf, "clip": -np.inf, "detection_limits": np.nan}


def save_noise(path: str | os.PathLike[str], calibration: str, link: str, baseline: Array, noise: Noise | None) -> None:
    """Write baseline (n,) and noise of a skin in one step; ``calibration`` is the checksum of its calibration."""
    learned = None if noise is None else {name: _value(value) for name, value in vars(noise).items() if name in FIELDS}
    document = {"format": FORMAT, "version": NOISE_VERSION, "link": link}
    document |= {"calibration": calibration, "baseline": baseline.tolist(), "noise": learned}
    write_bytes_safely(path, encode(document | {"checksum": checksum(document)}))


def load_noise(path: str | os.PathLike[str], calibration: str, sign: Array) -> tuple[Array, Noise | None]:
    """Read baseline (n,) and noise of a skin with this checksum of its calibration, and these signs (n,) of responses.

    If it is invalid, or of another calibration, raise a CalibrationFormatError whose ``findings`` have every problem.
    """
    document, findings = parse(read(path))
    findings = tuple(findings) or check_noise(document) or tuple(_of_another(document, calibration, sign))
    if findings:
        raise CalibrationFormatError(f"'{path}' is no noise of this skin: {in_short(findings)}", findings)
    return np.array(document["baseline"], float), noise_from(document)


def noise_from(document: dict[str, Any]) -> Noise | None:
    """Return the noise of a valid document; None if it has none."""
    learned = document["noise"]
    return None if learned is None else Noise(**{name: _number(name, learned[name]) for name in FIELDS})


def check_noise(document: Any) -> tuple[Finding, ...]:
    """Return the errors of a document of these files."""
    return check(document, schema()) or tuple(_wrong(document))


@cache
def schema() -> Any:
    """Return the JSON Schema of these files."""
    return read_schema(Path(__file__).with_name("noise_schema.json"))


FIELDS = tuple(Noise.__dataclass_fields__)  # Format: members of the noise


def _value(value: Any) -> Any:
    """Return an array or a number as JSON, with null for what is not finite."""
    if np.ndim(value):
        return value.tolist() if value.dtype == bool else [_value(x) for x in value.tolist()]
    return value if np.isfinite(value) else None


def _number(name: str, value: Any) -> Any:
    """Return a member of the noise as an array or a number."""
    if isinstance(value, list):
        return np.array([INFINITE[name] if x is None else x for x in value], bool if name == "dead" else float)
    return INFINITE[name] if value is None else float(value)


def _wrong(document: dict[str, Any]) -> Iterator[Finding]:
    """Yield what is wrong with a document of valid form."""
    if document["checksum"] != checksum(document):
        yield error("checksum", "/checksum", "differs from that of the content, which was changed")
    learned, n = document["noise"] or {}, len(document["baseline"])
    for name, value in learned.items():
        if isinstance(value, list) and len(value) != n:
            yield error("length", f"/noise/{name}", f"has {len(value)} numbers; the baseline has {n}")
    sigma, dead = learned.get("sigma", []), learned.get("dead", [])
    if any(s <= 0 and not d for s, d in zip(sigma, dead)):
        yield error("range", "/noise/sigma", "must be above 0 for each taxel that is not dead")


def _of_another(document: dict[str, Any], calibration: str, sign: Array) -> Iterator[Finding]:
    """Yield what does not fit the skin."""
    if document["calibration"] != calibration:
        yield error("calibration", "/calibration", "is of another calibration; tare again with this one")
    elif len(document["baseline"]) != len(sign) or (document["noise"] and document["noise"]["sign"] != sign.tolist()):
        yield error("sign", "/noise/sign", "differs from that of the responses; tare again with this calibration")
