"""``touches`` for a robot that touches itself: errors of its joints, tips and skins."""

import argparse
import json
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..calibration.file import save_calibration
from ..calibration.model import LinkCalibration
from ..calibration.robot_set import (
    FILE,
    RobotSet,
    calibrations_of,
    load_links,
    robot_file,
    save_robot_set,
)
from ..common.atomic_file import check_writable, make_folder, write_bytes_safely
from ..common.errors import CalibrationFormatError, OutputError, counted
from ..common.file_hash import file_hash
from ..pipeline.robot_folder import load_with_urdf
from ..pipeline.self_touch import moved_skins
from ..pipeline.sources import relative_path
from ..robot.urdf import Joint
from ..validation.next_self_touch import next_touches
from ..validation.self_touch import SelfTouch, fit_self_touch
from ..validation.self_touch_session import read_session
from .common import DONE, complain, say, say_unused, warn

OFFSETS = "joint_offsets.json"  # Contract: name of the file
NEXT_TOUCHES = 3  # that are printed


def run(options: argparse.Namespace, output: Path | None) -> int:
    """Compare a robot with touches of itself, and write its moved skins to another folder."""
    if options.picture:
        raise OutputError("--picture is for touches of one link. Leave it out.")
    folder = robot_file(options.file).parent
    robot, urdf, model, outdated = load_with_urdf(options.file)
    if output is not None:
        _check_folder(output, folder)
    calibrations, of_set = load_links(options.file)
    for line in outdated:
        complain(line)
    session = read_session(options.touches, model, calibrations)
    found = fit_self_touch(model, session)
    count = sum(calibration.taxel_count for calibration in calibrations.values())
    say(f"robot            {robot.robot}, {counted(len(calibrations), 'link')} with skin, {count} taxels")
    rows = f" in {session.rows} rows" if session.rows != len(session.lines) else ""
    say(f"touches          {len(session.lines)}{rows}")
    say_unused(session.unused)
    for name, line in found.summary():
        say(f"{name:16} {line}")
    for touch in next_touches(found, NEXT_TOUCHES):
        angles = ", ".join(f"{name} {_shown(value, model.joints[name])}" for name, value in touch.positions.items())
        say(f"touch next       {touch.tip.name} at {touch.link}/{touch.taxel}: {angles}")
    warn((*of_set, *found.warnings()))
    if output is None:
        return DONE
    if not found.is_explained:
        raise CalibrationFormatError(
            f"{int(found.unexplained.sum())} of {len(found.unexplained)} touches are far from where they were felt. "
            "Check the channels of the taxels, the tip and the angles. Nothing was written."
        )
    _write(robot, folder, urdf, moved_skins(found, calibrations), found, output)
    say(f"skins            moved in {output}, with {OFFSETS}")
    return DONE


def _shown(position: float, joint: Joint) -> str:
    """Return the position of a joint with its unit."""
    return f"{position * 1e3:.1f} mm" if joint.type == "prismatic" else f"{np.rad2deg(position):.1f} deg"


def _check_folder(output: Path, folder: Path) -> None:
    """Check that the output is another folder."""
    if os.path.exists(output) and (not os.path.isdir(output) or os.path.samefile(output, folder)):
        raise OutputError(f"{output} is a file, or the folder of the robot. Name another folder for the moved skins.")
    if not os.path.isdir(output.absolute().parent):
        raise OutputError(f"the folder {output.absolute().parent} for {output.name} does not exist. Create it first.")


def _write(
    robot: RobotSet, folder: Path, urdf: Path, moved: Mapping[str, LinkCalibration], found: SelfTouch, output: Path
) -> None:
    """Write all calibrations, ``robot.json`` and the offsets of the joints to a folder."""
    make_folder(output)
    for name in (*(link.calibration for link in robot.links), FILE, OFFSETS):
        check_writable(output / name)
    calibrations, _ = calibrations_of(robot, folder)
    for link in robot.links:
        save_calibration(moved.get(link.link, calibrations[link.link]), output / link.calibration)
    links = tuple(replace(link, sha256=file_hash(output / link.calibration) or "") for link in robot.links)
    assert robot.urdf is not None
    save_robot_set(replace(robot, urdf=replace(robot.urdf, file=relative_path(output, urdf)), links=links), output)
    write_bytes_safely(output / OFFSETS, (json.dumps(found.offsets(), indent=2) + "\n").encode())
