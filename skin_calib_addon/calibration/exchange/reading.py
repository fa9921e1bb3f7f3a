"""Read the taxels of a file, whatever program wrote it."""

import os
import re
from collections.abc import Callable

from ...common.errors import CalibrationFormatError
from ...common.findings import did_you_mean, in_short
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
ROOT_SEARCH_LENGTH = 2**16  # characters among which the root element is looked for


def read_taxels(path: str | os.PathLike[str], format: str | None = None, only: str | None = None) -> TaxelSet:
    """Read a file of taxels as it is: nothing is moved, turned round or made up.

    Parameters
    ----------
    path : path
    format : one of `READABLE`, optional
        Else the content tells.
    only : str, optional
        A pattern of file names, as in a shell: taxels whose label does not match are left out.

    Raises
    ------
    CalibrationFormatError
        If the file cannot be read, or anything in it makes it unusable; ``findings`` has everything found.
    """
    if format is not None and format not in READABLE:
        known = ", ".join(READABLE)
        raise CalibrationFormatError(
            f"no format '{format}' of taxels; use one of {known}{did_you_mean(format, READABLE)}"
        )
    data = read(path)
    check_size(data, path)
    format = format or cloud_format_of(data)
    if format in CLOUDS:
        draft = CLOUDS[format](data)
    else:
        text = text_of(data, path)
        format = format or format_of(text)
        if format is None and text.lstrip().startswith("{"):
            raise CalibrationFormatError(
                f"'{path}' is JSON, no taxel file: export writes those of a calibration, fit makes one from a plan"
            )
        if format is None:
            raise CalibrationFormatError(
                f"'{path}' is no taxel file that is known here: a positions file has a line {BLOCK}, a patch or a "
                "robot is XML, a table begins with a header that names x, y and z, a cloud is PLY or "
                "PCD; export it anew, or name its format"
            )
        draft = READERS[format](text)
    taxels, findings = finished(draft, only)
    if taxels is None:
        raise CalibrationFormatError(f"'{path}' has {in_short(findings)}", findings)
    return taxels


def cloud_format_of(data: bytes) -> str | None:
    """The format of a cloud that bytes are, or None."""
    if data.split(b"\n", 1)[0].strip() == MAGIC:
        return "ply"
    return "pcd" if data.startswith(FIRST_LINES) else None


def format_of(text: str) -> str | None:
    """The format that a text is in, or None."""
    if text.lstrip().startswith("<"):
        root = _ELEMENT.search(_COMMENT.sub("", text[:ROOT_SEARCH_LENGTH]))
        return "urdf" if root and root[1] == ROOT else "tum"
    if any(content.strip() == BLOCK for content in text.split("\n")):
        return "icub"
    return "csv" if has_header(text) else None
