"""Encode a calibration document as bytes, and compute its checksum."""

import hashlib
import json
from typing import Any

_OBJECT_LISTS = {"surfaces", "patches"}  # objects, each with one member per line
_ROW_LISTS = {"control_net", "responses", "warnings"}  # one row or object per line


def checksum(document: dict[str, Any]) -> str:
    """Return ``sha256:`` and the hash of the content.

    The content is the JSON text with sorted keys and without white space. The member ``checksum`` is left out.
    """
    content = {name: member for name, member in document.items() if name != "checksum"}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return "sha256:" + hashlib.sha256(text.encode()).hexdigest()


def encode(document: dict[str, Any]) -> bytes:
    """Return the bytes of the file: one table row per line, floats with all digits.

    The same content gives the same bytes. The members keep the order of the document.
    """
    return (_object(document, "") + "\n").encode()


def _object(value: dict[str, Any], margin: str, tables: bool = False) -> str:
    """Write one member per line; with ``tables``, each column has one row per line."""
    inner = margin + "  "
    write = _column if tables else _member
    members = (f"{inner}{_inline(name)}: {write(name, member, inner)}" for name, member in value.items())
    return "{\n" + ",\n".join(members) + f"\n{margin}}}"


def _member(name: str, value: Any, margin: str) -> str:
    inner = margin + "  "
    if name == "taxels":
        return _object(value, margin, tables=True)
    if name in _OBJECT_LISTS and value:
        return f"[\n{inner}" + f",\n{inner}".join(_object(item, inner) for item in value) + f"\n{margin}]"
    return _column(name, value, margin) if name in _ROW_LISTS else _inline(value)


def _column(name: str, value: Any, margin: str) -> str:
    if not isinstance(value, list) or not value:
        return _inline(value)
    inner = margin + "  "
    return f"[\n{inner}" + f",\n{inner}".join(map(_inline, value)) + f"\n{margin}]"


_inline = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode
