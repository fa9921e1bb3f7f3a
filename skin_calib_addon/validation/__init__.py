"""Comparison of calibrations with touches measured on the robot."""

from .directions import Directions, directions_of
from .placement import Placement, placements
from .registration import Motion
from .summary import summarize
from .touches import Touches, read_touches

__all__ = ["Directions", "Motion", "Placement", "Touches", "directions_of", "placements", "read_touches", "summarize"]
