"""Common parts of the commands: exit codes, messages, checks of output files, types of options."""

import argparse
import math
import os.path
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ..common.atomic_file import is_same_file
from ..common.errors import OutputError, listed
from ..common.findings import printable

if TYPE_CHECKING:  # it needs NumPy, and --help does not
    from ..common.warnings import Warning

DONE = 0  # Contract: exit code
WRONG_DATA = 1  # Contract: exit code if a file or its content cannot be used
WRONG_CALL = 2  # Contract: exit code of argparse
INTERRUPTED = 130  # Contract: exit code of shells after Ctrl+C
PICTURES = (".png", ".pdf", ".svg", ".jpg")  # endings of pictures


def say(text: str) -> None:
    """Print text on stdout, with control characters escaped: names in a file must not control the terminal."""
    print("\n".join(map(printable, text.split("\n"))))


def say_unused(columns: Sequence[str]) -> None:
    """Print the columns of a table that are not used, if there are any."""
    if columns:
        say(f"columns          not used: {listed(columns)}")


def complain(message: str) -> None:
    """Print a message on one line of stderr, with control characters escaped, if anybody still reads it."""
    with suppress(OSError):  # the end of a reader must not end a controller
        print("skin-calib:", printable(" ".join(message.splitlines())), file=sys.stderr)


def warn(warnings: "Iterable[Warning | str]", which: str = "") -> None:
    """Print each warning with its severity on one line of stderr; a text is a warning."""
    for warning in warnings:
        complain(f"{which}{'warning' if isinstance(warning, str) else warning.severity}: {warning}")


def check_target(target: Path | None, *others: Path | None) -> None:
    """Check an output file before any computation."""
    # os.path: Path.is_dir raises for names that are too long
    if target is not None and not os.path.isdir(target) and not os.path.isdir(target.absolute().parent):
        raise OutputError(f"the folder {target.absolute().parent} for {target.name} does not exist. Create it first.")
    for other in others:
        if target is not None and other is not None and is_same_file(target, other):
            raise OutputError(f"{target} would replace {other}, which the same call uses. Choose another file.")


def check_outputs(options: argparse.Namespace, *inputs: Path | None, replaces: Path | None = None) -> None:
    """Check ``--output`` and ``--picture`` of a call before any computation.

    They replace no input, except that the output may replace ``replaces``, and nothing that the first input names.
    """
    output, picture = getattr(options, "output", None), getattr(options, "picture", None)
    check_target(output, *(path for path in inputs if path != replaces))
    check_target(picture, *inputs, output)
    for target in (output, picture):
        if inputs[0] is not None and target is not None and os.path.isfile(target):
            from ..pipeline.sources import names_file  # it can read meshes and plans

            if names_file(inputs[0], target):
                raise OutputError(f"{target} would replace a file that {inputs[0]} names. Choose another file.")
    check_picture(picture)


def check_picture(target: Path | None) -> None:
    """Check that the name of a picture (None is valid, and a folder) ends as one; raise OutputError if it does not."""
    if target is not None and not os.path.isdir(target) and target.suffix.lower() not in PICTURES:
        raise OutputError(f"{target.name} is not a name for a picture. Use one that ends with {', '.join(PICTURES)}.")


def count(text: str) -> int:
    """Parse an option that is an integer of at least 1."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not an integer of at least 1")
    return int(text)


def names_folder(text: str) -> bool:
    """Return whether a name ends with a slash, which means a folder."""
    return text.endswith(("/", os.sep))


def not_empty(text: str) -> str:
    """Parse a name of a file or folder: an empty one, as of a variable that is not set, would be the current folder."""
    if not text:
        raise argparse.ArgumentTypeError("the name is empty")
    return text


def named_path(text: str) -> Path:
    """Parse an argument that names a file or folder."""
    return Path(not_empty(text))


def file_name(text: str) -> Path:
    """Parse an option that names a file to write: a name that ends with a slash is a folder."""
    if names_folder(text):
        raise argparse.ArgumentTypeError(f"{text!r} ends with a slash, which means a folder. Name a file")
    return named_path(text)


def positive(quantity: str) -> Callable[[str], float]:
    """Return a parser of an option that is a positive number."""

    def parsed(text: str) -> float:
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not 0 < number < math.inf:
            raise argparse.ArgumentTypeError(f"{text!r} is not a positive {quantity}")
        return number

    return parsed


newtons, seconds = positive("force in newtons"), positive("time in seconds")
