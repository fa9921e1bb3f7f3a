"""Positions in the flat skin, and touches as they are seen from a taxel."""

import numpy as np

from ..calibration.model import Patch
from ..common.arrays import Array, BoolArray, IntArray

# Smallest sine of the angle between a line of action and the skin. Larger: leaves out more touches.
MIN_INCIDENCE_SINE = 0.17


def seen_from(patch: Patch, rows: IntArray, points: Array, directions: Array) -> tuple[Array, BoolArray]:
    """Return touches as seen from taxels, shape (m, 3): along the row, across it, outward [m]; and which are known.

    A line of action is intersected with the tangent plane of the taxel, and has no height (NaN). It is unknown if it is
    nearly parallel to this plane.
    """
    taxels = patch.taxels
    normals, axes = taxels.normals_link[rows], taxels.axes_link[rows]
    is_line, slope = directions.any(axis=-1), (directions * normals).sum(axis=-1)
    known = ~is_line | (np.abs(slope) >= MIN_INCIDENCE_SINE)
    arms = points - taxels.positions_link[rows]
    arms = arms - ((arms * normals).sum(axis=-1) / np.where(is_line & known, slope, np.inf))[..., None] * directions
    along = (axes @ arms[..., None])[..., 0]
    height = np.where(is_line, np.nan, (arms * normals).sum(axis=-1))
    return np.concatenate((along, height[..., None]), axis=-1), known


def flat_places(patch: Patch, cells: IntArray | Array) -> Array:
    """Return the positions of cells in the flat skin, x along the rows, shape (n, 2) [m]."""
    i, j = cells.T.astype(float)
    if patch.kind == "hexagons":
        return patch.pitch[0] * np.column_stack((i + j / 2, np.sqrt(0.75) * j))
    return np.column_stack((patch.pitch[1] * j, _hand(patch) * patch.pitch[0] * i))


def link_point(patch: Patch, flat: Array) -> Array:
    """Return the point of a flat position (2,), in the tangent plane of the nearest taxel, shape (3,) [m]."""
    arms = flat - flat_places(patch, patch.taxels.index)
    row = int((arms**2).sum(axis=1).argmin())
    point: Array = patch.taxels.positions_link[row] + arms[row] @ patch.taxels.axes_link[row]
    return point


def flat_point(patch: Patch, point: Array) -> Array:
    """Return the flat position (2,) [m] of a point, in the tangent plane of the nearest taxel."""
    arms = point - patch.taxels.positions_link
    row = int((arms**2).sum(axis=1).argmin())
    flat: Array = flat_places(patch, patch.taxels.index[row][None])[0] + patch.taxels.axes_link[row] @ arms[row]
    return flat


def _hand(patch: Patch) -> float:
    """Return 1 if the next row of a sheet is to the left of a row, -1 if it is to the right."""
    taxels = patch.taxels
    row_of = {cell: row for row, cell in enumerate(map(tuple, taxels.index.tolist()))}
    pairs = [(row, row_of[i + 1, j]) for (i, j), row in row_of.items() if (i + 1, j) in row_of]
    if not pairs:
        return 1.0
    here, there = np.array(pairs).T
    rows_apart = taxels.positions_link[there] - taxels.positions_link[here]
    return 1.0 if (taxels.axes_link[here, 1] * rows_apart).sum() > 0 else -1.0
