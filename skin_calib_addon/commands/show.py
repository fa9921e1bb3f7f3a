"""``show``: print table and warnings of a calibration or of a whole robot, and draw a picture."""

import argparse
from pathlib import Path

from ..calibration.file import load_with_warnings
from ..calibration.robot_set import calibrations_of, is_robot, load_robot_set, robot_file
from ..common.errors import OutputError
from ..pipeline.report import robot_table, table
from .common import DONE, WRONG_DATA, check_picture, check_target, complain, say


def add(commands) -> None:
    show = commands.add_parser(
        "show", help="print table and warnings of a calibration or of the links of a robot, and draw a picture"
    )
    show.add_argument("file", type=Path, metavar="FILE", help="calibration file; robot.json, or its folder")
    show.add_argument("--picture", type=Path, metavar="PNG", help="picture of surfaces and taxels")
    show.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    check_target(options.picture, options.file)
    check_picture(options.picture)
    if is_robot(options.file):
        return _show_robot(options)
    calibration, warnings = load_with_warnings(options.file)
    say(table(calibration))
    for warning in warnings:
        complain(str(warning))
    if options.picture:
        from ..pictures.calibration import draw_calibration

        draw_calibration(calibration, options.picture)
    return DONE


def _show_robot(options: argparse.Namespace) -> int:
    if options.picture:
        raise OutputError("--picture draws one link. Specify its calibration file.")
    robot = load_robot_set(options.file)
    calibrations, findings = calibrations_of(robot, robot_file(options.file).parent)
    say(robot_table(robot, calibrations))
    for finding in findings:
        complain(str(finding))
    return WRONG_DATA if any(finding.severity == "error" for finding in findings) else DONE
