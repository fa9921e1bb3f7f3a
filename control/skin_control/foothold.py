"""Assess a foothold, and compute how far to step aside from an obstacle (thesis 4.3.2).

All polygons are of one foot, in the plane of its sole and in the frame of the sole.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from skin_calib_addon.runtime import Polygon


@dataclass(frozen=True)
class FootholdFractions:
    """Fractions of the sole that carry load, A_p / A_s, by three areas. The thesis does not state which one it means.

    On simulated pebbles the hull is 0.45 of the sole, the cells are 0.10, the true contact is 0.011.
    """

    hull: float  # of the outer polygon; includes the area between contacts
    cells: float  # of the active cells, each complete; can be a little over 1
    guaranteed: float  # of the guaranteed polygon, in which the centre of pressure is safe


def foothold_fractions(outer: Polygon, cells: float, guaranteed: Polygon, sole: float) -> FootholdFractions:
    """Return the fractions of the sole that a contact covers, ``A_p / A_s``.

    Parameters
    ----------
    outer, guaranteed : Polygon
        Of :class:`.SupportingPolygon`.
    cells : float
        Sum of the areas of the active cells [m^2].
    sole : float
        Area of the whole sole [m^2].

    Raises
    ------
    ValueError
        If the area of the sole is not a positive number.
    """
    if not (sole > 0 and math.isfinite(sole)):
        raise ValueError(f"sole area {sole} m^2 must be a positive number")
    return FootholdFractions(outer.area / sole, cells / sole, guaranteed.area / sole)


def must_replan(fraction: float, minimum: float) -> bool:
    """Return whether a step must be planned again: ``A_p / A_s <= eps_A``, or the fraction is not a number.

    Parameters
    ----------
    fraction : float
        A_p / A_s, a value of :class:`FootholdFractions`.
    minimum : float
        eps_A.
    """
    return not fraction > minimum


def width_along(polygon: Polygon, direction: Any) -> float:
    """Return the width [m] of an obstacle along a direction, Delta_o of the thesis; 0 for a point or an empty polygon.

    Along the x or y axis it is the width of the bounding box.

    Parameters
    ----------
    polygon : Polygon
        The obstacle.
    direction : array, shape (2,)
        Any length.

    Raises
    ------
    ValueError
        If the direction is zero or not finite.
    """
    low, high = _extent(polygon, direction)
    return max(high - low, 0.0)


def sidestep(obstacle: Polygon, sole: Polygon, direction: Any, clearance: float = 0.0) -> float:
    """Return how far [m] a foot must move along a direction until its complete sole is past an obstacle; 0 without one.

    With the far side of the obstacle and the rear side of the sole along the direction::

        distance = max(far side - rear side + clearance, 0)

    The thesis adds the width of the obstacle and the distance from its near side to the rear side of the sole, which
    is the same. If the obstacle extends to the front side of the sole, it can extend beyond it, where there are no
    taxels. The result is then a lower limit. For the shorter of two distances, call this for both directions.

    Parameters
    ----------
    obstacle : Polygon
        The outer polygon; the other ones can end before the obstacle does.
    sole : Polygon
        The whole sole.
    direction : array, shape (2,)
        Direction of the step; any length.
    clearance : float
        Distance to keep between the sole and the obstacle [m], 0 or more.

    Raises
    ------
    ValueError
        If the direction is zero or not finite, the sole is empty, or the clearance is negative or not finite.
    """
    if not (clearance >= 0 and math.isfinite(clearance)):
        raise ValueError(f"clearance {clearance} m must be 0 or more")
    if sole.kind == "empty":
        raise ValueError("the sole is an empty polygon without corners; pass the outline of the sole")
    rear, _ = _extent(sole, direction)
    _, far = _extent(obstacle, direction)
    return max(far - rear + clearance, 0.0)


def _extent(polygon: Polygon, direction: Any) -> tuple[float, float]:
    """Return the minimum and maximum coordinate of a polygon along a direction; (inf, -inf) for an empty one."""
    x, y = map(float, direction)
    length = math.hypot(x, y)
    if not (length > 0 and math.isfinite(length)):
        raise ValueError(f"direction {(x, y)} must have a length; pass two finite numbers, not both zero")
    coordinates = polygon.corners[:, 0] * (x / length) + polygon.corners[:, 1] * (y / length)
    return float(coordinates.min(initial=np.inf)), float(coordinates.max(initial=-np.inf))
