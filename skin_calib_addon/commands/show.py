"""``show``: print table and warnings of a calibration or of a whole robot, and draw a picture."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..calibration.file import load_with_warnings
from ..calibration.model import LinkCalibration
from ..calibration.robot_set import FILE, RobotSet, changed_urdf, examined, is_robot
from ..common.errors import CalibrationFormatError, counted
from ..common.findings import Finding, in_short, show
from ..common.strict_json import parse, read
from ..pipeline.report import area_table, covered_area, robot_table, seen_area, table
from ..pipeline.robot_folder import FIT_WITH_URDF
from ..robot.kinematics import link_poses
from ..robot.link_mesh import load_urdf_meshes
from ..robot.urdf import read_robot
from ..runtime import noise_file
from .common import DONE, WRONG_DATA, check_outputs, complain, file_name, named_path, say
from .tare import limits_of


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "file", type=named_path, metavar="FILE", help="calibration or noise file; robot.json, or its folder"
    )
    parser.add_argument(
        "--picture", type=file_name, metavar="PNG", help="picture of surfaces and taxels; of a robot in its zero pose"
    )


def run(options: argparse.Namespace) -> int:
    check_outputs(options, options.file)
    if is_robot(options.file):
        return _show_robot(options)
    try:
        calibration, warnings = load_with_warnings(options.file)
    except CalibrationFormatError:
        document, problems = parse(read(options.file))
        if not (isinstance(document, dict) and document.get("format") == noise_file.FORMAT):
            raise
        return _show_noise(options.file, document, problems or noise_file.check_noise(document))
    say(table(calibration))
    for warning in warnings:
        complain(str(warning))
    if options.picture:
        from ..pictures.calibration import draw_calibration

        draw_calibration(calibration, options.picture)
    return DONE


def _show_noise(file: Path, document: dict[str, Any], findings: Sequence[Finding]) -> int:
    """Print what a tare learned."""
    if findings:
        raise CalibrationFormatError(f"'{file}' is invalid: {in_short(findings)}", tuple(findings))
    noise = noise_file.noise_from(document)
    say(f"link      {document['link']}, {counted(len(document['baseline']), 'taxel')}")
    say(f"of        calibration {document['calibration']}")
    say(f"noise     {'not known' if noise is None else limits_of(noise)}")
    return DONE


def _show_robot(options: argparse.Namespace) -> int:
    robot, folder, calibrations, findings = examined(options.file)
    say(robot_table(robot, calibrations))
    for finding in findings:
        complain(f"{FILE}: {finding}")
    complete = not any(finding.severity == "error" for finding in findings)
    if options.picture:
        complete &= _draw_robot(robot, folder, calibrations, options.picture)
    return DONE if complete else WRONG_DATA


def _draw_robot(robot: RobotSet, folder: Path, calibrations: Mapping[str, LinkCalibration], picture: Path) -> bool:
    """Draw a robot in its zero pose, and print what of each link is covered; return whether all links are drawn."""
    from ..pictures.robot import draw_robot

    if robot.urdf is None:
        complain(f"{FILE} names no URDF, which the picture needs. {FIT_WITH_URDF}")
        return False
    urdf = folder / robot.urdf.file
    content = read_robot(urdf)
    poses = link_poses(content)
    meshes, broken = load_urdf_meshes(urdf, content)
    for finding in changed_urdf(robot, folder):
        complain(f"{FILE}: {finding}")
    problems = [f"{content.file} has no link {show(link)}" for link in calibrations if link not in poses]
    problems += [f"{link} is not in the picture: {problem}" for link, problem in broken.items()]
    for line in problems:
        complain(line)
    known = {link: calibration for link, calibration in calibrations.items() if link in poses}
    covered = {link: covered_area(calibration) for link, calibration in known.items()}
    say(area_table({link: (covered.get(link, 0.0), seen_area(mesh)) for link, mesh in meshes.items()}))
    taxels, area = sum(found.taxel_count for found in known.values()), sum(covered.values())
    title = f"{robot.robot}: skin on {len(known)} of {counted(len(content.links), 'link')}, {counted(taxels, 'taxel')}"
    title += f", {area * 1e4:.0f} cm²"
    draw_robot(meshes, poses, known, title, picture)
    return not problems
