"""Read the taxels of a file, whatever program wrote it."""

import os
from collections.abc import Callable

from ...errors import CalibrationFormatError
from ..findings import Finding, did_you_mean
from .icub import BLOCK, read_icub
from .table import has_header, read_table
from .taxel_set import Draft, TaxelSet, finished
from .text import read_text
from .tum import read_tum

READERS: dict[str, Callable[[str], Draft]] = {"icub": read_icub, "tum": read_tum, "csv": read_table}
FORMATS = tuple(READERS)


def read_taxels(path: str | os.PathLike[str], format: str | None = None) -> TaxelSet:
    """Read a file of taxels as it is: nothing is moved, turned round or made up.

    Parameters
    ----------
    path : path
    format : one of `FORMATS`, optional
        Else the content tells.

    Raises
    ------
    CalibrationFormatError
        If the file cannot be read, or anything in it makes it unusable; ``findings`` has everything found.
    """
    if format is not None and format not in READERS:
        known = ", ".join(FORMATS)
        raise CalibrationFormatError(
            f"no format '{format}' of taxels; use one of {known}{did_you_mean(format, FORMATS)}"
        )
    text = read_text(path)
    format = format or format_of(text)
    if format is None:
        raise CalibrationFormatError(
            f"'{path}' is no taxel file that is known here: a positions file has a line {BLOCK}, a patch is XML, a "
            "table begins with a header that names x, y and z; export it anew, or name its format"
        )
    taxels, findings = finished(READERS[format](text))
    if taxels is None:
        raise _refusal(path, findings)
    return taxels


def format_of(text: str) -> str | None:
    """The format that a text is in, or None."""
    if text.lstrip().startswith("<"):
        return "tum"
    if any(content.strip() == BLOCK for content in text.split("\n")):
        return "icub"
    return "csv" if has_header(text) else None


def _refusal(path: str | os.PathLike[str], findings: tuple[Finding, ...]) -> CalibrationFormatError:
    errors = [finding for finding in findings if finding.severity == "error"]
    count = "one" if len(errors) == 1 else f"{len(errors)} errors; the first"
    return CalibrationFormatError(f"'{path}' has {count} {errors[0]}", findings)
