"""What must hold for the responses of a calibration, or of a plan."""

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ..arrays import Array
from .findings import Finding, child, error, show
from .parts import Part, touched_by

TURN = 1e-9  # of the forces on the range: a polynomial may run back by this, for its coefficients are rounded
NEGLIGIBLE = 1e-14  # of the largest coefficient of a slope on [0, 1]
PASCAL = np.array([[math.comb(i, k) for k in range(16)] for i in range(16)], float)


def responses_are_monotone(document: Any, findings: Iterable[Finding]) -> Iterator[Finding]:
    """Of the responses of a document in which the schema found nothing, those that are none."""
    touched = touched_by(findings)
    for pointer, response in _responses(document):
        if pointer not in touched:
            yield from response_findings(response, pointer)


def responses_are_there(document: Any, patches: Iterable[Part]) -> Iterator[Finding]:
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
    turns = np.sign(steps) * np.sign(forces[-1] - forces[0]) < 0
    row = _first(turns if forces[-1] != forces[0] else steps != 0)
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
    shifted = _shifted(coefficients, float(low), float(high))
    if not np.isfinite(np.abs(shifted).sum()):
        return False
    m = len(shifted) - 1
    slope = shifted[1:] * np.arange(1, m + 1)
    hull = PASCAL[:m, :m] @ (slope / PASCAL[m - 1, :m])  # the slope lies between these, its Bernstein coefficients
    if (hull >= 0).all() or (hull <= 0).all():  # most are told so, faster than by their roots
        return True
    return _never_turns(shifted, slope)


def _never_turns(shifted: Array, slope: Array) -> bool:
    """The same by the places where the slope is zero."""
    size = np.abs(slope).max()
    slope = np.trim_zeros(np.where(np.abs(slope) > NEGLIGIBLE * size, slope / size, 0.0), "b")
    # More places than those where the slope is zero do no harm: of each root the real part is looked at.
    places = np.sort(np.concatenate(((0.0, 1.0), np.clip(np.roots(slope[::-1]).real, 0, 1))))
    values = np.polynomial.polynomial.polyval(places, shifted)
    steps, most = np.diff(values), TURN * np.ptp(values)
    return bool((steps >= -most).all() or (steps <= most).all())


def _shifted(coefficients: Any, low: float, high: float) -> Array:
    """The polynomial of a place on [0, 1] instead of a reading between low and high."""
    line, shifted = np.array((low, high - low)), np.array(coefficients[-1:], float)
    for coefficient in coefficients[-2::-1]:
        shifted = np.convolve(shifted, line)
        shifted[0] += coefficient
    return shifted


def _first(wrong: Any) -> int | None:
    """The row after the first step that is wrong."""
    rows = np.flatnonzero(wrong)
    return int(rows[0]) + 1 if len(rows) else None


def _too_wide(pointer: str, value: Any) -> Finding:
    return error("not-increasing", pointer, "spans more than a number can tell", value)
