"""Taxels of a placed sheet: positions, normals, frames, corners, areas and neighbours."""

import numpy as np

from ...calibration.model import TaxelArray
from ...common.arrays import Array, unit
from ..lattice import CENTRE, CORNERS, EDGES, Offsets
from ..neighbours import neighbours
from .strain import cell_strain
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
