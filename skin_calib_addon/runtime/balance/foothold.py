"""Whether a foothold bears, and how far to step aside if not (thesis 4.3.2).

All polygons are of one foot and lie in the plane of its sole, in the sole's frame.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from .polygon import Polygon


@dataclass(frozen=True)
class FootholdShares:
    """Which share of the sole stands, A_p / A_s, by three areas: the thesis does not say which one it means.

    On pebbles the hull is 0.45 of the sole, the cells are 0.10, and what truly touches is 0.011 on simulated soles.
    """

    hull: float  # of the outer polygon: bridges what lies between contacts
    cells: float  # of the active cells, each as a whole: may exceed 1 by a cell's rim
    guaranteed: float  # of the guaranteed polygon: where the centre of pressure may go for sure


def foothold_shares(outer: Polygon, cells: float, guaranteed: Polygon, sole: float) -> FootholdShares:
    """Shares of the sole's area that a contact covers.

    Parameters
    ----------
    outer, guaranteed : Polygon
        The hulls of the corners of the active cells, and of their centres less a cell.
    cells : float
        Sum of the areas of the active cells [m^2].
    sole : float
        Area of the whole sole [m^2].

    Raises
    ------
    ValueError
        If the sole's area is not a positive number.
    """
    if not (sole > 0 and math.isfinite(sole)):
        raise ValueError(f"sole area {sole} m^2 must be a positive number")
    return FootholdShares(outer.area / sole, cells / sole, guaranteed.area / sole)


def must_replan(share: float, least: float) -> bool:
    """Whether a step must be planned anew: its share of the sole is not above the least one, or is no number."""
    return not share > least


def width_along(polygon: Polygon, direction: Any) -> float:
    """Width [m] of an obstacle along a direction (2,), the thesis's Delta_o; 0 of a point or nothing.

    Along the axes it is that of the bounding box.

    Raises
    ------
    ValueError
        If the direction has no length.
    """
    low, high = _reach(polygon, direction)
    return max(high - low, 0.0)


def sidestep(obstacle: Polygon, sole: Polygon, direction: Any, clearance: float = 0.0) -> float:
    """How far [m] a foot moves along a direction (2,) until all of its sole is past an obstacle; 0 if none was met.

    The thesis adds the obstacle's width and the distance from its near side to the sole's rim behind: together, from
    that rim to the obstacle's far side; and the clearance. An obstacle that reaches the sole's rim in front may go on
    beyond it, where no taxel is: then this is the least that it takes. For the shorter way ask along both directions.

    Parameters
    ----------
    obstacle : Polygon
        What was felt: the outer polygon, for the others may end before the obstacle does.
    sole : Polygon
        The whole sole.
    direction : array, shape (2,)
        Where to step; its length does not matter.
    clearance : float
        Distance [m] to keep between the sole and the obstacle, 0 or more.

    Raises
    ------
    ValueError
        If the direction has no length, the sole no corners, or the clearance is negative or not a number.
    """
    if not (clearance >= 0 and math.isfinite(clearance)):
        raise ValueError(f"clearance {clearance} m must be 0 or more")
    if sole.kind == "empty":
        raise ValueError("a sole without corners cannot step aside")
    rim, _ = _reach(sole, direction)
    _, far = _reach(obstacle, direction)
    return max(far - rim + clearance, 0.0)


def _reach(polygon: Polygon, direction: Any) -> tuple[float, float]:
    """Lowest and highest place of a polygon along a direction; (inf, -inf) of nothing."""
    x, y = map(float, direction)
    length = math.hypot(x, y)
    if not (length > 0 and math.isfinite(length)):
        raise ValueError(f"direction {(x, y)} must have a length")
    places = polygon.corners[:, 0] * (x / length) + polygon.corners[:, 1] * (y / length)
    return float(places.min(initial=np.inf)), float(places.max(initial=-np.inf))
