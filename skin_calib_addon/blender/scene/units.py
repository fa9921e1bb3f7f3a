# SPDX-License-Identifier: GPL-3.0-or-later
"""The length of a scene unit, and numbers in their units for texts: lengths in millimetres, whatever the scene has."""

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np

from .decimals import exact

# Factor and symbol of the units in which numbers are shown, by their kind.
UNITS = {"LENGTH": (1e3, "mm"), "FRACTION": (1e2, "%"), "FORCE": (1.0, "N"), "ANGLE": (float(np.rad2deg(1)), "°")}


def metres_per_unit(scene: bpy.types.Scene) -> float:
    """Return the length of one scene unit [m]."""
    return exact(scene.unit_settings.scale_length)


def written(values: Sequence[float], kind: str, settings: Any) -> tuple[list[str], str]:
    """Return numbers with three digits in one unit, and its symbol."""
    is_in_radians = kind == "ANGLE" and settings.system_rotation == "RADIANS"
    factor, name = (1.0, "rad") if is_in_radians else UNITS[kind]
    return [f"{value * factor + 0.0:.3g}" for value in values], name  # no minus zero
