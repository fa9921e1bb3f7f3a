"""Taxel sets in the files of other programs, read as they are. NumPy only."""

from .reading import FORMATS, read_taxels
from .taxel_set import TaxelSet

__all__ = ["FORMATS", "TaxelSet", "read_taxels"]
