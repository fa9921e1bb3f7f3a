# SPDX-License-Identifier: GPL-3.0-or-later
"""Between single-precision numbers of Blender's properties, in scene units, and numbers of a plan, in metres."""

from collections.abc import Iterable

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
