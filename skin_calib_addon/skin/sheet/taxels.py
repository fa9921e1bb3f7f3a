"""Taxels of a placed sheet: positions, normals, frames, corners, areas and neighbours."""

from dataclasses import replace
from functools import lru_cache
from itertools import compress

import numpy as np

from ...calibration.model import TaxelArray
from ...common.arrays import Array, cross, tangential, unit
from ..lattice import CENTRE, CORNERS, EDGES, Offsets, SheetLattice
from ..neighbours import neighbours
from .between import between, spline_matrix
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
    corners, strain = at_cells(nodes, CORNERS), cell_strain(sheet)[inside]
    taxels = _taxels(sheet, name, first_channel, uv, positions, normals, edges[:, 0] - edges[:, 2], corners, strain)
    return replace(taxels, neighbours=neighbours(taxels.ids, positions, normals, corners))


def _taxels(
    sheet: WrappedSheet,
    name: str,
    first_channel: int,
    uv: Array,
    positions: Array,
    normals: Array,
    along: Array,
    corners: Array,
    strain: Array,
) -> TaxelArray:
    """Return the taxels of the cells inside the surface, without neighbours; the rows of arrays are these cells."""
    lattice, inside = sheet.lattice, sheet.inside
    ids = tuple(compress(_all_ids(name, lattice), inside.tolist()))
    return TaxelArray(
        ids=ids,
        channels=first_channel + np.flatnonzero(inside),
        index=lattice.index[inside],
        uv=sheet.surface.wrap(uv),
        positions_link=positions,
        normals_link=normals,
        tangents_link=tangential(along, normals),
        corners_link=corners,
        areas=np.prod(lattice.pitch) * (1 + strain[:, 0]) * (1 + strain[:, 1]) * np.cos(strain[:, 2]),
        neighbours=((),) * len(ids),
        quality={"strain": strain, "size": (1 + strain[:, :2]) * lattice.pitch[::-1]},
    )


@lru_cache(maxsize=8)  # a preview of many cells needs them at each change
def _all_ids(name: str, lattice: SheetLattice) -> tuple[str, ...]:
    return tuple(f"{name}.{i}.{j}" for i, j in lattice.index.tolist())


def preview_taxels(sheet: WrappedSheet, name: str, first_channel: int = 0) -> TaxelArray:
    """Return the taxels of a sheet from the centres and the corners of its cells only: fast, for a preview.

    Between the placed nodes, positions and normals are those of splines. Strains follow from the derivatives of these
    positions at the centre of each cell. The taxels have no neighbours.
    """
    lattice, inside = sheet.lattice, sheet.inside
    uv = sheet.uv[np.ix_(*(np.array(kept, int) for kept in sheet.lines))]
    r = sheet.surface.derivatives(uv.reshape(-1, 2))
    outward = unit(cross(r[1, 0], r[0, 1]))
    nodes = (r[0, 0] + sheet.offset * outward).reshape(*uv.shape[:2], 3)
    at_corners, at_centres = (
        [spline_matrix(kept, every[k::2]) for kept, every in zip(sheet.lines, lattice.node_lines)] for k in (0, 1)
    )
    slopes = [spline_matrix(kept, every[1::2], 1) for kept, every in zip(sheet.lines, lattice.node_lines)]
    grid = between(nodes, *at_corners)
    parts = between(np.concatenate((nodes, outward.reshape(nodes.shape)), axis=2), *at_centres).reshape(-1, 6)[inside]
    positions, normals = parts[:, :3], unit(parts[:, 3:])
    along = between(nodes, at_centres[0], slopes[1]).reshape(-1, 3)[inside]  # to the next node of the row [m]
    across = between(nodes, slopes[0], at_centres[1]).reshape(-1, 3)[inside]
    a, b, c = (np.einsum("nk,nk->n", one, two) for one, two in ((along, along), (across, across), (along, across)))
    strain = strain_of(lattice, *(2 * np.sqrt(square) for square in (a, b, a + b + 2 * c, a + b - 2 * c)))
    corner = dict(zip(CORNERS, (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1])))
    corners = np.stack([corner[k].reshape(-1, 3) for k in lattice.counter_clockwise(CORNERS)], axis=1)[inside]
    uv = sheet.uv[1::2, 1::2].reshape(-1, 2)[inside]
    return _taxels(sheet, name, first_channel, uv, positions, normals, along, corners, strain)
