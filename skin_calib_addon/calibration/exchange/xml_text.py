"""Write parts of XML documents: escaped names, and numbers with all digits."""

import re
from collections.abc import Iterable

import numpy as np

from ...common.arrays import Array
from ...common.errors import CalibrationFormatError
from ...common.findings import show

# Characters that XML 1.0 forbids, escaped or not.
_FORBIDDEN = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'


def quoted(value: str) -> str:
    """Return a text as the value of an attribute, with quotation marks."""
    from xml.sax.saxutils import quoteattr  # its import brings an HTTP client along: 30 ms

    found = _FORBIDDEN.search(value)
    if found:
        raise CalibrationFormatError(
            f"the name {show(value)} contains U+{ord(found[0]):04X}, which XML forbids. Rename it."
        )
    return quoteattr(value, {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})


def numbers(values: Iterable[float] | Array) -> str:
    """Return numbers with all digits, separated by spaces, without quotation marks."""
    return " ".join(map(repr, np.asarray(values, float).ravel().tolist()))


def rpy(axes: Array) -> Array:
    """Return the URDF angles (n, 3) [rad] of rotations: roll, pitch, yaw about fixed x, y, z axes.

    The roll is computed after the yaw is removed. The three angles therefore give the rotation even at a pitch of 90
    degrees, where the yaw is arbitrary.
    """
    yaw = np.arctan2(axes[:, 1, 0], axes[:, 0, 0])
    pitch = np.arctan2(-axes[:, 2, 0], np.hypot(axes[:, 0, 0], axes[:, 1, 0]))
    y_without_yaw = -np.sin(yaw)[:, None] * axes[:, 0, 1:] + np.cos(yaw)[:, None] * axes[:, 1, 1:]
    roll = np.arctan2(-y_without_yaw[:, 1], y_without_yaw[:, 0])
    return np.column_stack((roll, pitch, yaw))


def rotations(angles: Array) -> Array:
    """Return the rotation matrices (n, 3, 3) of URDF angles (n, 3) [rad]."""
    (a, b, c), (A, B, C) = np.cos(angles).T, np.sin(angles).T
    rows = (
        (c * b, c * B * A - C * a, c * B * a + C * A),
        (C * b, C * B * A + c * a, C * B * a - c * A),
        (-B, b * A, b * a),
    )
    return np.moveaxis(np.array(rows), 2, 0)
