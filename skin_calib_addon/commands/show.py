"""``show``: print table and warnings of a calibration, and draw a picture."""

import argparse
from pathlib import Path

from ..calibration.file import load_with_warnings
from ..pipeline.report import table
from .common import DONE, check_picture, check_target, complain, say


def add(commands) -> None:
    show = commands.add_parser("show", help="print table and warnings of a calibration, and draw a picture")
    show.add_argument("file", type=Path, metavar="FILE", help="calibration file")
    show.add_argument("--picture", type=Path, metavar="PNG", help="picture of surfaces and taxels")
    show.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    check_target(options.picture, options.file)
    check_picture(options.picture)
    calibration, warnings = load_with_warnings(options.file)
    say(table(calibration))
    for warning in warnings:
        complain(str(warning))
    if options.picture:
        from ..pictures.calibration import draw_calibration

        draw_calibration(calibration, options.picture)
    return DONE
