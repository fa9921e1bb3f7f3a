"""Comparison of calibrations with touches measured on the robot."""

from .directions import Directions, directions_of
from .placement import Placement, placements
from .planning import next_touch
from .summary import summarize
from .touches import Touches, read_touches

__all__ = [
    "Directions",
    "Placement",
    "Touches",
    "directions_of",
    "next_touch",
    "placements",
    "read_touches",
    "summarize",
]
