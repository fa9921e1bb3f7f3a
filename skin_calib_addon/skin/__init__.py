"""Flat lattices, and how they lie on a surface."""

from numpy.typing import ArrayLike

from ..calibration.model import TaxelArray
from ..geometry.surface.bspline import BSplineSurface
from .boards.board_taxels import board_taxels
from .boards.layout import Choice, lay_boards
from .boards.outline import Zone
from .boards.wrap import WrappedBoards, wrap_boards
from .lattice import HexLattice, SheetLattice
from .sheet.landmarks import Landmark
from .sheet.taxels import sheet_taxels
from .sheet.wrap import WrappedSheet, wrap_sheet

__all__ = [
    "HexLattice",
    "Landmark",
    "SheetLattice",
    "WrappedBoards",
    "WrappedSheet",
    "Zone",
    "board_taxels",
    "lay_boards",
    "sheet_taxels",
    "wrap",
    "wrap_boards",
    "wrap_sheet",
]


def wrap(
    surface: BSplineSurface,
    lattice: SheetLattice | HexLattice,
    origin: ArrayLike | None,
    direction: ArrayLike,
    *,
    cells: Choice = "all",
    offset: float = 0.0,
    name: str = "skin",
) -> TaxelArray:
    """Taxels of a flat lattice on a surface: a sheet bends with it, boards stay flat on its tangent planes.

    Parameters
    ----------
    surface : BSplineSurface
    lattice : SheetLattice or HexLattice
    origin : array, shape (3,), or None
        Where the centre of the first cell lies, (0, 0) [m]; None centres the lattice.
    direction : array, shape (3,)
        Where its rows run to, in the link frame.
    cells : "all", "fill" or cells
        Of a HexLattice, which boards to lay; see :func:`lay_boards`.
    offset : float
        Height of the skin's middle above the surface [m].
    name : str
        Of the patch; ids begin with it.
    """
    if isinstance(lattice, SheetLattice):
        return sheet_taxels(wrap_sheet(surface, lattice, origin, direction, offset=offset), name)
    boards, overhang = lay_boards(surface, lattice, cells, origin, direction, offset=offset)
    return board_taxels(boards, name, overhang=overhang)
