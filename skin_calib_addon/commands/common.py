"""What several commands share: exit codes, complaints, folders."""

import argparse
import math
import os.path
import sys
from collections.abc import Iterable
from pathlib import Path

from ..calibration.exchange import FORMATS
from ..errors import OutputError

DONE, WRONG_DATA, WRONG_CALL = 0, 1, 2


def complain(message: str) -> None:
    """One line on stderr, whatever names the message holds."""
    print("skin-calib:", " ".join(message.splitlines()), file=sys.stderr)


def check_folder(target: Path | None) -> None:
    """A missing folder is said before anything is computed."""
    # os.path, for Path.is_dir raises where a name is too long
    if target is not None and not os.path.isdir(target) and not os.path.isdir(target.absolute().parent):
        raise OutputError(f"no folder {target.absolute().parent} to write {target.name} into; create it first")


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
