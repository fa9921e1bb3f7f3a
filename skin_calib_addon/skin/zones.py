"""Faces without skin: discs that cover them, as the excluded zones of boards, and the taxels of a sheet over them."""

import numpy as np
from scipy.spatial import cKDTree

from ..calibration.model import TaxelArray
from ..common.arrays import Array, BoolArray

# [1] ratio of the distance of the examined points on a face to the largest radius. Larger: discs protrude more.
SPACING = 0.1
STEPS_PER_CELL = 5  # [1] examined points on a face along a cell. Larger: corners over the faces are found, more time
MAX_CENTRES = 50  # [1] centres that are tried for a ball. Larger: fewer balls, more time


def discs_over(triangles: Array, max_radius: float) -> list[tuple[Array, float]]:
    """Return few and small balls, centre (3,) and radius [m], around points of faces that contain all of the faces.

    The ball that contains the most points that are left is chosen, and becomes as small as they permit.
    """
    step = SPACING * max_radius
    points = _points_on(triangles, step)
    limit = max_radius - step / np.sqrt(3)  # [m] every point of a face is as near as this to a point of its grid
    found, left = [], np.ones(len(points), bool)
    while left.any():
        from_start = np.linalg.norm(points - points[np.argmax(left)], axis=1)
        centres = points[from_start <= limit]
        centres = centres[:: -(-len(centres) // MAX_CENTRES)]
        near = np.flatnonzero(left & (from_start <= 2 * limit))
        distances = np.linalg.norm(centres[:, None] - points[near], axis=2)
        inside = distances <= limit
        farthest = np.where(inside, distances, 0.0).max(axis=1)
        best = np.lexsort((farthest, -inside.sum(axis=1)))[0]
        found.append((centres[best], float(farthest[best] + max_radius - limit)))
        left[near[inside[best]]] = False
    return found


def taxels_over(triangles: Array, taxels: TaxelArray) -> BoolArray:
    """Return which taxels (n,) have a part of their cell over or below faces.

    A point of a face is below the cell whose centre is the nearest, if it is not farther than the corners of this cell.
    """
    points = _points_on(triangles, float(np.sqrt(taxels.areas.min())) / STEPS_PER_CELL)
    distances, nearest = map(np.asarray, cKDTree(taxels.positions_link).query(points))
    radius = np.linalg.norm(taxels.corners_link - taxels.positions_link[:, None], axis=2).max(axis=1)
    over = np.zeros(len(taxels.ids), bool)
    over[nearest[distances <= radius[nearest]]] = True
    return over


def _points_on(triangles: Array, step: float) -> Array:
    """Return a grid of points on faces with at most a distance from one to the next [m], shape (p, 3)."""
    sides = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    points = []
    for corners, side in zip(triangles, sides):
        k = max(int(np.ceil(side / step)), 1)
        i, j = np.array([(i, j) for i in range(k + 1) for j in range(k + 1 - i)]).T
        points.append((np.stack((i, j, k - i - j), axis=1) / k) @ corners)
    return np.unique(np.concatenate(points).round(9), axis=0)
