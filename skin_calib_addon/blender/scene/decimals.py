# SPDX-License-Identifier: GPL-3.0-or-later
"""Between the single-precision numbers of Blender's properties, in scene units, and those of a plan, in metres."""

from collections.abc import Iterable

import numpy as np


def exact(value: float, unit: float = 1.0) -> float:
    """The decimal that a single-precision property stands for, times a unit.

    0.0045 typed is 0.0045, not 0.00449999981; 4.9 mm are 0.0049 m, not 0.004900000000000001.
    """
    return float(f"{float(str(np.float32(value))) * unit:.9g}")


def vector(values: Iterable[float], metre: float = 1.0) -> list[float]:
    """The decimals that properties stand for, times a unit."""
    return [exact(x, metre) for x in values]


def in_units(lengths: Iterable[float], metre: float) -> list[float]:
    """Lengths [m] in scene units of ``metre``."""
    return [x / metre for x in lengths]
