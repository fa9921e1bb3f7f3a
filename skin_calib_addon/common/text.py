"""What all readers of text files share: limits, lines, numbers."""

import math
import os
import re

from .errors import CalibrationFormatError
from .plain_text import DecodingError, decoded
from .strict_json import read

MAX_TEXT_BYTES = 64 * 2**20
MAX_LINES = 2**21
MAX_LINE_LENGTH = 2**20  # characters
MAX_TAXELS = 100_000

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?", re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?(nan|inf(inity)?)", re.ASCII | re.IGNORECASE)
_WHOLE = re.compile(r"-?\d{1,18}", re.ASCII)


class NumberError(ValueError):
    """A word is no number that a position can hold; the code and the message are for a finding."""

    def __init__(self, code: str, message: str):
        super().__init__(message)
        self.code = code


def check_size(data: bytes, path: str | os.PathLike[str]) -> None:
    """Refuse a file beyond `MAX_TEXT_BYTES`."""
    if len(data) > MAX_TEXT_BYTES:
        raise CalibrationFormatError(f"cannot read '{path}': its {len(data)} bytes exceed {MAX_TEXT_BYTES}")


def read_text(path: str | os.PathLike[str]) -> str:
    """The text of a file, as :func:`text_of`.

    Raises
    ------
    CalibrationFormatError
        If it cannot be read, is beyond a limit, or is no text in UTF-8.
    """
    data = read(path)
    check_size(data, path)
    return text_of(data, path)


def text_of(data: bytes, path: str | os.PathLike[str]) -> str:
    """The text of bytes in UTF-8, with or without a byte order mark; every line ends in one line feed.

    Raises
    ------
    CalibrationFormatError
        If it is empty, beyond `MAX_LINES` or `MAX_LINE_LENGTH`, or no text in UTF-8.
    """
    if not data:
        raise CalibrationFormatError(f"'{path}' is empty; check that it was written whole")
    try:
        text = decoded(data).removeprefix("\ufeff")
    except DecodingError as problem:
        raise CalibrationFormatError(f"'{path}' {problem}") from problem
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    lines = text.count("\n") + 1
    if lines > MAX_LINES:
        raise CalibrationFormatError(f"cannot read '{path}': its {lines} lines exceed {MAX_LINES}")
    start = 0
    for number in range(1, lines + 1):
        stop = text.find("\n", start)
        stop = len(text) if stop < 0 else stop
        if stop - start > MAX_LINE_LENGTH:
            message = f"line {number} of '{path}' has {stop - start} characters; at most {MAX_LINE_LENGTH} are read"
            raise CalibrationFormatError(message)
        start = stop + 1
    return text


def real(word: str) -> float:
    """The finite number that a word stands for.

    Raises
    ------
    NumberError
        If it stands for none.
    """
    if _NUMBER.fullmatch(word):
        number = float(word)
        if math.isfinite(number):
            return number
    elif not _NOT_FINITE.fullmatch(word):
        raise NumberError("number", f"has {shown(word)} where a number belongs")
    raise NumberError("not-finite", f"has {shown(word)}; a finite number is needed")


def whole(word: str) -> int:
    """The integer that a word stands for.

    Raises
    ------
    NumberError
        If it stands for none.
    """
    if not _WHOLE.fullmatch(word):
        raise NumberError("number", f"has {shown(word)} where an integer belongs")
    return int(word)


def shown(word: str) -> str:
    """A word of a file in a message."""
    return repr(word if len(word) <= 40 else word[:39] + "…")
