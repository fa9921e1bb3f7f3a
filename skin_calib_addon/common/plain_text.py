"""Decode UTF-8 text, and recognize other content."""

import codecs
import re

KNOWN_FORMATS = {
    b"PK\3\4": "is a ZIP archive (NPZ files are ZIP archives). Name a text file.",
    b"\x1f\x8b": "is compressed with gzip. Decompress it.",
    codecs.BOM_UTF16_LE: "is UTF-16. Save it as UTF-8.",
    codecs.BOM_UTF16_BE: "is UTF-16. Save it as UTF-8.",
}
_CONTROL_CHARACTER = re.compile(rb"[\0-\x08\x0e-\x1a\x1c-\x1f\x7f]")  # no text encoding needs these
BLOCK_LENGTH = 2**16  # bytes or characters of a file that are searched or parsed at once. Larger: more memory.


class DecodingError(ValueError):
    """Bytes are not UTF-8 text; the message is a predicate whose subject is the file name."""


def decoded(data: bytes) -> str:
    """Decode UTF-8 text."""
    try:
        text = data.decode()
    except UnicodeDecodeError as problem:
        raise DecodingError(_instead(data, problem.start)) from problem
    if "\0" in text:  # valid UTF-8, but not text
        raise DecodingError(_instead(data, text.index("\0")))
    return text


def _instead(data: bytes, offset: int) -> str:
    for beginning, what in KNOWN_FORMATS.items():
        if data.startswith(beginning):
            return what
    found = _CONTROL_CHARACTER.search(data, 0, BLOCK_LENGTH) or _CONTROL_CHARACTER.search(
        data, offset, offset + BLOCK_LENGTH
    )
    if found:
        return f"is binary at byte {found.start()}. Check that it is the correct file."
    return f"is not UTF-8 at byte {offset}. Save it as UTF-8."
