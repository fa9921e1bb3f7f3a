"""From a plan to a calibration: the whole flow, its report, the record of its sources."""

from .calibrate import Calibrated, calibrate

__all__ = ["Calibrated", "calibrate"]
