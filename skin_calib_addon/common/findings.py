"""Findings: the problems of a document, each with its location."""

import difflib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any, Literal, TypeVar

Where = TypeVar("Where")
Value = TypeVar("Value")
MAX_FINDINGS = 1000  # of one check. Larger: a malicious file can use more memory.


@dataclass(frozen=True)
class Finding:
    """One problem of a document.

    Attributes
    ----------
    code : str
        Stable name of the kind of problem.
    severity : "error" or "warning"
        An error makes the document unusable.
    pointer : str
        JSON pointer (RFC 6901) to an existing location of the document.
    message : str
        A sentence whose subject is the location.
    value : JSON value
        The value at the location.
    """

    code: str
    severity: Literal["error", "warning"]
    pointer: str
    message: str
    value: Any = None

    @property
    def sentence(self) -> str:
        """Return location and message on one line."""
        return f"{printable(_shortened(self.pointer, 200) or 'the document')} {printable(self.message)}"

    def __str__(self) -> str:
        return f"{self.severity}: {self.sentence} [{self.code}]"


class FoundError(ValueError):
    """What a file contains is invalid from somewhere on; ``finding`` states why, and where."""

    def __init__(self, code: str, pointer: str, message: str):
        super().__init__(message)
        self.finding = error(code, pointer, message)


def error(code: str, pointer: str, message: str, value: Any = None) -> Finding:
    """Return a finding that makes the document unusable."""
    return Finding(code, "error", pointer, message, value)


def warning(code: str, pointer: str, message: str, value: Any = None) -> Finding:
    """Return a finding that the user should check."""
    return Finding(code, "warning", pointer, message, value)


def child(pointer: str, *keys: Any) -> str:
    """Return the pointer to a nested member or element."""
    return pointer + "".join("/" + str(key).replace("~", "~0").replace("/", "~1") for key in keys)


def first(findings: Iterable[Finding]) -> Iterator[Finding]:
    """Yield at most `MAX_FINDINGS` findings, then one that states that there are more."""
    for count, finding in enumerate(findings):
        if count == MAX_FINDINGS:
            message = f"has more findings than the {MAX_FINDINGS} before; they are not listed"
            yield Finding("more", finding.severity, "", message)
            return
        yield finding


def repeated(entries: Iterable[tuple[Where, Value]]) -> Iterator[tuple[Where, Value, Where]]:
    """Yield place, value and first place of each value that an earlier place has, of pairs of place and value."""
    first_places: dict[Value, Where] = {}
    for where, value in entries:
        if value in first_places:
            yield where, value, first_places[value]
        else:
            first_places[value] = where


def in_short(findings: Iterable[Finding]) -> str:
    """Return the number of errors and the first error; at least one finding is an error."""
    errors = [finding for finding in findings if finding.severity == "error"]
    return f"one {errors[0]}" if len(errors) == 1 else f"{len(errors)} errors; the first {errors[0]}"


def show(value: Any) -> str:
    """Describe a value in a few words, for a message."""
    if isinstance(value, dict):
        return f"an object of {len(value)}"
    if isinstance(value, list):
        return f"an array of {len(value)}"
    if isinstance(value, str):
        return json.dumps(_shortened(value, 40), ensure_ascii=False)
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    if isinstance(value, float) or isinstance(value, int) and value.bit_length() < 100:
        return repr(value)
    return f"a Python {type(value).__name__}"


def did_you_mean(name: str, known: Iterable[Any]) -> str:
    """Return the end of a message that suggests the most similar known name."""
    words = islice((word for word in known if isinstance(word, str)), 100)
    near = difflib.get_close_matches(name[:80], words, 1)
    return f"; did you mean {show(near[0])}?" if near else ""


def _shortened(text: str, length: int) -> str:
    return text if len(text) <= length else text[: length - 1] + "…"


def printable(text: str) -> str:
    """Return the text on one line, with control characters and lone surrogates escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
