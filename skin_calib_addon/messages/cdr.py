"""Messages as bytes and back: CDR (OMG CDR 1.0, little-endian), as ROS 2 sends and stores them.

A message is a mapping from its fields to values. A message that has only doubles, such as ``geometry_msgs/Point``, or
only single floats, is an array of them; many of them are an array with a row for each.
"""

import struct
from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any

import numpy as np

from ..common.errors import CalibrationFormatError
from .definitions import PRIMITIVES, Field, fields_of, floats_in, full_name

HEADER = b"\0\1\0\0"  # little-endian, no options
SCALARS = {kind: struct.Struct(f"<{code}") for kind, code in PRIMITIVES.items() if code}
LENGTH = SCALARS["uint32"]
Writer = Callable[[bytearray, Any], None]  # appends a value to a message without its header
PADS = [bytes(n) for n in range(8)]


def encode(name: str, message: Mapping[str, Any]) -> bytes:
    """Return one of our messages as bytes.

    Raises
    ------
    KeyError
        If the message lacks a field.
    struct.error, ValueError, OverflowError
        If a value does not fit into its field.
    """
    data = bytearray()
    _write(data, full_name(name), message)
    return HEADER + data


def _write(data: bytearray, kind: str, message: Any) -> None:
    """Append a message."""
    for name, write in _writers(kind):
        write(data, message[name])


@cache
def _writers(kind: str) -> tuple[tuple[str, Writer], ...]:
    """Return for each field of a message its name, and what appends its value."""
    return tuple((field.name, _writer(field)) for field in fields_of(kind))


def _writer(field: Field) -> Writer:
    (floats, width), count = floats_in(field.kind), field.length
    if field.kind in SCALARS and count is None:
        return partial(_write_scalar, SCALARS[field.kind])
    if width or field.kind in SCALARS:
        dtype = np.dtype(f"<{PRIMITIVES[floats or field.kind]}")
        return partial(_write_numbers, field.name, dtype, width or 1, 1 if count is None else count)
    item = _write_text if field.kind == "string" else partial(_write_message, field.kind)
    return item if count is None else partial(_write_items, item, count)


def _write_scalar(scalar: struct.Struct, data: bytearray, value: Any) -> None:
    if pad := -len(data) % scalar.size:
        data += PADS[pad]
    data += scalar.pack(value)


def _write_message(kind: str, data: bytearray, message: Any) -> None:
    _write(data, kind, message)


def _write_text(data: bytearray, text: str) -> None:
    """Append a string with its length and a zero at its end."""
    raw = text.encode()
    if b"\0" in raw:
        raise ValueError(f"the text {text!r} has a zero, which ends a string of CDR")
    _write_scalar(LENGTH, data, len(raw) + 1)
    data += raw
    data += b"\0"


def _write_items(write: Writer, count: int, data: bytearray, items: Any) -> None:
    """Append an array of strings or messages."""
    if count == 0:
        _write_scalar(LENGTH, data, len(items))
    elif len(items) != count:
        raise ValueError(f"an array has {len(items)} items, not {count}")
    for item in items:
        write(data, item)


def _write_numbers(name: str, dtype: np.dtype, width: int, count: int, data: bytearray, value: Any) -> None:
    """Append an array of numbers, ``width`` for each item; 0 items are any number of them."""
    numbers = np.asarray(value)
    if numbers.dtype != dtype:
        given, numbers = numbers, numbers.astype(dtype)
        if dtype.kind == "i" and (numbers != given).any():
            raise ValueError(f"the numbers of {name} do not fit into {dtype.name}")
    if count == 0:
        count = len(numbers)
        _write_scalar(LENGTH, data, count)
    if numbers.size != count * width:
        raise ValueError(f"{name} has {numbers.size} numbers, not {count * width}")
    if count:
        if pad := -len(data) % dtype.itemsize:
            data += PADS[pad]
        data += numbers.tobytes()


def decode(name: str, data: bytes) -> dict[str, Any]:
    """Return a message from its bytes; a name without a package is one of ours.

    Raises
    ------
    CalibrationFormatError
        If the bytes are not those of such a message.
    """
    what = name.rpartition("/")[2]
    if data[:4] != HEADER:
        raise CalibrationFormatError(f"a {what} does not begin with the header of little-endian CDR: {data[:4].hex()}")
    reader = _Reader(memoryview(data)[4:])
    try:
        message = reader.message(full_name(name))
    except (struct.error, ValueError) as problem:
        raise CalibrationFormatError(f"a {what} is damaged or truncated: {problem}") from problem
    if reader.left > 3:  # rosbag2 and DDS can pad to four bytes
        raise CalibrationFormatError(f"a {what} has {reader.left} bytes more than its definition")
    return message


class _Reader:
    """Read values one after another."""

    def __init__(self, data: memoryview):
        self._data, self._at = data, 0

    @property
    def left(self) -> int:
        """Number of bytes after the last value."""
        return len(self._data) - self._at

    def message(self, kind: str) -> dict[str, Any]:
        """Read a message."""
        return {field.name: self._value(field) for field in fields_of(kind)}

    def _value(self, field: Field) -> Any:
        (floats, width), kind = floats_in(field.kind), field.kind
        if field.length is None:
            if kind in SCALARS:
                return self._scalar(SCALARS[kind])
            if kind == "string":
                return self._text()
            return self._numbers(f"<{PRIMITIVES[floats]}", width) if width else self.message(kind)
        count = self._scalar(LENGTH) if field.length == 0 else field.length
        if width:
            numbers = self._numbers(f"<{PRIMITIVES[floats]}", count * width)
            return numbers if width == 1 else numbers.reshape(count, width)
        if kind in SCALARS:
            return self._numbers(f"<{PRIMITIVES[kind]}", count)
        if count > self.left:  # each item takes a byte or more
            raise ValueError(f"{field.name} announces {count} items, and {self.left} bytes follow")
        return [self._text() if kind == "string" else self.message(kind) for _ in range(count)]

    def _align(self, size: int) -> None:
        self._at += -self._at % size

    def _scalar(self, scalar: struct.Struct) -> Any:
        self._align(scalar.size)
        (value,) = scalar.unpack_from(self._data, self._at)
        self._at += scalar.size
        return value

    def _numbers(self, dtype: str, count: int) -> np.ndarray:
        size = np.dtype(dtype).itemsize
        if count:
            self._align(size)
        if count * size > self.left:
            raise ValueError(f"an array announces {count} numbers, and {self.left} bytes follow")
        numbers = np.frombuffer(self._data, dtype, count, self._at) if count else np.empty(0, dtype)
        self._at += count * size
        return numbers

    def _text(self) -> str:
        length = self._scalar(LENGTH)
        if not 0 < length <= self.left or self._data[self._at + length - 1] != 0:
            raise ValueError(f"a text announces {length} bytes with a zero at the end, and {self.left} bytes follow")
        raw = bytes(self._data[self._at : self._at + length - 1])
        self._at += length
        return raw.decode()
