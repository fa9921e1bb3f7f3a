"""From a wrapped lattice to taxels: positions, normals, frames, corners, areas and neighbours."""

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Array, unit
from ..calibration.model import TaxelArray
from .lattice import CENTRE, CORNERS, EDGES
from .wrap import WrappedSheet


def sheet_taxels(sheet: WrappedSheet, name: str, first_channel: int = 0) -> TaxelArray:
    """Taxels at the cell centres of a wrapped sheet.

    Parameters
    ----------
    sheet : WrappedSheet
    name : str
        Name of the patch; ids read ``name.row.column``.
    first_channel : int
        Channel of cell (0, 0); the others follow row by row.
    """
    surface, lattice = sheet.surface, sheet.lattice
    nodes = surface.points(sheet.uv.reshape(-1, 2)).reshape(*lattice.node_shape, 3)
    uv = lattice.at_cells(sheet.uv, CENTRE)[:, 0]
    positions, normals = surface.points(uv), surface.normals(uv)
    edges = lattice.at_cells(nodes, EDGES)
    row = edges[:, 0] - edges[:, 2]
    tangents = unit(row - (row * normals).sum(axis=1, keepdims=True) * normals)
    corners = lattice.at_cells(nodes, CORNERS)
    ids = tuple(f"{name}.{i}.{j}" for i, j in lattice.index)
    return TaxelArray(
        ids=ids,
        channels=first_channel + np.arange(len(ids)),
        index=lattice.index,
        uv=surface.wrap(uv),
        positions_link=positions,
        normals_link=normals,
        tangents_link=tangents,
        corners_link=corners,
        areas=fan_areas(positions, corners),
        neighbours=neighbours(ids, positions, normals, edges),
        quality={"strain": sheet.strain},
    )


def fan_areas(centres: Array, corners: Array) -> Array:
    """Area of each cell: triangles from its centre to its sides, shape (n,) [m^2]."""
    arms = corners - centres[:, None]
    return np.linalg.norm(np.cross(arms, np.roll(arms, -1, axis=1)), axis=2).sum(axis=1) / 2


def neighbours(ids: tuple[str, ...], positions: Array, normals: Array, edges: Array) -> tuple[tuple[str, ...], ...]:
    """Ids of the cells beside each cell, within a lattice and over a seam alike.

    Two cells are neighbours where the middle of a side of one comes as near to the centre of the other as that side
    is long, which allows for a seam that gapes or overlaps by half a cell; cells that face apart are on two sides of
    something thin.

    Parameters
    ----------
    edges : array, shape (n, k, 3)
        Middles of the sides of each cell [m].
    """
    arms = np.linalg.norm(edges - positions[:, None], axis=2)
    pairs = cKDTree(edges.reshape(-1, 3)).sparse_distance_matrix(
        cKDTree(positions), 2 * float(arms.max()), output_type="coo_matrix"
    )
    a, b = pairs.row // edges.shape[1], pairs.col
    # A cell's own width across this side is twice its arm.
    near = (pairs.data <= 2 * arms.ravel()[pairs.row] * (1 - 1e-6)) & (a != b)
    near &= (normals[a] * normals[b]).sum(axis=1) > 0
    beside: list[set[int]] = [set() for _ in ids]
    for i, j in zip(a[near].tolist(), b[near].tolist()):
        beside[i].add(j)
        beside[j].add(i)
    return tuple(tuple(ids[j] for j in sorted(row)) for row in beside)
