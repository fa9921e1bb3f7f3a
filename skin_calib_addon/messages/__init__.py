"""Messages of ROS 2 (package ``skin_calib_msgs``) without ROS: definitions, bytes, content. NumPy only."""

from .cdr import decode, encode
from .content import frame_message, layout_message, reading_message, reading_of
from .definitions import NAMES, PACKAGE, schema_text

__all__ = [
    "NAMES",
    "PACKAGE",
    "decode",
    "encode",
    "frame_message",
    "layout_message",
    "reading_message",
    "reading_of",
    "schema_text",
]
