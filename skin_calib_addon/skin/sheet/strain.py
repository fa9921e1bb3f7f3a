"""Strain of the cells of a placed sheet."""

import numpy as np

from ...common.arrays import Array, cross, unit
from ..lattice import SheetLattice
from .relax import pair_lengths
from .wrap import WrappedSheet


def cell_strain(sheet: WrappedSheet) -> Array:
    r"""Return the strain of each cell along its row, across the rows, and in shear [rad], shape (cells, 3).

    With the length a along the row, b across it, and the diagonals d on the surface, and the pitches p [m]:

    .. math::
        \varepsilon_u = a / p_u - 1, \quad \varepsilon_v = b / p_v - 1, \quad
        \gamma = \arcsin\frac{d_1^2 - d_2^2}{4\,a\,b}

    """
    lattice = sheet.lattice
    r = sheet.layer.derivatives(sheet.uv.reshape(-1, 2))
    normals = unit(cross(r[1, 0], r[0, 1]))
    points, (_, b) = r[0, 0], lattice.node_shape
    i, j = (2 * lattice.index + 1).T
    centre = i * b + j

    def length(*offsets: int) -> Array:
        arms = [pair_lengths(points, normals, np.column_stack((centre, centre + o)))[0] for o in offsets]
        return np.sum(arms, axis=0)

    along, across = length(-1, 1), length(-b, b)
    return strain_of(lattice, along, across, length(-b - 1, b + 1), length(-b + 1, b - 1))


def strain_of(lattice: SheetLattice, along: Array, across: Array, rising: Array, falling: Array) -> Array:
    """Return the strain of cells as `cell_strain`, shape (k, 3)."""
    shear = np.arcsin(np.clip((rising**2 - falling**2) / (4 * along * across), -1, 1))
    return np.column_stack((along / lattice.pitch[1] - 1, across / lattice.pitch[0] - 1, shear))
