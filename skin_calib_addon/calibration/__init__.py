"""Model, file and validation of the calibration of a link. NumPy only."""

from ..common.encoding import encode
from ..common.findings import Finding
from .file import check_bytes, check_calibration, from_document, load_calibration, save_calibration, to_document
from .modality import Modality
from .model import LinkCalibration, MeshSource, Patch, Registration, SurfaceModel, TaxelArray, Touched, Trusted
from .response import Response, ResponseTable
from .taxel_responses import TaxelResponses
from .validate import validate

__all__ = [
    "Finding",
    "LinkCalibration",
    "MeshSource",
    "Modality",
    "Patch",
    "Registration",
    "Response",
    "ResponseTable",
    "SurfaceModel",
    "TaxelArray",
    "TaxelResponses",
    "Touched",
    "Trusted",
    "check_bytes",
    "check_calibration",
    "encode",
    "from_document",
    "load_calibration",
    "save_calibration",
    "to_document",
    "validate",
]
