"""Read JSON strictly: one meaning per file, nothing dropped in silence, and no input that hurts the reader."""

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
from .findings import Finding, child, error, first, show
from .plain_text import DecodingError, decoded

MAX_JSON_BYTES = 512 * 2**20
MAX_VALUES = 2**24  # three times what 100 000 taxels need; bounds the memory that building them takes
MAX_JSON_DEPTH = 32

_SURROGATE_ESCAPE = re.compile(r"\\u[dD][89a-fA-F]")
_SURROGATE = re.compile("[\ud800-\udfff]")
CHUNK_BYTES = 2**18
_STEP = np.zeros(256, np.int8)
_STEP[list(b"[{")] = 1
_STEP[list(b"]}")] = -1


def read(path: str | os.PathLike[str]) -> bytes:
    """The bytes of a file, refused before reading where it is too large or no regular file.

    Raises
    ------
    CalibrationFormatError
        If it is missing, unreadable, a folder, a pipe or a device, or beyond `MAX_JSON_BYTES`.
    """
    size = size_of(path)
    if size > MAX_JSON_BYTES:
        raise CalibrationFormatError(f"cannot read '{path}': its {size} bytes exceed {MAX_JSON_BYTES}")
    try:
        with open(path, "rb") as file:
            return file.read(MAX_JSON_BYTES + 1)  # a file may grow, or tell no size, as those in /proc
    except OSError as problem:
        raise _unreadable(path, problem) from problem


def size_of(path: str | os.PathLike[str]) -> int:
    """The bytes of a file; it is not opened, for a pipe or a device might never answer.

    Raises
    ------
    CalibrationFormatError
        If it is missing, a folder, a pipe or a device.
    """
    try:
        status = os.stat(path)
    except (OSError, ValueError) as problem:  # ValueError: a NUL in the path
        raise _unreadable(path, problem) from problem
    if not stat.S_ISREG(status.st_mode):
        what = "a folder" if stat.S_ISDIR(status.st_mode) else "not a regular file"
        raise CalibrationFormatError(f"cannot read '{path}': it is {what}; name a file")
    return status.st_size


def _unreadable(path: str | os.PathLike[str], problem: Exception) -> CalibrationFormatError:
    reason = getattr(problem, "strerror", None) or problem
    return CalibrationFormatError(f"cannot read '{path}': {reason}; check the path")


def parse(data: bytes) -> tuple[Any, tuple[Finding, ...]]:
    """Build the document that the bytes of a JSON file stand for.

    Returns
    -------
    document
        None if it cannot be built. Otherwise whole: of a repeated key it has the last value, and a refused number
        is a float that is infinite or NaN, so that what else is wrong can be told in the same pass.
    findings : tuple of Finding
        Everything that strict JSON forbids. Do not use the document if there is one.
    """
    try:
        text = _decoded(data)
        _measure(data)
        return _built(text)
    except _UnreadableError as problem:
        return None, (problem.finding,)


class _UnreadableError(Exception):
    def __init__(self, code: str, message: str):
        self.finding = error(code, "", message)


class _RefusedNumber(float):
    """Stands where a number was that JSON or the machine cannot hold, until its pointer is known."""

    __slots__ = ("code", "text")  # a hostile file has millions
    code: str
    text: str


class _RepeatingObject(dict[str, Any]):
    """An object with the keys that came more than once."""

    repeated: list[str]


def _decoded(data: bytes) -> str:
    if len(data) > MAX_JSON_BYTES:
        raise _UnreadableError("size", f"has {len(data)} bytes; at most {MAX_JSON_BYTES} are read")
    if data.startswith(codecs.BOM_UTF8):
        raise _UnreadableError("byte-order-mark", "begins with a byte order mark; save it as UTF-8 without one")
    if not data:
        raise _UnreadableError("syntax", "is empty; check that it was written whole")
    try:
        return decoded(data)
    except DecodingError as problem:
        raise _UnreadableError("encoding", str(problem)) from problem


def _measure(data: bytes) -> None:
    """Refuse too many values and too deep a nesting from the bytes alone, before anything is built.

    Exact as far as the syntax is right, which is as far as anything will be built.
    """
    unescaped = data.replace(rb"\\", b"__").replace(rb"\"", b"__")  # now every quote opens or closes a string
    depth = deepest = values = 0
    in_text = False
    for start in range(0, len(unescaped), CHUNK_BYTES):
        chunk = np.frombuffer(unescaped[start : start + CHUNK_BYTES], np.uint8)
        inside = np.logical_xor.accumulate(chunk == ord('"')) ^ in_text
        outside = np.where(inside, 0, chunk)
        steps = _STEP[outside]
        depths = np.cumsum(steps[steps != 0]) + depth
        in_text, depth = bool(inside[-1]), int(depths[-1]) if len(depths) else depth
        deepest = max(deepest, int(depths.max(initial=0)))
        values += int(np.count_nonzero(steps > 0) + np.count_nonzero(outside == ord(",")))
    if deepest > MAX_JSON_DEPTH:
        raise _UnreadableError("depth", f"nests {deepest} levels; at most {MAX_JSON_DEPTH} are read")
    if values > MAX_VALUES:
        raise _UnreadableError("size", f"holds {values} values; at most {MAX_VALUES} are read")


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
        raise _UnreadableError("syntax", f"is not JSON at {place}: {problem.msg}") from problem
    return document, tuple(first(_locate_findings(document, ""))) if has_findings else ()


def _locate_findings(value: Any, pointer: str) -> Iterator[Finding]:
    """Look through the whole document for what the parser noticed without knowing where."""
    if isinstance(value, _RefusedNumber):
        yield error(value.code, pointer, f"is {value.text}; a finite 64-bit number is needed", float(value))
    elif isinstance(value, str):
        yield from _lone_surrogates(value, pointer)
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from _locate_findings(item, child(pointer, index))
    elif isinstance(value, dict):
        for key in getattr(value, "repeated", ()):
            yield error("duplicate-key", child(pointer, key), "is given more than once; keep one", value[key])
        for key, member in value.items():
            yield from _lone_surrogates(key, pointer)
            yield from _locate_findings(member, child(pointer, key))


def _lone_surrogates(text: str, pointer: str) -> Iterator[Finding]:
    if _SURROGATE.search(text):
        yield error("surrogate", pointer, f"holds half a character: {show(text)}", text)
