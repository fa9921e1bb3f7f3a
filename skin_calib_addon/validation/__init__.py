"""Calibrations held against what was measured on the robot."""

from .placement import Motion, Placement, placements
from .touches import Touches, read_touches
from .words import in_words

__all__ = ["Motion", "Placement", "Touches", "in_words", "placements", "read_touches"]
