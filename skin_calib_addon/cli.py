"""The command line, with the same commands inside and outside Blender."""

import argparse
import io
import os
import signal
import sys
from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, NoReturn

# Before NumPy: no threads that are not used. Each calculation takes one (`geometry.blas_threads`).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from . import __version__
from .commands.common import DONE, INTERRUPTED, WRONG_CALL, WRONG_DATA, complain
from .common.errors import OutputError, SkinCalibError
from .common.interruptions import handled
from .common.packages import how_to_install

if TYPE_CHECKING:
    from .commands.fit import ScenePlans

# Module in ``commands`` and summary of each command. Only the module of the command that runs is imported.
COMMANDS = {
    "fit": ("fit", "calculate calibration files from plans"),
    "propose": ("propose", "propose a plan for each link of a robot, or for one mesh"),
    "new": ("new", "write a plan with one skin at one place of a link"),
    "check": ("check", "validate calibrations and plans, and compare calibrations with their meshes"),
    "show": ("show", "print table and warnings of a calibration or of the links of a robot, and draw a picture"),
    "diff": ("diff", "compare two calibrations of one link"),
    "export": ("export", "write the taxels of a calibration for another program"),
    "import": ("import_file", "read the taxels of a file of another program"),
    "response": ("response", "fit the responses of the sensors to measurements"),
    "tare": ("tare", "learn baseline and noise from recorded readings without contact"),
    "replay": ("replay", "process recorded readings with the runtime"),
    "run": ("run", "process readings while they arrive, and publish the frames"),
    "touches": ("touches", "compare a calibration with measured touches"),
}

AUTHOR_PACKAGES = ("scipy", "trimesh")  # a controller is installed without them


def main(argv: Sequence[str] | None = None, scene_plans: "ScenePlans | None" = None) -> int:
    """Run one command; return 0 for success, 1 for invalid data, 2 for an invalid call, 130 if interrupted."""
    words = sys.argv[1:] if argv is None else argv
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
            # No option before the command has a value: the first word without a dash is the command.
            chosen = next((word for word in words if not word.startswith("-")), "")
            options = build_parser({chosen}, scene_plans).parse_args(words)
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
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in AUTHOR_PACKAGES:
            raise
        complain(f"this needs {package}, which is not installed here: {how_to_install(package)}")
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


def build_parser(chosen: Iterable[str] = COMMANDS, scene_plans: "ScenePlans | None" = None) -> argparse.ArgumentParser:
    """Build the parser of all commands, with the arguments of the chosen ones; the documentation chooses all."""
    parser = _Parser(prog="skin-calib", description="Spatial calibration of robot tactile skin.")
    parser.add_argument("--version", action="version", version=f"skin-calib {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, (module_name, summary) in COMMANDS.items():
        command = commands.add_parser(name, help=summary)
        if name in chosen:
            module = import_module(f".commands.{module_name}", __package__)
            command.set_defaults(run=module.run, refuse=command.error, scene_plans=scene_plans)
            module.add(command)
    return parser
