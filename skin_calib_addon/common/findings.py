"""What is wrong with a document, and where."""

import difflib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any, Literal

MAX_FINDINGS = 1000  # of one check: more would help nobody, and a hostile file must not fill the memory


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a document.

    ``pointer`` (RFC 6901) leads to a place that exists in the document; ``message`` continues the pointer to a
    sentence; ``value`` is what stands there.
    """

    code: str
    severity: Literal["error", "warning"]
    pointer: str
    message: str
    value: Any = None

    @property
    def sentence(self) -> str:
        """Place and message on one line."""
        return f"{printable(_shortened(self.pointer, 200) or 'the document')} {printable(self.message)}"

    def __str__(self) -> str:
        return f"{self.severity}: {self.sentence} [{self.code}]"


def error(code: str, pointer: str, message: str, value: Any = None) -> Finding:
    """A finding that makes the document unusable."""
    return Finding(code, "error", pointer, message, value)


def warning(code: str, pointer: str, message: str, value: Any = None) -> Finding:
    """A finding that a person should look at."""
    return Finding(code, "warning", pointer, message, value)


def child(pointer: str, *keys: Any) -> str:
    """The pointer to a member or element further in, ``~`` and ``/`` escaped."""
    return pointer + "".join("/" + str(key).replace("~", "~0").replace("/", "~1") for key in keys)


def first(findings: Iterable[Finding]) -> Iterator[Finding]:
    """At most `MAX_FINDINGS`, and then one that says that there are more."""
    for count, finding in enumerate(findings):
        if count == MAX_FINDINGS:
            message = f"has more findings like the {MAX_FINDINGS} before; they are not listed"
            yield Finding("more", finding.severity, "", message)
            return
        yield finding


def in_short(findings: Iterable[Finding]) -> str:
    """How many errors there are among findings, of which one is an error, and the first."""
    errors = [finding for finding in findings if finding.severity == "error"]
    return f"one {errors[0]}" if len(errors) == 1 else f"{len(errors)} errors; the first {errors[0]}"


def show(value: Any) -> str:
    """A value in a few words, for a message."""
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
    """The end of a message that proposes the nearest known name; empty if none is near."""
    words = islice((word for word in known if isinstance(word, str)), 100)  # comparing is slow: never many
    near = difflib.get_close_matches(name[:80], words, 1)
    return f"; did you mean {show(near[0])}?" if near else ""


def _shortened(text: str, length: int) -> str:
    return text if len(text) <= length else text[: length - 1] + "…"


def printable(text: str) -> str:
    """The same text on one line: control characters and lone surrogates escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
