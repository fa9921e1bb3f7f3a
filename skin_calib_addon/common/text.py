"""Limits, lines and numbers of text files, for all readers."""

import math
import os
import re

from .errors import CalibrationFormatError
from .findings import show
from .plain_text import DecodingError, decoded
from .strict_json import read

# Limits of files that other programs write.
MAX_TEXT_BYTES = 64 * 2**20  # of a file. Larger: a malicious file takes more time and memory.
MAX_TEXT_LINES = 2**21  # of a file. Larger: a malicious file takes more time and memory.
MAX_LINE_LENGTH = 2**20  # characters. Larger: a malicious file takes more time and memory.
MAX_TAXELS = 100_000  # Contract: the documentation promises this number

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?", re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?(nan|inf(inity)?)", re.ASCII | re.IGNORECASE)
_WHOLE = re.compile(r"-?\d{1,18}", re.ASCII)


class NumberError(ValueError):
    """A word is not a finite number; ``code`` and message belong to a finding."""

    def __init__(self, code: str, message: str):
        super().__init__(message)
        self.code = code


def check_size(data: bytes, path: str | os.PathLike[str]) -> None:
    """Reject a file larger than `MAX_TEXT_BYTES`."""
    if len(data) > MAX_TEXT_BYTES:
        raise CalibrationFormatError(
            f"cannot read '{path}': its {len(data)} bytes exceed the limit of {MAX_TEXT_BYTES}."
        )


def read_text(path: str | os.PathLike[str]) -> str:
    """Read the text of a file, as :func:`text_of`."""
    data = read(path)
    check_size(data, path)
    return text_of(data, path)


def text_of(data: bytes, path: str | os.PathLike[str]) -> str:
    """Decode UTF-8 text, with or without a byte order mark; every line ends with one line feed."""
    if not data:
        raise CalibrationFormatError(f"'{path}' is empty. Check that it was written completely.")
    try:
        text = decoded(data).removeprefix("\ufeff")
    except DecodingError as problem:
        raise CalibrationFormatError(f"'{path}' {problem}") from problem
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    lines = text.count("\n") + 1
    if lines > MAX_TEXT_LINES:  # before they are split, which takes memory for each
        raise CalibrationFormatError(f"cannot read '{path}': its {lines} lines exceed the limit of {MAX_TEXT_LINES}.")
    for number, line in enumerate(text.split("\n"), 1):
        if len(line) > MAX_LINE_LENGTH:
            message = f"line {number} of '{path}' has {len(line)} characters; the limit is {MAX_LINE_LENGTH}."
            raise CalibrationFormatError(message)
    return text


def real(word: str) -> float:
    """Return the finite number that a word represents."""
    if _NUMBER.fullmatch(word):
        number = float(word)
        if math.isfinite(number):
            return number
    elif not _NOT_FINITE.fullmatch(word):
        hint = "; write decimals with a point" if _NUMBER.fullmatch(word.replace(",", ".")) else ""
        raise NumberError("number", f"has {show(word)} instead of a number{hint}")
    raise NumberError("not-finite", f"has {show(word)} instead of a finite number")


def whole(word: str) -> int:
    """Return the integer that a word represents."""
    if not _WHOLE.fullmatch(word):
        raise NumberError("number", f"has {show(word)} instead of an integer")
    return int(word)
