"""Flat lattices of cells, and their placement on a surface."""

from numpy.typing import ArrayLike

from ..calibration.model import TaxelArray
from ..geometry.surface.bspline import BSplineSurface
from .boards.board_taxels import board_taxels
from .boards.ground import Zone
from .boards.layout import Choice, WrappedBoards, lay_boards
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
    """Place a flat lattice on a surface and return its taxels.

    A sheet bends with the surface. Boards stay flat, in the tangent planes of the surface.

    Parameters
    ----------
    surface : BSplineSurface
        The surface, in the link frame.
    lattice : SheetLattice or HexLattice
        The flat cells.
    origin : array, shape (3,), or None
        Position of the centre of cell (0, 0), in the link frame [m]. None centres the lattice.
    direction : array, shape (3,)
        Direction of the rows, in the link frame.
    cells : "all", "fill" or sequence of (q, r)
        Boards of a HexLattice; see :func:`lay_boards`. A sheet ignores it.
    offset : float
        Height of the middle of the skin above the surface [m].
    name : str
        Name of the patch. The ids of the taxels begin with it.

    Returns
    -------
    TaxelArray
        One taxel per cell, in the link frame.

    Raises
    ------
    InvalidPlan
        If the lattice does not fit the surface, or the direction is perpendicular to it.
    OutsideSurface
        If the centre of a cell lies outside the surface.
    """
    if isinstance(lattice, SheetLattice):
        return sheet_taxels(wrap_sheet(surface, lattice, origin, direction, offset=offset), name)
    boards, overhang = lay_boards(surface, lattice, cells, origin, direction, offset=offset)
    return board_taxels(boards, name, overhang=overhang)
