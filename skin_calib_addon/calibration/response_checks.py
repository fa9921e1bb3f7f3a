"""Check the responses of a calibration or of a plan."""

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ..common.arrays import Array
from ..common.findings import Finding, child, error, show
from .parts import STORED_ROUNDING, Part, items_of, pointers_with_findings

# Fraction of the largest coefficient below which the leading coefficients of a slope count as zero.
# Smaller: inaccurate roots; larger: real roots are lost.
COEFFICIENT_TOLERANCE = 1e-14
# Derived: binomial coefficients (i over k), for up to 16 coefficients as in the schema
BINOMIALS = np.array([[math.comb(i, k) for k in range(16)] for i in range(16)], float)


def responses_are_monotone(document: Any, findings: Iterable[Finding]) -> Iterator[Finding]:
    """Yield the errors of all responses that are valid by the schema."""
    touched = pointers_with_findings(findings)
    for pointer, response in _responses(document):
        if pointer not in touched:
            yield from response_findings(response, pointer)


def responses_exist(document: Any, patches: Iterable[Part]) -> Iterator[Finding]:
    """Check that the response index of each taxel is in the list."""
    listed = document.get("responses", []) if isinstance(document, dict) else None
    if not isinstance(listed, list):
        return
    for patch in patches:
        for row in np.flatnonzero(patch.members.get("response", np.empty(0)) >= len(listed)):
            index = int(patch.members["response"][row])
            message = f"is {index}, but the file has {len(listed)} responses, counted from 0"
            yield error("unknown-response", patch.at("response", row), message, index)


def response_findings(response: dict[str, Any], pointer: str) -> Iterator[Finding]:
    """Yield the errors of one response that is valid by the schema."""
    with np.errstate(all="ignore"):
        if response["kind"] == "table":
            yield from _table_findings(response, pointer)
        elif "range" in response:
            yield from _range_findings(response, child(pointer, "range"))


def _responses(document: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(document, dict) and "response" in document:
        yield "/response", document["response"]
    for index, response in enumerate(items_of(document, "responses")):
        yield f"/responses/{index}", response
    for index, modality in enumerate(items_of(document, "modalities")):
        if isinstance(modality, dict) and "response" in modality:
            yield f"/modalities/{index}/response", modality["response"]


def _table_findings(table: dict[str, Any], pointer: str) -> Iterator[Finding]:
    readings, forces = np.array(table["readings"], float), np.array(table["forces"], float)
    if len(forces) != len(readings):
        message = f"contains {len(forces)} forces, but 'readings' has {len(readings)}"
        yield error("length", child(pointer, "forces"), message, table["forces"])
    row = _first(np.diff(readings) <= 0)
    if row is not None:
        value = table["readings"][row]
        message = f"is {show(value)}, not larger than the previous reading; readings must increase"
        yield error("not-increasing", child(pointer, "readings", row), message, value)
    elif readings[-1] - readings[0] == np.inf:
        yield _too_wide(child(pointer, "readings"), table["readings"])
    steps = np.diff(forces)
    reversed_steps = np.sign(steps) * np.sign(forces[-1] - forces[0]) < 0
    row = _first(reversed_steps if forces[-1] != forces[0] else steps != 0)
    if row is not None:
        value = table["forces"][row]
        message = f"is {show(value)}, which reverses the direction; forces must only increase or only decrease"
        yield error("not-monotone", child(pointer, "forces", row), message, value)


def _range_findings(response: dict[str, Any], pointer: str) -> Iterator[Finding]:
    low, high = response["range"]
    if not low < high:
        yield error("not-increasing", pointer, f"must be [low, high], not [{show(low)}, {show(high)}]", [low, high])
    elif float(high) - float(low) == np.inf:
        yield _too_wide(pointer, [low, high])
    elif not is_monotone(response["coefficients"], low, high):
        message = (
            "contains readings at which the force is not monotone or overflows; reduce it, or fit the response again"
        )
        yield error("not-monotone", pointer, message, [low, high])


def is_monotone(coefficients: Any, low: float, high: float) -> bool:
    """Return whether a polynomial is monotone between two readings, up to rounding."""
    with np.errstate(all="ignore"):
        shifted = _shifted(np.array(coefficients, float), float(low), float(high))
        if not np.isfinite(np.abs(shifted).sum()):
            return False
        return _same_sign(_slope_bounds(shifted)) or _is_monotone_by_roots(shifted)


def _shifted(coefficients: Array, low: float, high: float) -> Array:
    """Return coefficients (k,) in t, where reading = low + (high - low) t and t is in [0, 1]."""
    shifted = np.zeros_like(coefficients)
    for coefficient in coefficients[::-1]:  # Horner's scheme
        rest = shifted[:-1] * (high - low)
        shifted *= low
        shifted[1:] += rest
        shifted[0] += coefficient
    return shifted


def _slope_bounds(shifted: Array) -> Array:
    """Return the Bernstein coefficients (m,) of the slope on [0, 1], which bound it."""
    m = len(shifted) - 1
    return np.asarray(shifted[1:] * np.arange(1, m + 1) / BINOMIALS[max(m - 1, 0), :m] @ BINOMIALS[:m, :m].T)


def _same_sign(steps: Array) -> bool:
    """Return whether steps (m,) are all nonnegative or all nonpositive."""
    return bool((steps >= 0).all() or (steps <= 0).all())


def _is_monotone_by_roots(shifted: Array) -> bool:
    """Return whether a polynomial is monotone on [0, 1], from its values where the slope is zero."""
    slope = shifted[1:] * np.arange(1, len(shifted))
    size = np.abs(slope).max()
    slope = np.trim_zeros(np.where(np.abs(slope) > COEFFICIENT_TOLERANCE * size, slope / size, 0.0), "b")
    # The real part of each complex root is included: additional points do no harm.
    points = np.sort(np.concatenate(((0.0, 1.0), np.clip(np.roots(slope[::-1]).real, 0, 1))))
    values = np.polynomial.polynomial.polyval(points, shifted)
    steps, most = np.diff(values), STORED_ROUNDING * np.ptp(values)
    return bool((steps >= -most).all() or (steps <= most).all())


def _first(wrong: Any) -> int | None:
    """Return the row after the first invalid step."""
    rows = np.flatnonzero(wrong)
    return int(rows[0]) + 1 if len(rows) else None


def _too_wide(pointer: str, value: Any) -> Finding:
    return error("not-increasing", pointer, "spans a range that exceeds the largest floating-point number", value)
