"""Flat lattices of cells, wrapped on a surface."""

from .lattice import SheetLattice
from .taxels import sheet_taxels
from .wrap import WrappedSheet, wrap_sheet

__all__ = ["SheetLattice", "WrappedSheet", "sheet_taxels", "wrap_sheet"]
