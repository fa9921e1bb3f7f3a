"""Comparison of calibrations with touches measured on the robot."""

from .placement import Motion, Placement, placements
from .summary import summarize
from .touches import Touches, read_touches

__all__ = ["Motion", "Placement", "Touches", "placements", "read_touches", "summarize"]
