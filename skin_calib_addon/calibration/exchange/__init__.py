"""Read taxels from the files of other programs, and write calibrations to them. NumPy only."""

from .formats import FORMATS, WRITABLE, listed
from .link_taxels import only_patches
from .reading import READABLE, read_taxels
from .table import write_taxel_set
from .taxel_set import TaxelSet

__all__ = [
    "FORMATS",
    "READABLE",
    "WRITABLE",
    "TaxelSet",
    "listed",
    "only_patches",
    "read_taxels",
    "write_taxel_set",
]
