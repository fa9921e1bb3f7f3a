"""Read the taxels of a file in any supported format."""

import os
import re
from collections.abc import Callable

from ...common.errors import CalibrationFormatError
from ...common.findings import FoundError, did_you_mean, in_short
from ...common.plain_text import BLOCK_LENGTH
from ...common.strict_json import read
from ...common.text import check_size, text_of
from .icub import BLOCK, read_icub
from .pcd import FIRST_LINES, read_pcd
from .ply import MAGIC, read_ply
from .table import has_header, read_table
from .taxel_set import Draft, TaxelSet, finished
from .tum import read_tum
from .urdf import ROOT, read_urdf

READERS: dict[str, Callable[[str], Draft]] = {
    "icub": read_icub,
    "tum": read_tum,
    "csv": read_table,
    "gentact": read_table,
    "urdf": read_urdf,
    "urdf-tactile": read_urdf,
}
CLOUDS: dict[str, Callable[[bytes], Draft]] = {"ply": read_ply, "pcd": read_pcd}
READABLE = (*READERS, *CLOUDS)

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_ELEMENT = re.compile(r"<([A-Za-z_][\w.:-]*)")


def read_taxels(path: str | os.PathLike[str], format: str | None = None, only: str | None = None) -> TaxelSet:
    """Read a file of taxels without any change: positions and normals are not transformed or completed."""
    if format is not None and format not in READABLE:
        known = ", ".join(READABLE)
        raise CalibrationFormatError(
            f"unknown taxel format '{format}'. Supported: {known}{did_you_mean(format, READABLE)}"
        )
    data = read(path)
    check_size(data, path)
    try:
        taxels, findings = finished(_draft(data, path, format), only)
    except FoundError as problem:
        taxels, findings = None, (problem.finding,)
    if taxels is None:
        raise CalibrationFormatError(f"'{path}' has {in_short(findings)}", findings)
    return taxels


def _draft(data: bytes, path: str | os.PathLike[str], format: str | None) -> Draft:
    """Return what the reader of a format finds; the format is found from the content if it is not given."""
    format = format or cloud_format_of(data)
    if format in CLOUDS:
        return CLOUDS[format](data)
    text = text_of(data, path)
    format = format or format_of(text)
    if format is None and text.lstrip().startswith("{"):
        raise CalibrationFormatError(
            f"'{path}' is a JSON file, not a taxel file. For a calibration, use a file that export wrote."
        )
    if format is None:
        raise CalibrationFormatError(
            f"the taxel format of '{path}' is unknown. Supported: positions files with a line {BLOCK}, XML of a "
            "patch or a robot, tables whose header names x, y and z, and PLY or PCD point clouds. "
            "Export the file again, or state its format."
        )
    return READERS[format](text)


def cloud_format_of(data: bytes) -> str | None:
    """Return the point cloud format of a file, or None."""
    if data.split(b"\n", 1)[0].strip() == MAGIC:
        return "ply"
    return "pcd" if data.startswith(FIRST_LINES) else None


def format_of(text: str) -> str | None:
    """Return the format of a text, or None."""
    if text.lstrip().startswith("<"):
        root = _ELEMENT.search(_COMMENT.sub("", text[:BLOCK_LENGTH]))
        return "urdf" if root and root[1] == ROOT else "tum"
    if any(content.strip() == BLOCK for content in text.split("\n")):
        return "icub"
    return "csv" if has_header(text) else None
