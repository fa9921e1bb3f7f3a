"""Calculate a calibration from a plan, report it, and record its sources."""

from .calibrate import Calibrated, calibrate

__all__ = ["Calibrated", "calibrate"]
