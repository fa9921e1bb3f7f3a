"""From a wrapped lattice to taxels: positions, normals, frames, corners, areas and neighbours."""

import numpy as np
from scipy.spatial import cKDTree

from ...calibration.model import TaxelArray
from ...common.arrays import Array, unit
from ..lattice import CENTRE, CORNERS, EDGES, Offsets
from .strain import cell_strain
from .wrap import WrappedSheet

# Shares of a cell that may be rounding: neighbours at a whole cell's gap are none, those shifted by half a side are.
ROUNDING = 1e-6

Neighbours = tuple[tuple[str, ...], ...]


def sheet_taxels(sheet: WrappedSheet, name: str, first_channel: int = 0) -> TaxelArray:
    """Taxels at the cell centres of a wrapped sheet.

    Parameters
    ----------
    sheet : WrappedSheet
    name : str
        Name of the patch; ids read ``name.row.column``.
    first_channel : int
        Channel of cell (0, 0); the others follow row by row. Cells that are trimmed keep theirs.
    """
    surface, lattice, inside = sheet.surface, sheet.lattice, sheet.inside
    flat = sheet.uv.reshape(-1, 2)
    nodes, upright = surface.points(flat), surface.normals(flat)
    nodes = (nodes + sheet.offset * upright).reshape(*lattice.node_shape, 3)

    def at_cells(values: Array, offsets: Offsets) -> Array:
        return lattice.at_cells(values, lattice.counter_clockwise(offsets))[inside]

    positions, uv = at_cells(nodes, CENTRE)[:, 0], at_cells(sheet.uv, CENTRE)[:, 0]
    normals = at_cells(upright.reshape(nodes.shape), CENTRE)[:, 0]
    edges = at_cells(nodes, EDGES)
    row, corners = edges[:, 0] - edges[:, 2], at_cells(nodes, CORNERS)
    tangents = unit(row - (row * normals).sum(axis=1, keepdims=True) * normals)
    index, strain = lattice.index[inside], cell_strain(sheet)[inside]
    ids = tuple(f"{name}.{i}.{j}" for i, j in index)
    return TaxelArray(
        ids=ids,
        channels=first_channel + np.flatnonzero(inside),
        index=index,
        uv=surface.wrap(uv),
        positions_link=positions,
        normals_link=normals,
        tangents_link=tangents,
        corners_link=corners,
        areas=np.prod(lattice.pitch) * (1 + strain[:, 0]) * (1 + strain[:, 1]) * np.cos(strain[:, 2]),
        neighbours=neighbours(ids, positions, normals, corners),
        quality={"strain": strain, "size": (1 + strain[:, :2]) * lattice.pitch[::-1]},
    )


def fan_areas(centres: Array, corners: Array) -> Array:
    """Area of each cell: triangles from its centre to its sides, shape (n,) [m^2]."""
    arms = corners - centres[:, None]
    return np.linalg.norm(np.cross(arms, np.roll(arms, -1, axis=1)), axis=2).sum(axis=1) / 2


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
    reach = np.linalg.norm(arms, axis=1)
    pairs = cKDTree(middles).sparse_distance_matrix(
        cKDTree(positions), 3 * float(reach.max()), output_type="coo_matrix"
    )
    side, b = pairs.row, pairs.col
    a, ahead = owner[side], unit(arms)[side]
    gap = positions[b] - middles[side]
    # Of the neighbour's centre from the middle of the side: a cell's own width across the side is twice its arm.
    far = (gap * ahead).sum(axis=1) / reach[side]
    aside = np.abs((gap * np.cross(normals[a], ahead)).sum(axis=1)) / half[side]
    near = (far >= -1 - ROUNDING) & (far <= 2 - ROUNDING) & (aside <= 1 + ROUNDING) & (a != b)
    near &= (normals[a] * normals[b]).sum(axis=1) > 0
    beside: list[set[int]] = [set() for _ in ids]
    for i, j in zip(a[near].tolist(), b[near].tolist()):
        beside[i].add(j)
        beside[j].add(i)
    return tuple(tuple(ids[j] for j in sorted(row)) for row in beside)
