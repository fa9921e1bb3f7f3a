"""Array types, and checks of arguments: a wrong one must not become a wrong force."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skin_calib_addon.runtime import ModalityValues

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def finite(name: str, value: Any, shape: tuple[int, ...]) -> Array:
    """Return an array of finite numbers of a given shape, in double precision."""
    array = np.asarray(value, float)
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}, expected {shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has values that are not finite numbers")
    return array


def positive(name: str, value: float) -> float:
    """Return a number that must be above zero, in double precision."""
    if not 0 < value < math.inf:
        raise ValueError(f"{name} must be positive and finite, not {value}")
    return float(value)


def not_negative(name: str, value: float) -> float:
    """Return a number that must be zero or more, in double precision."""
    if not 0 <= value < math.inf:
        raise ValueError(f"{name} must be zero or more and finite, not {value}")
    return float(value)


def unmasked(values: Any) -> Array:
    """Return numbers in double precision; those that a masked array masks are NaN."""
    if isinstance(values, np.ma.MaskedArray):
        values = np.ma.filled(values.astype(float), np.nan)
    return np.asarray(values, float)


def values_in(given: Any, count: int, *units: str) -> Array:
    """Return the numbers of an array, or of a modality; NaN where they are unknown."""
    if isinstance(given, ModalityValues) and given.unit not in units:
        raise ValueError(f"this needs a modality in {' or '.join(units)}, not in {given.unit}")
    values = given.values if isinstance(given, ModalityValues) else unmasked(given)
    if values.shape[-1:] != (count,):
        raise ValueError(f"values of shape {values.shape} are not one for each of {count} taxels")
    return values


def distances_in(given: Any, count: int) -> Array:
    """Return distances [m]; infinity where a modality is at the far end of its response: nothing is in range."""
    distances = values_in(given, count, "m")
    return np.where(distances >= given.largest, np.inf, distances) if isinstance(given, ModalityValues) else distances
