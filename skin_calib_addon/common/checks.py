"""Check the arguments of functions that a controller calls: a wrong one must not become a wrong force."""

import math
from typing import Any

import numpy as np

from .arrays import Array


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
