"""Flat lattices, and how they lie on a surface."""

from .landmarks import Landmark
from .lattice import HexLattice, SheetLattice
from .taxels import sheet_taxels
from .wrap import WrappedSheet, wrap_sheet

__all__ = ["HexLattice", "Landmark", "SheetLattice", "WrappedSheet", "sheet_taxels", "wrap_sheet"]
