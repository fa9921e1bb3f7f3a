"""The command line, with the same commands inside and outside Blender."""

import argparse
import io
import os
import signal
import sys
from collections.abc import Sequence
from typing import NoReturn

# Before NumPy: no threads that are not used. Each calculation takes one (`geometry.blas_threads`).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from . import __version__
from .commands import check, export, fit, import_file, propose, replay, response, show, touches
from .commands.common import DONE, INTERRUPTED, WRONG_CALL, WRONG_DATA, complain
from .common.errors import OutputError, SkinCalibError
from .common.interruptions import handled


def main(argv: Sequence[str] | None = None, scene_plans: fit.ScenePlans | None = None) -> int:
    """Run one command."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the caller, as with ">&-"
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"))
    if isinstance(
        sys.stdout, io.TextIOWrapper
    ):  # names of links may have characters outside the encoding of the terminal
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        # What batch systems and "timeout" send keeps results as Ctrl+C does.
        with handled(signal.default_int_handler, signal.SIGTERM):
            options = build_parser(scene_plans).parse_args(argv)
            code = options.run(options)
            sys.stdout.flush()
            return code
    except BrokenPipeError:  # the reader has closed the pipe, as "| head" does
        _silence_stdout()
        return DONE
    except OSError as error:  # stdout cannot be written; files raise OutputError
        _silence_stdout()
        complain(f"writing the output failed: {error}. Check where it is written.")
        return WRONG_CALL
    except KeyboardInterrupt:
        complain("interrupted. Files that were not finished are not written.")
        return INTERRUPTED
    except MemoryError:
        complain("There is not enough memory. Close other programs, or reduce the size of the input.")
        return WRONG_DATA
    except (OutputError, SkinCalibError) as error:
        complain(str(error))
        return WRONG_CALL if isinstance(error, OutputError) else WRONG_DATA


def _silence_stdout() -> None:
    """Redirect stdout to nowhere, because its buffer would cause another error at the end of the program."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _Parser(argparse.ArgumentParser):
    """Argument parser whose errors are one line that refers to ``--help``."""

    def error(self, message: str) -> NoReturn:
        self.exit(WRONG_CALL, f"{self.prog}: {' '.join(message.splitlines())}; see {self.prog} --help\n")


def build_parser(scene_plans: fit.ScenePlans | None = None) -> argparse.ArgumentParser:
    """Build the parser of all commands; the documentation uses it, too."""
    parser = _Parser(prog="skin-calib", description="Spatial calibration of robot tactile skin.")
    parser.add_argument("--version", action="version", version=f"skin-calib {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    fit.add(commands, scene_plans)
    for command in (propose, check, show, export, import_file, response, replay, touches):
        command.add(commands)
    return parser
