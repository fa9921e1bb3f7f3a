"""Neighbours of cells: inside a patch, over a seam, and across patches."""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from ..calibration.model import Patch
from ..common.arrays import Array, IntArray, unit
from .lattice import ROUNDING

Neighbours = tuple[tuple[str, ...], ...]


def neighbours(ids: tuple[str, ...], positions: Array, normals: Array, *outlines: Array) -> Neighbours:
    """Return the ids of the neighbours of each cell.

    One rule covers cells of one lattice, cells at both sides of a seam, and cells of different lattices. The arm of a
    side is the vector from the centre of its cell to its middle. Cell b is a neighbour of cell a if, for one side of a:

    - along the arm, the centre of b is between one arm behind the side and two arms ahead of it (one arm if they
    touch);
    - along the side, the centre of b is at most half of the length of the side from its middle;
    - the angle between the normals is below 90 degrees. It is not on the two faces of a thin part.

    A neighbour in one direction is a neighbour in both.
    """
    corners = [outline.reshape(-1, 3) for outline in outlines]
    following = np.concatenate([np.roll(outline, -1, axis=1).reshape(-1, 3) for outline in outlines])
    starts, counts = np.concatenate(corners), [outline.shape[1] for outline in outlines for _ in outline]
    middles, half = (starts + following) / 2, np.linalg.norm(following - starts, axis=1) / 2
    owner = np.repeat(np.arange(len(ids)), counts)
    arms = middles - positions[owner]
    arm_lengths = np.linalg.norm(arms, axis=1)
    pairs = cKDTree(middles).sparse_distance_matrix(
        cKDTree(positions), 3 * float(arm_lengths.max()), output_type="coo_matrix"
    )
    side, b = pairs.row, pairs.col
    a, ahead = owner[side], unit(arms)[side]
    gap = positions[b] - middles[side]
    # Coordinates of the neighbour's centre from the middle of the side. The unit of ``far`` is the arm: half of a cell.
    far = (gap * ahead).sum(axis=1) / arm_lengths[side]
    aside = np.abs((gap * np.cross(normals[a], ahead)).sum(axis=1)) / half[side]
    near = (far >= -1 - ROUNDING) & (far <= 2 - ROUNDING) & (aside <= 1 + ROUNDING) & (a != b)
    near &= (normals[a] * normals[b]).sum(axis=1) > 0
    return mutual(ids, np.column_stack((a[near], b[near])))


def mutual(ids: tuple[str, ...], pairs: IntArray) -> Neighbours:
    """Return the ids of the neighbours of each taxel from pairs (k, 2); a neighbour in one direction is one in both."""
    found: list[set[int]] = [set() for _ in ids]
    for i, j in pairs.tolist():
        found[i].add(j)
        found[j].add(i)
    return tuple(tuple(ids[j] for j in sorted(row)) for row in found)


def angles(normals: Array, pairs: IntArray) -> Array:
    r"""Return the angles between the normals of pairs of cells, exact also for small angles.

    .. math:: \alpha = 2 \arcsin(|n_a - n_b| / 2) \quad [rad]
    """
    a, b = normals[pairs[:, 0]], normals[pairs[:, 1]]
    return 2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=1) / 2, 0, 1))


def largest_of(values: Array, pairs: IntArray, count: int) -> Array:
    """Return the largest value of the pairs that begin at each cell, NaN without a pair, shape (count,)."""
    result = np.full(count, np.nan)
    np.fmax.at(result, pairs[:, 0], values)
    return result


def with_neighbours_across(patches: tuple[Patch, ...]) -> tuple[Patch, ...]:
    """Return the same patches; the neighbours of their taxels include taxels of other patches."""
    if len(patches) < 2:
        return patches
    taxels = [patch.taxels for patch in patches]
    ids = sum((t.ids for t in taxels), ())
    positions, normals = (np.concatenate([getattr(t, k) for t in taxels]) for k in ("positions_link", "normals_link"))
    patch_of = np.repeat(np.arange(len(patches)), [len(t.ids) for t in taxels])
    home = dict(zip(ids, patch_of.tolist()))
    found = dict(zip(ids, neighbours(ids, positions, normals, *(t.corners_link for t in taxels))))
    result = []
    for k, patch in enumerate(patches):
        t = patch.taxels
        names = tuple(
            own + tuple(other for other in found[taxel] if home[other] != k) for taxel, own in zip(t.ids, t.neighbours)
        )
        result.append(replace(patch, taxels=replace(t, neighbours=names)))
    return tuple(result)
