"""Calculate a calibration from a plan, report it, and record its sources."""

from .calibrate import Calibrated, calibrate
from .robot_folder import fit_link

__all__ = ["Calibrated", "calibrate", "fit_link"]
