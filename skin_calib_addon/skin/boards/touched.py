"""Which board of a lattice a point of the link belongs to, whether it is there or could be."""

import numpy as np

from ...calibration.model import TaxelArray
from ...common.arrays import Array, cross
from ..lattice import HexLattice


def board_at(taxels: TaxelArray, lattice: HexLattice, point: Array) -> tuple[int, int]:
    """Axial coordinates of the board at a point: counted from the nearest board, over whose plane the lattice goes on.

    Parameters
    ----------
    taxels : TaxelArray
        Of the boards that are there; ``index`` holds their axial coordinates.
    point : array, shape (3,)
        On the link, or near it [m].
    """
    arms = point - taxels.positions_link
    i = int(np.argmin((arms**2).sum(axis=1)))
    tangent, normal = taxels.tangents_link[i], taxels.normals_link[i]
    q, r = lattice.cell_at(np.array((arms[i] @ tangent, arms[i] @ cross(normal, tangent))))
    return int(taxels.index[i, 0]) + q, int(taxels.index[i, 1]) + r
