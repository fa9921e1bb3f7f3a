"""Pieces of XML documents that every reader takes: names escaped, numbers to the last bit."""

import re
from collections.abc import Iterable
from xml.sax.saxutils import quoteattr

import numpy as np

from ...common.arrays import Array
from ...common.errors import CalibrationFormatError
from ...common.findings import show

# What XML 1.0 cannot hold, escaped or not.
_FORBIDDEN = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'


def quoted(value: str) -> str:
    """A text as the value of an attribute, with its quotation marks.

    Raises
    ------
    CalibrationFormatError
        If it holds a character that XML does not have.
    """
    found = _FORBIDDEN.search(value)
    if found:
        raise CalibrationFormatError(f"the name {show(value)} holds U+{ord(found[0]):04X}, which XML cannot; rename it")
    return quoteattr(value, {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})


def numbers(values: Iterable[float] | Array) -> str:
    """Numbers to the last bit, with spaces between, without quotation marks."""
    return " ".join(map(repr, np.asarray(values, float).ravel().tolist()))


def rpy(axes: Array) -> Array:
    """Angles about the fixed x, y and z axes of URDF for rotations (n, 3, 3), shape (n, 3) [rad].

    The roll is taken after the yaw is undone: where the pitch is a right angle, and the yaw is what rounding says, the
    three still give the rotation.
    """
    yaw = np.arctan2(axes[:, 1, 0], axes[:, 0, 0])
    pitch = np.arctan2(-axes[:, 2, 0], np.hypot(axes[:, 0, 0], axes[:, 1, 0]))
    y_unturned = -np.sin(yaw)[:, None] * axes[:, 0, 1:] + np.cos(yaw)[:, None] * axes[:, 1, 1:]
    roll = np.arctan2(-y_unturned[:, 1], y_unturned[:, 0])
    return np.column_stack((roll, pitch, yaw))


def rotations(angles: Array) -> Array:
    """The rotations of such angles (n, 3) [rad], shape (n, 3, 3)."""
    (a, b, c), (A, B, C) = np.cos(angles).T, np.sin(angles).T
    rows = (
        (c * b, c * B * A - C * a, c * B * a + C * A),
        (C * b, C * B * A + c * a, C * B * a - c * A),
        (-B, b * A, b * a),
    )
    return np.moveaxis(np.array(rows), 2, 0)
