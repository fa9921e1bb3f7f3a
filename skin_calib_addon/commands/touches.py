"""``touches``: compare a calibration with measured touches, and refine the poses of its skins."""

import argparse
from collections.abc import Iterator
from pathlib import Path

from ..calibration.file import load_calibration
from ..calibration.model import LinkCalibration
from ..calibration.robot_set import is_robot
from ..common.errors import InvalidPlan
from ..common.strict_json import parse, read
from ..common.tables import has_columns
from ..common.warnings import Warning
from ..inspection.touch_file import read_touch_file
from ..pipeline import calibrate
from ..pipeline.refine import refine
from ..pipeline.sources import mesh_of
from ..pipeline.touch_distance import check_touches
from ..plan import FORMAT, load_plan, named_from, save_plan
from ..robot.link_mesh import load_plan_mesh
from ..validation import Directions, Placement, Touches, directions_of, placements, summarize
from ..validation.gravity import ACCELERATION, read_orientations, rotated
from .common import DONE, check_outputs, file_name, named_path, not_empty, say, say_unused, warn


def add(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "TOUCHES is a CSV file. Each row has the taxel (or channel) with the largest reading, or the readings of all "
        "taxels in columns with their ids, and the position x, y, z of the probe [m] or the wrench fx, fy, fz, tx, ty, "
        "tz of a force-torque sensor [N, N m], in the link frame. Or it has the pose of a tool (tool_x to tool_qw) in "
        "the link frame, or those of tool and link (link_x to link_qw) in the world, and a comment # tool: FILE UNIT "
        "with the mesh of the tool. The columns time [s] or press state which rows are one press. Or it is an MCAP "
        "file with SkinReading, and with WrenchStamped or PointStamped in the link frame. Or it has what "
        "accelerometers of taxels measure at rest: ax, ay, az [m/s^2] in the axes of the taxel, and the direction of "
        "gravity gx, gy, gz in the link frame. For robot.json, TOUCHES are those of the robot on itself: the angles of "
        "its joints [rad], the tip that touched, and the taxels that felt it."
    )
    parser.add_argument("file", type=named_path, metavar="FILE", help="calibration or plan; robot.json, or its folder")
    parser.add_argument("touches", type=named_path, metavar="TOUCHES", help="CSV or MCAP file of measured touches")
    parser.add_argument(
        "--refine", action="store_true", help="move the skins of the plan to the positions of the touches"
    )
    parser.add_argument(
        "-o", "--output", type=not_empty, metavar="OUT", help="refined plan; for a robot, folder of its moved skins"
    )
    parser.add_argument("--picture", type=file_name, metavar="PNG", help="picture of the touches and their cells")


def run(options: argparse.Namespace) -> int:
    if options.refine != (options.output is not None):
        options.refuse("--refine and -o OUT belong together: specify both or neither")
    if is_robot(options.file):
        from .touches_robot import run as run_robot  # it needs the robot

        return run_robot(options, Path(options.output) if options.output else None)
    try:
        options.output = file_name(options.output) if options.output else None
    except argparse.ArgumentTypeError as problem:
        options.refuse(f"argument -o/--output: {problem}")
    check_outputs(options, options.file, options.touches, replaces=options.file)
    is_plan = _is_plan(options.file)
    if options.refine and not is_plan:
        raise InvalidPlan(
            f"--refine needs the plan file, but '{options.file}' is not a plan. Specify the plan of the calibration."
        )
    plan = load_plan(options.file) if is_plan else None
    result = calibrate(plan) if plan else None
    calibration = result.calibration if result else load_calibration(options.file)
    if has_columns(options.touches, ACCELERATION):
        if options.refine or options.picture:
            options.refuse("accelerations show the orientation of taxels; --refine and --picture need touches")
        return _orientations(options.touches, calibration)
    touches = read_touch_file(
        options.touches, calibration, lambda: load_plan_mesh(plan) if plan else mesh_of(options.file, calibration)
    )
    check_touches(calibration, touches)
    found = placements(calibration, touches)
    directions, _ = directions_of(calibration, touches)
    _say_touches(calibration, touches, directions)
    _report(found)
    of_fit = result.warnings if result else ()
    warn((*of_fit, *_warnings(touches, directions, found)))
    if options.refine and plan and result:
        refined = refine(plan, result, touches)
        found = refined.placements
        save_plan(named_from(refined.plan, options.output.absolute().parent), options.output)
        say(f"plan             {options.output}; after the refinement:")
        _report(found)
        warn(warning for warning in refined.calibration.warnings if warning not in of_fit)
    if options.picture:
        from ..pictures.touches import draw_touches  # matplotlib is optional

        draw_touches(found, options.picture, directions)
    return DONE


def _say_touches(calibration: LinkCalibration, touches: Touches, directions: Directions | None) -> None:
    """Print what was touched, and what the forces and the tool say."""
    say(f"link             {calibration.link}, {calibration.taxel_count} taxels")
    rows = f" in {touches.rows} rows" if touches.rows != len(touches.taxels) else ""
    say(f"touches          {len(touches.taxels)}{rows}, of {len(set(touches.taxels))} taxels")
    say_unused(touches.unused)
    warn(touches.notes)
    if directions:
        say(f"forces           {directions.summary()}")
    for name, line in touches.tool.summary() if touches.tool else ():
        say(f"{name:16} {line}")


def _warnings(touches: Touches, directions: Directions | None, found: list[Placement]) -> Iterator[Warning]:
    """Yield the warnings about the tool, the forces and the patches."""
    if touches.tool:
        yield from touches.tool.warnings()
    if directions:
        yield from directions.warnings(not any(placement.wiring.order.words for placement in found))
    for placement in found:
        yield from placement.warnings()


def _orientations(path: Path, calibration: LinkCalibration) -> int:
    """Print the orientation of taxels by their accelerometers."""
    found = read_orientations(path, calibration)
    warn(rotated(found))
    say(f"link             {calibration.link}, {len(found)} of {calibration.taxel_count} taxels with an accelerometer")
    for one in found:
        say(one.summary())
    return DONE


def _is_plan(path: Path) -> bool:
    document, _ = parse(read(path))
    return isinstance(document, dict) and document.get("format") == FORMAT


def _report(found: list[Placement]) -> None:
    """Print a few lines for each patch."""
    for placement in found:
        for line in summarize(placement):
            say(f"{placement.patch.name:16} {line}")
