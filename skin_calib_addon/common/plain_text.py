"""Bytes as text, or what they are instead."""

import codecs
import re

KNOWN_FORMATS = {
    b"PK\3\4": "is a ZIP archive, as NPZ files are; name a text file",
    b"\x1f\x8b": "is compressed by gzip; unpack it",
    codecs.BOM_UTF16_LE: "is UTF-16; save it as UTF-8",
    codecs.BOM_UTF16_BE: "is UTF-16; save it as UTF-8",
}
_CONTROL_CHARACTER = re.compile(rb"[\0-\x08\x0e-\x1a\x1c-\x1f\x7f]")  # no text encoding needs these
SEARCH_BYTES = 2**16  # bytes among which they are looked for


class DecodingError(ValueError):
    """Bytes are no text in UTF-8; the message continues their name to a sentence, and says what to do."""


def decoded(data: bytes) -> str:
    """The text of bytes in UTF-8.

    Raises
    ------
    DecodingError
        If they are in another encoding, compressed, or no text at all.
    """
    try:
        text = data.decode()
    except UnicodeDecodeError as problem:
        raise DecodingError(_instead(data, problem.start)) from problem
    if "\0" in text:  # UTF-8 has it, text has not
        raise DecodingError(_instead(data, text.index("\0")))
    return text


def _instead(data: bytes, offset: int) -> str:
    for beginning, what in KNOWN_FORMATS.items():
        if data.startswith(beginning):
            return what
    found = _CONTROL_CHARACTER.search(data, 0, SEARCH_BYTES) or _CONTROL_CHARACTER.search(
        data, offset, offset + SEARCH_BYTES
    )
    if found:
        return f"is binary at byte {found.start()}; check that it is the right file"
    return f"is not UTF-8 at byte {offset}; save it as UTF-8"
