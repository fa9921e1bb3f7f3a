"""Neighbours of cells: within a patch, over a seam, and across patches."""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from ..calibration.model import Patch
from ..common.arrays import Array, unit
from .lattice import ROUNDING

Neighbours = tuple[tuple[str, ...], ...]


def neighbours(ids: tuple[str, ...], positions: Array, normals: Array, *outlines: Array) -> Neighbours:
    """Ids of the cells beside each cell: within a lattice, over a seam and between lattices alike.

    Two cells are neighbours where one lies ahead of a side of the other, shifted along it by half its length at most,
    and at most half a cell nearer or further than if they touched, as at a seam that overlaps or gapes; cells that
    face apart are on two sides of something thin.

    Parameters
    ----------
    outlines : arrays, each of shape (n, k, 3)
        Corners of the cells, counter-clockwise, of one array after the other [m].
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
    # Of the neighbour's centre from the middle of the side: a cell's own width across the side is twice its arm.
    far = (gap * ahead).sum(axis=1) / arm_lengths[side]
    aside = np.abs((gap * np.cross(normals[a], ahead)).sum(axis=1)) / half[side]
    near = (far >= -1 - ROUNDING) & (far <= 2 - ROUNDING) & (aside <= 1 + ROUNDING) & (a != b)
    near &= (normals[a] * normals[b]).sum(axis=1) > 0
    found: list[set[int]] = [set() for _ in ids]
    for i, j in zip(a[near].tolist(), b[near].tolist()):
        found[i].add(j)
        found[j].add(i)
    return tuple(tuple(ids[j] for j in sorted(row)) for row in found)


def with_neighbours_across(patches: tuple[Patch, ...]) -> tuple[Patch, ...]:
    """The same patches, whose taxels know those beside them in other patches too."""
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
