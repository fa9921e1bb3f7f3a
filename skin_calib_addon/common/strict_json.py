"""Read JSON strictly: no ambiguity, no silent loss, limits on size and nesting."""

import codecs
import json
import math
import os
import re
import stat
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from .errors import CalibrationFormatError
from .findings import Finding, FoundError, child, error, first, show
from .plain_text import BLOCK_LENGTH, DecodingError, decoded

MAX_JSON_BYTES = 512 * 2**20  # of any file. Larger: a malicious file uses more memory.
MAX_VALUES = 2**24  # three times the values of 100 000 taxels. Larger: a malicious file uses more memory.
MAX_JSON_DEPTH = 32  # nesting levels. Larger: the recursion of the parser is deeper.

_SURROGATE_ESCAPE = re.compile(r"\\u[dD][89a-fA-F]")
_SURROGATE = re.compile("[\ud800-\udfff]")
_STEP = np.zeros(256, np.int8)
_STEP[list(b"[{")] = 1
_STEP[list(b"]}")] = -1


def read(path: str | os.PathLike[str]) -> bytes:
    """Read the bytes of a file; a file that is too large or not regular is rejected before."""
    size = size_of(path)
    if size > MAX_JSON_BYTES:
        raise CalibrationFormatError(f"cannot read '{path}': its {size} bytes exceed the limit of {MAX_JSON_BYTES}.")
    try:
        with open(path, "rb") as file:
            return file.read(MAX_JSON_BYTES + 1)  # a file may grow, or have no size, as in /proc
    except OSError as problem:
        raise _unreadable(path, problem) from problem


def size_of(path: str | os.PathLike[str]) -> int:
    """Return the size of a file [bytes] without opening it, because a pipe or a device may block."""
    try:
        status = os.stat(path)
    except (OSError, ValueError) as problem:  # ValueError: a NUL in the path
        raise _unreadable(path, problem) from problem
    if not stat.S_ISREG(status.st_mode):
        what = "a folder" if stat.S_ISDIR(status.st_mode) else "not a regular file"
        raise CalibrationFormatError(f"cannot read '{path}': it is {what}. Name a file.")
    return status.st_size


def _unreadable(path: str | os.PathLike[str], problem: Exception) -> CalibrationFormatError:
    reason = getattr(problem, "strerror", None) or problem
    return CalibrationFormatError(f"cannot read '{path}': {reason}. Check the path.")


def parse(data: bytes) -> tuple[Any, tuple[Finding, ...]]:
    """Parse the bytes of a JSON file."""
    try:
        text = _decoded(data)
        _measure(data)
        return _built(text)
    except FoundError as problem:
        return None, (problem.finding,)


class _RefusedNumber(float):
    """Placeholder of a number that JSON or a float cannot represent, until its pointer is known."""

    __slots__ = ("code", "text")  # saves memory: a malicious file has millions
    code: str
    text: str


class _RepeatingObject(dict[str, Any]):
    """An object with the list of its repeated keys."""

    repeated: list[str]


def _decoded(data: bytes) -> str:
    if len(data) > MAX_JSON_BYTES:
        raise FoundError("size", "", f"has {len(data)} bytes; the limit is {MAX_JSON_BYTES}")
    if data.startswith(codecs.BOM_UTF8):
        raise FoundError("byte-order-mark", "", "begins with a byte order mark. Save it as UTF-8 without one.")
    if not data:
        raise FoundError("syntax", "", "is empty. Check that it was written completely.")
    try:
        return decoded(data)
    except DecodingError as problem:
        raise FoundError("encoding", "", str(problem)) from problem


def _measure(data: bytes) -> None:
    """Reject too many values and too deep nesting by counting bytes, before parsing.

    The counts are exact up to the first syntax error, where parsing would stop.
    """
    unescaped = data.replace(rb"\\", b"__").replace(rb"\"", b"__")  # now every quote opens or closes a string
    depth = deepest = values = 0
    in_text = False
    for start in range(0, len(unescaped), BLOCK_LENGTH):
        chunk = np.frombuffer(unescaped[start : start + BLOCK_LENGTH], np.uint8)
        inside = np.logical_xor.accumulate(chunk == ord('"')) ^ in_text
        outside = np.where(inside, 0, chunk)
        steps = _STEP[outside]
        depths = np.cumsum(steps[steps != 0]) + depth
        in_text, depth = bool(inside[-1]), int(depths[-1]) if len(depths) else depth
        deepest = max(deepest, int(depths.max(initial=0)))
        values += int(np.count_nonzero(steps > 0) + np.count_nonzero(outside == ord(",")))
    if deepest > MAX_JSON_DEPTH:
        raise FoundError("depth", "", f"has {deepest} nesting levels; the limit is {MAX_JSON_DEPTH}")
    if values > MAX_VALUES:
        raise FoundError("size", "", f"contains {values} values; the limit is {MAX_VALUES}")


def _built(text: str) -> tuple[Any, tuple[Finding, ...]]:
    has_findings = bool(_SURROGATE_ESCAPE.search(text))

    def refused(code: str, literal: str) -> float:
        nonlocal has_findings
        has_findings = True
        number = _RefusedNumber("nan" if literal == "NaN" else "-inf" if literal.startswith("-") else "inf")
        number.code, number.text = code, literal[:40]
        return number

    def real(literal: str) -> float:
        number = float(literal)
        return number if math.isfinite(number) else refused("number-range", literal)

    def whole(literal: str) -> float:
        fits = len(literal) <= 20 and -(2**63) <= int(literal) < 2**63  # length first: int() is slow on long ones
        return int(literal) if fits else refused("number-range", literal)

    def constant(literal: str) -> float:
        return refused("not-finite", literal)

    def members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        nonlocal has_findings
        known = dict(pairs)
        if len(known) < len(pairs):
            has_findings = True
            known = _RepeatingObject(known)
            known.repeated = [key for key, times in Counter(key for key, _ in pairs).items() if times > 1]
        return known

    try:
        document = json.loads(
            text, parse_float=real, parse_int=whole, parse_constant=constant, object_pairs_hook=members
        )
    except json.JSONDecodeError as problem:
        offset = len(text[: problem.pos].encode())
        place = f"byte {offset}, line {problem.lineno}, column {problem.colno}"
        raise FoundError("syntax", "", f"is not JSON at {place}: {problem.msg}") from problem
    return document, tuple(first(_locate_findings(document, ""))) if has_findings else ()


def _locate_findings(value: Any, pointer: str) -> Iterator[Finding]:
    """Search the document for the problems that the parser found, and add their pointers."""
    if isinstance(value, _RefusedNumber):
        yield error(value.code, pointer, f"is {value.text}; it must be a finite 64-bit number", float(value))
    elif isinstance(value, str):
        yield from _lone_surrogates(value, pointer)
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from _locate_findings(item, child(pointer, index))
    elif isinstance(value, dict):
        for key in getattr(value, "repeated", ()):
            yield error("duplicate-key", child(pointer, key), "occurs more than once; keep one", value[key])
        for key, member in value.items():
            yield from _lone_surrogates(key, pointer)
            yield from _locate_findings(member, child(pointer, key))


def _lone_surrogates(text: str, pointer: str) -> Iterator[Finding]:
    if _SURROGATE.search(text):
        yield error("surrogate", pointer, f"contains a lone surrogate: {show(text)}", text)
