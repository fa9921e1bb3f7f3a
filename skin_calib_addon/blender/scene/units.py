# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers in the units of the scene, for texts; Blender's fields convert theirs."""

from collections.abc import Sequence
from typing import Any

import numpy as np

# How many of each unit are a metre, and its symbol.
UNITS = {
    "KILOMETERS": (1e-3, "km"),
    "METERS": (1.0, "m"),
    "CENTIMETERS": (1e2, "cm"),
    "MILLIMETERS": (1e3, "mm"),
    "MICROMETERS": (1e6, "µm"),
    "MILES": (1 / 1609.344, "mi"),
    "FEET": (1 / 0.3048, "ft"),
    "INCHES": (1 / 0.0254, "in"),
    "THOU": (1 / 2.54e-5, "thou"),
}
# Units for a scene without a fixed unit; the first that makes the largest number at least one is used.
METRIC, IMPERIAL = ("METERS", "MILLIMETERS", "MICROMETERS"), ("FEET", "INCHES", "THOU")


def unit_of(kind: str, largest: float, settings: Any) -> tuple[float, str]:
    """Return the factor by which numbers of a kind are shown, and the symbol of their unit.

    Parameters
    ----------
    kind : "LENGTH", "ANGLE", "FRACTION" or "FORCE"
        Of the numbers: [m], [rad], [1] or [N].
    largest : float
        The largest of them, which selects the unit in a scene without a fixed unit.
    settings : UnitSettings
        Of the scene.

    Returns
    -------
    factor : float
        Number of units in a metre, a radian, 1 or a newton.
    symbol : str
        Of the unit; empty in a scene without units.
    """
    if kind == "FRACTION":
        return 100.0, "%"
    if kind == "FORCE":
        return 1.0, "N"
    if kind == "ANGLE":
        return (1.0, "rad") if settings.system_rotation == "RADIANS" else (float(np.rad2deg(1)), "°")
    if settings.system == "NONE":
        return 1 / settings.scale_length, ""
    if settings.length_unit in UNITS:
        return UNITS[settings.length_unit]
    tried = [UNITS[name] for name in (IMPERIAL if settings.system == "IMPERIAL" else METRIC)]
    return next((unit for unit in tried if largest * unit[0] >= 1), tried[-1] if largest > 0 else tried[0])


def written(values: Sequence[float], kind: str, settings: Any) -> tuple[list[str], str]:
    """Return numbers with three digits in one unit, and its symbol.

    Parameters
    ----------
    values : sequence of float, length k
        [m], [rad], [1] or [N], by ``kind``.
    kind : "LENGTH", "ANGLE", "FRACTION" or "FORCE"
        Of the numbers.
    settings : UnitSettings
        Of the scene.

    Returns
    -------
    texts : list of str, length k
        The numbers in the unit.
    symbol : str
        Of the unit; empty in a scene without units.
    """
    factor, name = unit_of(kind, max(map(abs, values), default=0.0), settings)
    return [f"{value * factor + 0.0:.3g}" for value in values], name  # no minus zero
