"""Taxels of a placed sheet: positions, normals, frames, corners, areas and neighbours."""

from functools import lru_cache
from itertools import compress

import numpy as np

from ...calibration.model import TaxelArray
from ...common.arrays import Array, BoolArray, IntArray, cross, unit
from ..lattice import CENTRE, CORNERS, EDGES, Offsets, SheetLattice
from ..neighbours import neighbours
from .relax import arcs
from .strain import cell_strain, strain_of
from .wrap import WrappedSheet


def sheet_taxels(sheet: WrappedSheet, name: str, first_channel: int = 0) -> TaxelArray:
    r"""Return the taxels at the cell centres of a placed sheet.

    The area of a cell follows from the strains along the row and across the rows and from the shear angle:

    .. math:: A = p_r p_c (1 + \varepsilon_u) (1 + \varepsilon_v) \cos\gamma \quad [m^2]

    with the pitches p [m].

    Parameters
    ----------
    sheet : WrappedSheet
        The placed sheet.
    name : str
        Name of the patch; ids read ``name.row.column``.
    first_channel : int
        Channel of cell (0, 0); the others follow row by row. Cells outside the surface keep their channel.

    Returns
    -------
    TaxelArray
        In the link frame; ``quality`` has the strain and the size [m] of each cell.
    """
    surface, lattice, inside = sheet.surface, sheet.lattice, sheet.inside
    flat = sheet.uv.reshape(-1, 2)
    nodes, outward = surface.points(flat), surface.normals(flat)
    nodes = (nodes + sheet.offset * outward).reshape(*lattice.node_shape, 3)

    def at_cells(values: Array, offsets: Offsets) -> Array:
        return lattice.at_cells(values, lattice.counter_clockwise(offsets))[inside]

    positions, uv = at_cells(nodes, CENTRE)[:, 0], at_cells(sheet.uv, CENTRE)[:, 0]
    normals = at_cells(outward.reshape(nodes.shape), CENTRE)[:, 0]
    edges = at_cells(nodes, EDGES)
    row, corners = edges[:, 0] - edges[:, 2], at_cells(nodes, CORNERS)
    tangents = unit(row - (row * normals).sum(axis=1, keepdims=True) * normals)
    index, strain = lattice.index[inside], cell_strain(sheet)[inside]
    ids = _ids(name, lattice, inside)
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


def _ids(name: str, lattice: SheetLattice, inside: BoolArray) -> tuple[str, ...]:
    every = _all_ids(name, lattice)
    return every if inside.all() else tuple(compress(every, inside.tolist()))


@lru_cache(maxsize=8)  # a preview of many cells needs them at each change
def _all_ids(name: str, lattice: SheetLattice) -> tuple[str, ...]:
    return tuple(f"{name}.{i}.{j}" for i, j in lattice.index.tolist())


def preview_taxels(sheet: WrappedSheet, name: str, first_channel: int = 0) -> TaxelArray:
    """Return the taxels of a sheet from the centres and the corners of its cells only: fast, for a preview.

    The strain is that of the sides and the diagonals of each cell, in one piece. The taxels have no neighbours.

    Parameters
    ----------
    sheet : WrappedSheet
        The placed sheet.
    name : str
        Name of the patch.
    first_channel : int
        As for :func:`sheet_taxels`.

    Returns
    -------
    TaxelArray
        In the link frame.
    """
    lattice, inside = sheet.lattice, sheet.inside
    shape = lattice.rows + 1, lattice.columns + 1
    flat, uv = sheet.uv[::2, ::2].reshape(-1, 2), sheet.uv[1::2, 1::2].reshape(-1, 2)
    r = sheet.surface.derivatives(np.concatenate((flat, uv)))
    outward = unit(cross(r[1, 0], r[0, 1]))
    points = r[0, 0] + sheet.offset * outward
    number = np.arange(len(flat)).reshape(shape)
    at = dict(zip(CORNERS, (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1])))
    of_cells = np.stack([at[k].ravel() for k in lattice.counter_clockwise(CORNERS)], axis=1)[inside]
    corners, positions, normals = points[of_cells], points[len(flat) :][inside], outward[len(flat) :][inside]
    if sheet.layer is not sheet.surface:
        r = sheet.layer.derivatives(flat)
        outward = unit(cross(r[1, 0], r[0, 1]))

    def lengths(start: IntArray, stop: IntArray) -> Array:
        pairs = np.column_stack((start.ravel(), stop.ravel()))
        return arcs(r[0, 0], outward, pairs)[0].reshape(start.shape)

    along, across = lengths(number[:, :-1], number[:, 1:]), lengths(number[:-1], number[1:])
    rising, falling = lengths(at[CORNERS[0]], at[CORNERS[2]]), lengths(at[CORNERS[1]], at[CORNERS[3]])
    sides = (along[:-1] + along[1:]) / 2, (across[:, :-1] + across[:, 1:]) / 2
    strain = strain_of(lattice, *(part.ravel()[inside] for part in (*sides, rising, falling)))
    grid = points[: len(flat)].reshape(*shape, 3)
    index, ids = lattice.index[inside], _ids(name, lattice, inside)
    row = (grid[:-1, 1:] + grid[1:, 1:] - grid[:-1, :-1] - grid[1:, :-1]).reshape(-1, 3)[inside]
    return TaxelArray(
        ids=ids,
        channels=first_channel + np.flatnonzero(inside),
        index=index,
        uv=sheet.surface.wrap(uv[inside]),
        positions_link=positions,
        normals_link=normals,
        tangents_link=unit(row - (row * normals).sum(axis=1, keepdims=True) * normals),
        corners_link=corners,
        areas=np.prod(lattice.pitch) * (1 + strain[:, 0]) * (1 + strain[:, 1]) * np.cos(strain[:, 2]),
        neighbours=((),) * len(index),
        quality={"strain": strain, "size": (1 + strain[:, :2]) * lattice.pitch[::-1]},
    )


def fan_areas(centres: Array, corners: Array) -> Array:
    """Return the area of each cell as the sum of the triangles from its centre to its sides.

    Parameters
    ----------
    centres : array, shape (n, 3)
        Centres [m].
    corners : array, shape (n, k, 3)
        Corners in order [m].

    Returns
    -------
    array, shape (n,)
        Areas [m^2].
    """
    arms = corners - centres[:, None]
    return np.linalg.norm(np.cross(arms, np.roll(arms, -1, axis=1)), axis=2).sum(axis=1) / 2
