"""Spatial calibration of robot tactile skin: the pure package; no Blender outside ``blender/``.

This module stays bare, so that a controller's ``import skin_calib_addon.runtime`` costs what NumPy costs.
"""

__version__ = "0.1.0"
