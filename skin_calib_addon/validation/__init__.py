"""Calibrations held against what was measured on the robot."""

from .placement import Motion, Placement, placements
from .touches import Touches, read_touches

__all__ = ["Motion", "Placement", "Touches", "placements", "read_touches"]
