"""What several commands share: exit codes, complaints, what may be written."""

import argparse
import math
import os.path
import sys
from collections.abc import Iterable
from pathlib import Path

from ..calibration.exchange import FORMATS
from ..common.errors import OutputError

DONE, WRONG_DATA, WRONG_CALL = 0, 1, 2


def complain(message: str) -> None:
    """One line on stderr, whatever names the message holds."""
    print("skin-calib:", " ".join(message.splitlines()), file=sys.stderr)


def check_target(target: Path | None, *others: Path | None) -> None:
    """A missing folder is said before anything is computed, and so is a file that would replace one of the others.

    Parameters
    ----------
    target : Path, optional
        What is to be written; None is never wrong.
    *others : Path, optional
        Files that are read, or written besides.

    Raises
    ------
    OutputError
    """
    # os.path, for Path.is_dir raises where a name is too long
    if target is not None and not os.path.isdir(target) and not os.path.isdir(target.absolute().parent):
        raise OutputError(f"no folder {target.absolute().parent} to write {target.name} into; create it first")
    for other in others:
        if target is not None and other is not None and _is_same(target, other):
            raise OutputError(f"{target} would replace {other}, which the same call needs; name another file")


def _is_same(a: Path, b: Path) -> bool:
    """Whether two names are of one file, there or not; folders hold many."""
    if os.path.isdir(a):
        return False
    try:
        return os.path.samefile(a, b)
    except (OSError, ValueError):
        return os.path.realpath(a) == os.path.realpath(b)


def count(text: str) -> int:
    """An option's whole number of 1 or more."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of 1 or more")
    return int(text)


def newtons(text: str) -> float:
    """An option's force, more than nothing."""
    try:
        force = float(text)
    except ValueError:
        force = math.nan
    if not 0 < force < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a force of more than 0 N")
    return force


def listed(formats: Iterable[str]) -> str:
    """Formats of other programs for a ``--help``, a line for each."""
    return "\n".join(("formats:", *(f"  {name:13} {FORMATS[name].what} ({FORMATS[name].ending})" for name in formats)))
