# SPDX-License-Identifier: GPL-3.0-or-later
"""The length of a scene unit, and numbers in their units for texts: lengths in millimetres, whatever the scene has."""

from collections.abc import Iterable, Sequence
from typing import Any

import bpy
import numpy as np


def exact(value: float, unit: float = 1.0) -> float:
    """Return the shortest decimal that a single-precision property can be, times a unit.

    0.0045 typed is 0.0045, not 0.00449999981; 4.9 mm are 0.0049 m, not 0.004900000000000001.
    """
    return float(f"{float(str(np.float32(value))) * unit:.9g}")


def vector(values: Iterable[float], metre: float = 1.0) -> list[float]:
    """Return the shortest decimals that properties can be, times a unit."""
    return [exact(x, metre) for x in values]


def in_units(lengths: Iterable[float], metre: float) -> list[float]:
    """Convert lengths to scene units."""
    return [x / metre for x in lengths]


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
