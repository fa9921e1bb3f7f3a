"""Where a foot will stand, before it does: supporting polygons from distances."""

from typing import Any

import numpy as np

from ..common.arrays import Array
from .balance.polygon import Polygon, of_grid
from .geometry import GroundGeometry


def preemptive_polygon(ground: GroundGeometry, distances: Any, height: float) -> Polygon:
    """Hull of the cells below which something is nearer than a height, in the ground's coordinates (thesis 4.2.7).

    The thesis prints the opposite sign.

    Parameters
    ----------
    ground : GroundGeometry
    distances : array, shape (n,)
        From each taxel along its normal [m]; infinite, or NaN, where nothing is seen.
    height : float
        [m].
    """
    near = np.asarray(distances, float) < height  # NaN is not near
    return of_grid(ground.corner_hull.hull((near & ground.under).nonzero()[0]), ground.corner_hull.step)


def height_contours(ground: GroundGeometry, distances: Any, heights: Array) -> tuple[Polygon, ...]:
    """:func:`preemptive_polygon` for several heights: the ground below a swinging foot as contour lines."""
    return tuple(preemptive_polygon(ground, distances, float(h)) for h in heights)
