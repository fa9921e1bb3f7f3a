"""The command line, the same words inside and outside Blender."""

import argparse
import io
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from . import __version__
from .commands import check, export, fit, import_file, replay, response, show, touches
from .commands.common import DONE, WRONG_CALL, WRONG_DATA, complain
from .common.errors import OutputError, SkinCalibError


def main(argv: Sequence[str] | None = None, scene_plans: fit.ScenePlans | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    argv : sequence of str, optional
        Without the program's name; None takes the process's own.
    scene_plans : callable, optional
        Where a scene is open: ``fit`` without a plan file fits its links.

    Returns
    -------
    int
        0 done, 1 the data is wrong, 2 the call is wrong. Errors are one line each on stderr.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by whoever called, as with ">&-"
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"))
    if isinstance(sys.stdout, io.TextIOWrapper):  # a link's name may have letters that a terminal's encoding lacks
        sys.stdout.reconfigure(errors="backslashreplace")
    options = build_parser(scene_plans).parse_args(argv)
    try:
        code = options.run(options)
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # whoever reads has seen enough, as with "| head"
        _silence_stdout()
        return DONE
    except OSError as error:  # files say for themselves what they cannot
        _silence_stdout()
        complain(f"the system refuses: {error}; see where the output goes")
        return WRONG_CALL
    except MemoryError:
        complain("there is not enough memory for this; close other programs, or make the input smaller")
        return WRONG_DATA
    except (OutputError, SkinCalibError) as error:
        complain(str(error))
        return WRONG_CALL if isinstance(error, OutputError) else WRONG_DATA


def _silence_stdout() -> None:
    """What is left to be written would fail once more at the end of the program."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _Parser(argparse.ArgumentParser):
    """Says what is wrong with a call in one line; the usage is a ``--help`` away."""

    def error(self, message: str) -> NoReturn:
        self.exit(WRONG_CALL, f"{self.prog}: {' '.join(message.splitlines())}; see {self.prog} --help\n")


def build_parser(scene_plans: fit.ScenePlans | None = None) -> argparse.ArgumentParser:
    """Build the parser of all commands; the documentation reads it, too."""
    parser = _Parser(prog="skin-calib", description="Spatial calibration of robot tactile skin.")
    parser.add_argument("--version", action="version", version=f"skin-calib {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    fit.add(commands, scene_plans)
    for command in (check, show, export, import_file, response, replay, touches):
        command.add(commands)
    return parser
