"""The calibration of a link: its model, its file, and everything that can be wrong with it. NumPy only."""

from .encoding import encode
from .file import check_bytes, check_calibration, from_document, load_calibration, save_calibration, to_document
from .findings import Finding
from .model import LinkCalibration, MeshSource, Patch, SurfaceModel, TaxelArray
from .response import Response, ResponseTable, TaxelResponses
from .validate import validate

__all__ = [
    "Finding",
    "LinkCalibration",
    "MeshSource",
    "Patch",
    "Response",
    "ResponseTable",
    "SurfaceModel",
    "TaxelArray",
    "TaxelResponses",
    "check_bytes",
    "check_calibration",
    "encode",
    "from_document",
    "load_calibration",
    "save_calibration",
    "to_document",
    "validate",
]
