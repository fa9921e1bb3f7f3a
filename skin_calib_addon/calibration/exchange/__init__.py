"""Taxel sets in the files of other programs: read as they are, and written from a calibration. NumPy only."""

from .formats import FORMATS, WRITABLE, Format
from .link_taxels import only_patches
from .reading import READABLE, read_taxels
from .table import write_taxel_set
from .taxel_set import TaxelSet

__all__ = ["FORMATS", "READABLE", "WRITABLE", "Format", "TaxelSet", "only_patches", "read_taxels", "write_taxel_set"]
