"""``export``: write the taxels of a calibration in the format of another program."""

import argparse
import hashlib
import os
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from ..calibration.exchange import FORMATS, WRITABLE, listed, only_patches
from ..calibration.exchange.usd import BINARY_USD
from ..calibration.file import load_calibration
from ..calibration.model import LinkCalibration
from ..calibration.robot_set import (
    FILE,
    UrdfFile,
    examined,
    is_robot,
    load_links,
    robot_bytes,
    robot_file,
)
from ..common.atomic_file import check_writable, make_folder, write_bytes_safely, write_folder_safely
from ..common.errors import OutputError, counted
from ..common.strict_json import read
from ..common.warnings import Warning, worst_first
from ..pipeline.robot_folder import load_with_urdf
from ..robot.mjcf import MARK, RobotModel, robot_mjcf
from .common import (
    DONE,
    WRONG_DATA,
    check_outputs,
    check_target,
    complain,
    named_path,
    names_folder,
    not_empty,
    say,
    warn,
)

ROBOT_FORMATS = ("mjcf", "newton")  # the formats of a whole robot
PATTERN = "pattern"  # the format of paper: a picture, not of a program
ROS_PACKAGE = "ros-package"  # the format of ROS 2: a folder


def add(parser: argparse.ArgumentParser) -> None:
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = (
        f"{listed(WRITABLE)}\n  {PATTERN:13} sheets on paper, 1:1 (.svg, .pdf)\n"
        f"  {ROS_PACKAGE:13} ROS 2: description, layout, view (a folder with two packages)"
    )
    parser.add_argument(
        "file",
        type=named_path,
        metavar="FILE",
        help=f"calibration file; robot.json, or its folder, as mjcf, newton or {ROS_PACKAGE}",
    )
    formats = (*WRITABLE, PATTERN, ROS_PACKAGE)
    parser.add_argument("--to", required=True, choices=formats, metavar="FORMAT", help="one of the formats below")
    help = f"file to write; with {ROS_PACKAGE} a folder"
    parser.add_argument("-o", "--output", required=True, type=not_empty, metavar="OUT", help=help)
    parser.add_argument("--free-base", action="store_true", help="robot: it moves freely instead of being fixed")
    parser.add_argument("--actuators", action="store_true", help="robot: a motor for each joint, with its effort")
    parser.add_argument(
        "--patch", action="append", default=[], metavar="NAME", help="write only this patch; can be repeated"
    )


def run(options: argparse.Namespace) -> int:
    if names_folder(options.output) and options.to != ROS_PACKAGE:
        options.refuse(f"{options.output!r} ends with a slash, which means a folder. Name a file")
    options.output = Path(options.output)
    check_outputs(options, options.file)
    if options.to == ROS_PACKAGE:
        return _export_ros_package(options)
    check_writable(options.output)
    if is_robot(options.file):
        return _export_robot(options)
    if options.free_base or options.actuators:
        raise OutputError("--free-base and --actuators are for a robot. Name robot.json, or its folder.")
    calibration = load_calibration(options.file)
    if options.patch:
        calibration = only_patches(calibration, options.patch)
    if options.to == PATTERN:
        from ..pictures.pattern import ENDINGS, write_pattern

        if (ending := options.output.suffix.lower()) not in ENDINGS:
            raise OutputError(f"{options.output.name}: a pattern is written as {' or '.join(ENDINGS)}.")
        what, labels, content = "sheets on paper, 1:1", "the id", write_pattern(calibration, ending)
    else:
        if options.to == "usd" and options.output.suffix.lower() in BINARY_USD:
            raise OutputError(f"{options.output.name}: USD is written as text. Name it .usda or .usd.")
        format = FORMATS[options.to]
        what, labels, content = format.what, format.labels, format.write(calibration)
    write_bytes_safely(options.output, content)
    for line in _of_fit(calibration):
        complain(line)
    taxels, patches = calibration.taxel_count, len(calibration.patches)
    say(f"{options.output}: {what}, {taxels} taxels in {patches} patches; ids in the file: {labels}")
    return DONE


def _export_robot(options: argparse.Namespace) -> int:
    """Write the model of a robot with all skins, and its meshes to a folder next to it."""
    if options.to not in ROBOT_FORMATS or options.patch:
        names = " or ".join(ROBOT_FORMATS)
        raise OutputError(f"A robot is exported as {names}, with all patches. For others, name a calibration.")
    robot, urdf, content, outdated = load_with_urdf(options.file)
    _, folder, calibrations, findings = examined(options.file)
    problems = [f"{FILE}: {finding}" for finding in findings if finding.severity == "error"]
    mesh_folder = options.output.with_name(f"{options.output.stem}_meshes")
    how = options.free_base, options.actuators, options.to == "mjcf"
    model = robot_mjcf(content, urdf, calibrations, mesh_folder.name, *how)
    inputs = [robot_file(options.file), urdf, *(folder / link.calibration for link in robot.links), *model.sources]
    check_target(options.output, *inputs)
    for name in model.meshes:
        _check_mesh_file(mesh_folder / name, inputs)
    of_fits = [line for calibration in calibrations.values() for line in _of_fit(calibration)]
    for line in (*problems, *outdated, *of_fits, *model.problems):
        complain(line)
    make_folder(mesh_folder)
    for name, data in model.meshes.items():
        write_bytes_safely(mesh_folder / name, data)
    write_bytes_safely(options.output, model.text)
    known = [calibration for link, calibration in calibrations.items() if link in content.links]
    taxels = sum(calibration.taxel_count for calibration in known)
    say(
        f"{options.output}: {robot.robot} with {counted(taxels, 'taxel')} on {counted(len(known), 'link')}; "
        f"{len(model.meshes)} mesh files in {mesh_folder.name}; sensors are named LINK/ID"
    )
    _say_changes(model)
    return WRONG_DATA if problems or model.problems or model.dead else DONE


def _say_changes(model: RobotModel) -> None:
    """Print what differs from the URDF, and which taxels feel no press."""
    if model.uncovered:
        say(f"collision shapes that would hide skin are switched off: {', '.join(model.uncovered)}")
    for (link, other), count in model.covered.items():
        complain(
            f"warning: {counted(count, 'taxel')} of {link} {'is' if count == 1 else 'are'} below the collision shape "
            f"of {other} in the zero pose: no press is felt there"
        )
    for line in model.dead:
        complain(line)
    if model.assumed:
        say(
            "the URDF does not state the mass and inertia of moving links, or of links that are fixed to them; "
            f"MuJoCo assumed {', '.join(model.assumed)}. Write them in the URDF before a simulation"
        )
    if model.balanced:
        say(
            "no rigid body has the inertia that the URDF states; the model has the nearest possible: "
            f"{', '.join(model.balanced)}"
        )


def _export_ros_package(options: argparse.Namespace) -> int:
    """Write a ROS 2 package with the skins of a robot, or of a link, and the one with the messages."""
    from ..messages.definitions import PACKAGE
    from ..messages.ros_package import URDF, package_files, package_name
    from ..robot.ros_urdf import with_taxels

    if options.free_base or options.actuators or options.patch:
        raise OutputError(f"{ROS_PACKAGE} has no other options: the package has all patches.")
    depends, warnings = tuple[str, ...](), tuple[Warning, ...]()
    outdated, problems = list[str](), list[str]()
    if not is_robot(options.file):
        calibration = load_calibration(options.file)
        name, root, calibrations = package_name(calibration.link), calibration.link, {calibration.link: calibration}
        files = {URDF: FORMATS["urdf"].write(calibration), f"calibration/{options.file.name}": read(options.file)}
    else:
        robot, urdf, content, outdated = load_with_urdf(options.file)
        assert robot.urdf is not None
        calibrations, warnings = load_links(options.file)
        problems += [
            f"error: {link} is not a link of {content.file}: the description has no frames of its taxels"
            for link in calibrations
            if link not in content.links
        ]
        name, root = package_name(robot.robot), content.root
        calibrations = {link: own for link, own in calibrations.items() if own.taxel_count}
        known = {link: calibration for link, calibration in calibrations.items() if link in content.links}
        described = with_taxels(urdf, content, known, name)
        problems, depends = [*problems, *described.problems], described.packages
        # With the former hash, "check" repeats in the package that the URDF has changed.
        now = robot.urdf.sha256 if outdated else hashlib.sha256(described.text).hexdigest()
        moved = replace(robot, urdf=UrdfFile(f"../{URDF}", now))
        files = {URDF: described.text, **described.meshes, f"calibration/{FILE}": robot_bytes(moved)}
        folder = robot_file(options.file).parent
        files |= {f"calibration/{link.calibration}": read(folder / link.calibration) for link in robot.links}
    write_folder_safely(options.output, package_files(name, root, calibrations, files, depends))
    warn(warnings)
    of_fits = [line for calibration in calibrations.values() for line in _of_fit(calibration)]
    for line in (*outdated, *problems, *of_fits):
        complain(line)
    taxels = sum(calibration.taxel_count for calibration in calibrations.values())
    what = f"{counted(taxels, 'taxel')} on {counted(len(calibrations), 'link')}"
    say(f"{options.output}: ROS 2 packages {PACKAGE} and {name}, {what}; build them with colcon")
    if depends:
        say(f"meshes are in other packages: {', '.join(depends)}")
    return WRONG_DATA if problems else DONE


def _of_fit(calibration: LinkCalibration) -> Iterator[str]:
    """Yield a line if the fit of a calibration had warnings, which the formats of other programs do not have."""
    found = worst_first(warning for warning in calibration.warnings if warning.severity != "note")
    if found:
        yield (
            f"{found[0].severity}: {calibration.link}: the calibration states {counted(len(found), 'warning')}, "
            f"the worst: {found[0]}"
        )


def _check_mesh_file(target: Path, inputs: Iterable[Path]) -> None:
    """Check that a mesh of the model replaces no mesh of the robot, and no file that another program wrote."""
    if not os.path.exists(target):
        return
    check_target(target, *inputs)
    check_writable(target)
    with open(target, "rb") as file:
        is_ours = file.read(len(MARK)) == MARK
    if not is_ours:
        raise OutputError(f"{target} exists, and is not of an earlier export. Choose another name for the model.")
