"""What must hold for the responses of a calibration, or of a plan."""

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ..common.arrays import Array, BoolArray
from ..common.findings import Finding, child, error, show
from .parts import Part, pointers_with_findings

REVERSAL_TOLERANCE = (
    1e-9  # of the forces on the range: a polynomial may run back by this, for its coefficients are rounded
)
COEFFICIENT_TOLERANCE = 1e-14  # of the largest coefficient of a slope on [0, 1]
BINOMIALS = np.array([[math.comb(i, k) for k in range(16)] for i in range(16)], float)


def responses_are_monotone(document: Any, findings: Iterable[Finding]) -> Iterator[Finding]:
    """Of the responses of a document in which the schema found nothing, those that are none."""
    touched = pointers_with_findings(findings)
    sound = [(pointer, response) for pointer, response in _responses(document) if pointer not in touched]
    with np.errstate(all="ignore"):
        rows_to_check = _possibly_wrong([response for _, response in sound])
    for row in rows_to_check:
        yield from response_findings(sound[row][1], sound[row][0])


def responses_exist(document: Any, patches: Iterable[Part]) -> Iterator[Finding]:
    """Every taxel's response is one of the list."""
    listed = document.get("responses", []) if isinstance(document, dict) else None
    if not isinstance(listed, list):
        return
    for patch in patches:
        for row in np.flatnonzero(patch.members.get("response", np.empty(0)) >= len(listed)):
            index = int(patch.members["response"][row])
            message = f"is {index}, but the file has {len(listed)} responses, counted from 0"
            yield error("unknown-response", patch.at("response", row), message, index)


def response_findings(response: dict[str, Any], pointer: str) -> Iterator[Finding]:
    """What is wrong with one response that keeps the schema."""
    with np.errstate(all="ignore"):
        if response["kind"] == "table":
            yield from _table_findings(response, pointer)
        elif "range" in response:
            yield from _range_findings(response, child(pointer, "range"))


def _responses(document: Any) -> Iterator[tuple[str, Any]]:
    if not isinstance(document, dict):
        return
    if "response" in document:
        yield "/response", document["response"]
    listed = document.get("responses")
    for index, response in enumerate(listed if isinstance(listed, list) else ()):
        yield f"/responses/{index}", response


def _possibly_wrong(responses: list[dict[str, Any]]) -> list[int]:
    """Rows of all but those that a look at all of one shape at once finds sound; there may be one for each taxel."""
    alike = defaultdict(list)
    for row, response in enumerate(responses):
        if response["kind"] == "table":
            alike["table", len(response["readings"]), len(response["forces"])].append(row)
        elif "range" in response:
            alike["polynomial", len(response["coefficients"]), 2].append(row)
    rows_to_check: list[int] = []
    for (kind, *_), rows in alike.items():
        is_sound = _surely_monotone_tables if kind == "table" else _surely_monotone_polynomials
        rows_to_check += np.array(rows)[~is_sound([responses[row] for row in rows])].tolist()
    return sorted(rows_to_check)


def _surely_monotone_tables(tables: list[dict[str, Any]]) -> BoolArray:
    """Of tables of one length, whether each surely rises and its forces go one way, shape (n,)."""
    readings, forces = (np.array([table[name] for table in tables], float) for name in ("readings", "forces"))
    if readings.shape != forces.shape:
        return np.zeros(len(tables), bool)
    rise = (np.diff(readings) > 0).all(axis=1) & np.isfinite(readings[:, -1] - readings[:, 0])
    return rise & _same_sign(np.diff(forces))


def _surely_monotone_polynomials(polynomials: list[dict[str, Any]]) -> BoolArray:
    """Of polynomials of one degree, whether each surely goes one way on its range, shape (n,)."""
    coefficients, ranges = (np.array([p[name] for p in polynomials], float) for name in ("coefficients", "range"))
    shifted = _shifted(coefficients, *ranges.T)
    return (ranges[:, 0] < ranges[:, 1]) & np.isfinite(np.abs(shifted).sum(axis=1)) & _same_sign(_slope_bounds(shifted))


def _table_findings(table: dict[str, Any], pointer: str) -> Iterator[Finding]:
    readings, forces = np.array(table["readings"], float), np.array(table["forces"], float)
    if len(forces) != len(readings):
        message = f"holds {len(forces)} forces, 'readings' {len(readings)}"
        yield error("length", child(pointer, "forces"), message, table["forces"])
    row = _first(np.diff(readings) <= 0)
    if row is not None:
        value = table["readings"][row]
        message = f"is {show(value)}, not above the reading before it; readings must increase"
        yield error("not-increasing", child(pointer, "readings", row), message, value)
    elif readings[-1] - readings[0] == np.inf:
        yield _too_wide(child(pointer, "readings"), table["readings"])
    steps = np.diff(forces)
    reversed_steps = np.sign(steps) * np.sign(forces[-1] - forces[0]) < 0
    row = _first(reversed_steps if forces[-1] != forces[0] else steps != 0)
    if row is not None:
        value = table["forces"][row]
        message = f"is {show(value)}, against the way from the first force to the last; forces must not turn round"
        yield error("not-monotone", child(pointer, "forces", row), message, value)


def _range_findings(response: dict[str, Any], pointer: str) -> Iterator[Finding]:
    low, high = response["range"]
    if not low < high:
        yield error("not-increasing", pointer, f"must be [low, high], not [{show(low)}, {show(high)}]", [low, high])
    elif float(high) - float(low) == np.inf:
        yield _too_wide(pointer, [low, high])
    elif not is_monotone(response["coefficients"], low, high):
        message = "holds readings where the force turns round or overflows; narrow it, or fit the response anew"
        yield error("not-monotone", pointer, message, [low, high])


def is_monotone(coefficients: Any, low: float, high: float) -> bool:
    """Whether a polynomial rises or falls all the way between two readings, rounding apart."""
    with np.errstate(all="ignore"):
        shifted = _shifted(np.array(coefficients, float), float(low), float(high))
        if not np.isfinite(np.abs(shifted).sum()):
            return False
        return bool(_same_sign(_slope_bounds(shifted))) or _is_monotone_by_roots(shifted)


def _shifted(coefficients: Array, low: Any, high: Any) -> Array:
    """Polynomials (..., k) of a place on [0, 1] instead of a reading between low and high (...)."""
    low, width = np.expand_dims(low, -1), np.expand_dims(high - low, -1)
    shifted = np.zeros_like(coefficients)
    for k in range(coefficients.shape[-1] - 1, -1, -1):  # Horner's scheme
        rest = shifted[..., :-1] * width
        shifted *= low
        shifted[..., 1:] += rest
        shifted[..., 0] += coefficients[..., k]
    return shifted


def _slope_bounds(shifted: Array) -> Array:
    """Bernstein coefficients (..., m) of slopes on [0, 1], which lie between the least and the largest of them."""
    m = shifted.shape[-1] - 1
    return np.asarray(shifted[..., 1:] * np.arange(1, m + 1) / BINOMIALS[max(m - 1, 0), :m] @ BINOMIALS[:m, :m].T)


def _same_sign(steps: Array) -> BoolArray:
    """Whether steps (..., m) all rise or all fall."""
    return (steps >= 0).all(axis=-1) | (steps <= 0).all(axis=-1)


def _is_monotone_by_roots(shifted: Array) -> bool:
    """Whether a polynomial goes one way on [0, 1], by the places where its slope is zero."""
    slope = shifted[1:] * np.arange(1, len(shifted))
    size = np.abs(slope).max()
    slope = np.trim_zeros(np.where(np.abs(slope) > COEFFICIENT_TOLERANCE * size, slope / size, 0.0), "b")
    # More places than those where the slope is zero do no harm: of each root the real part is looked at.
    places = np.sort(np.concatenate(((0.0, 1.0), np.clip(np.roots(slope[::-1]).real, 0, 1))))
    values = np.polynomial.polynomial.polyval(places, shifted)
    steps, most = np.diff(values), REVERSAL_TOLERANCE * np.ptp(values)
    return bool((steps >= -most).all() or (steps <= most).all())


def _first(wrong: Any) -> int | None:
    """The row after the first step that is wrong."""
    rows = np.flatnonzero(wrong)
    return int(rows[0]) + 1 if len(rows) else None


def _too_wide(pointer: str, value: Any) -> Finding:
    return error("not-increasing", pointer, "spans more than a number can tell", value)
