"""Positions in the flat skin, touches as they are seen from a taxel, and as they are along the curved skin."""

from typing import NamedTuple

import numpy as np

from ..calibration.model import Patch
from ..common.arrays import Array, BoolArray, IntArray, unit

# Smallest sine of the angle between a line of action and the skin. Larger: leaves out more touches.
MIN_INCIDENCE_SINE = 0.17
# [1] Taxels that determine how the normal changes along the skin. More: smoother. Fewer: boards are steps.
NORMAL_TAXELS = 12
# [1] Cosine of the angle between the normals at the taxel and at the touch, up to which the skin between them is an
# arc. Smaller: no effect but on touches that are not of their taxel.
MIN_ARC_COSINE = 0.5
ARC_STEPS = 4  # of a line of action to the curved skin. More: no effect.


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


class Along(NamedTuple):
    """Touches along a curved skin; row i of every field is the same touch."""

    offsets: Array  # (m, 3) from the taxel that felt it: along the row, across it, outward (NaN for a line) [m]
    places: Array  # (m, 3) positions, in the link frame [m]
    normals: Array  # (m, 3) of the skin there
    known: BoolArray  # (m,)


def along_skin(patch: Patch, rows: IntArray, points: Array, directions: Array) -> Along:
    r"""Return touches as `seen_from`, but along the skin instead of in the tangent plane of the taxel.

    Between the taxel and the touch the skin is an arc, whose normals at both ends are :math:`\mathbf{n}_0` and
    :math:`\mathbf{n}_1`. The chord is perpendicular to their sum, and shorter than the arc by the factor
    :math:`\sin(\alpha / 2) / (\alpha / 2)`, with the angle :math:`\alpha` between them.
    """
    taxels = patch.taxels
    offsets, known = seen_from(patch, rows, points, directions)
    axes, normals, positions = taxels.axes_link[rows], taxels.normals_link[rows], taxels.positions_link[rows]
    is_line = directions.any(axis=1)
    places = positions + np.einsum("mk,mkc->mc", offsets[:, :2], axes)
    places[~is_line] = points[~is_line]
    there = normals_at(patch, places)
    for _ in range(ARC_STEPS if is_line.any() else 0):
        middle = unit(normals + there)
        slope = (directions * middle).sum(axis=1)
        is_arc = is_line & known & ((normals * there).sum(axis=1) > MIN_ARC_COSINE)
        is_arc &= np.abs(slope) >= MIN_INCIDENCE_SINE
        steps = ((places - positions) * middle).sum(axis=1) / np.where(is_arc, slope, np.inf)
        places = places - steps[:, None] * directions
        there = normals_at(patch, places)
    cosine = np.clip((normals * there).sum(axis=1), -1, 1)
    is_arc = cosine > MIN_ARC_COSINE
    middle = unit(normals + np.where(is_arc[:, None], there, normals))
    chords = places - positions
    heights = (chords * middle).sum(axis=1) / (there * middle).sum(axis=1)
    chords = chords - heights[:, None] * there
    half = np.arccos(cosine) / 2
    lengths = np.linalg.norm(chords, axis=1) / np.sinc(half / np.pi)
    arcs = unit((axes @ chords[..., None])[..., 0]) * lengths[:, None]
    out = np.column_stack((arcs, np.where(is_line, np.nan, heights)))
    return Along(np.where(is_arc[:, None], out, offsets), places, there, known)


def normals_at(patch: Patch, points: Array) -> Array:
    """Return the normals of the skin near points (m, 3), linear between the taxels around each."""
    taxels, out = patch.taxels, np.empty((len(points), 3))
    for k, point in enumerate(points):
        squares = ((taxels.positions_link - point) ** 2).sum(axis=1)
        near = np.argsort(squares, kind="stable")[:NORMAL_TAXELS]
        first = near[0]
        near = near[taxels.normals_link[near] @ taxels.normals_link[first] > MIN_ARC_COSINE]  # not of the other side
        axes, normals = taxels.axes_link[first], taxels.normals_link[near]
        arms = (taxels.positions_link[near] - taxels.positions_link[first]) @ axes.T
        arm = axes @ (point - taxels.positions_link[first])
        arm *= min(1.0, np.linalg.norm(arms, axis=1).max() / max(float(np.linalg.norm(arm)), 1e-9))
        out[k] = normals[0] + arm @ np.linalg.lstsq(arms, normals - normals[0], rcond=1e-6)[0]
    return unit(out)


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
