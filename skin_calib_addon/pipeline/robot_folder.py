"""The folder of a robot: plans, calibrations, their sources, and ``robot.json``."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ..calibration.file import save_calibration
from ..calibration.robot_set import (
    FILE,
    RobotLink,
    RobotSet,
    UrdfFile,
    changed_urdf,
    load_robot_set,
    robot_file,
    robot_link,
    same_link,
    save_robot_set,
)
from ..calibration.source_record import load_source, save_source
from ..common.errors import CalibrationFormatError, SkinCalibError, listed
from ..common.file_hash import file_hash
from ..plan import Plan, load_plan
from ..robot.link_mesh import is_urdf
from ..robot.urdf import Robot, read_robot
from .calibrate import Calibrated, calibrate
from .sources import add_outputs, relative_path, source_of

FIT_WITH_URDF = "Fit the plans with it: skin-calib fit ROBOT.urdf PLANS -o FOLDER"


def load_with_urdf(path: Path) -> tuple[RobotSet, Path, Robot, list[str]]:
    """Return a robot set, its URDF and what this has, and lines about a URDF that has changed."""
    robot, folder = load_robot_set(path), robot_file(path).parent
    if robot.urdf is None:
        raise SkinCalibError(f"{FILE} names no URDF. {FIT_WITH_URDF}")
    urdf = folder / robot.urdf.file
    return robot, urdf, read_robot(urdf), [f"{FILE}: {finding}" for finding in changed_urdf(robot, folder)]


def save_link(result: Calibrated, plan: Plan, path: Path) -> Path:
    """Write the calibration of a link next to its plan, and record its source, as the command line does."""
    folder = path.parent
    calibration = folder / f"{path.name.removesuffix('.json').removesuffix('.plan')}.calibration.json"
    source = source_of(path, plan, folder)
    made = result.calibration_of(plan)
    save_calibration(made, calibration)
    numbers = {"taxels": result.taxels, "mean": result.mean, "warnings": made.warnings}
    save_source(calibration, add_outputs(source, folder, [calibration], **numbers))
    return calibration


def fit_link(path: str | Path) -> str:
    """Fit a plan, and write the calibration and its sources next to it, for :func:`save_robot`.

    It is a task for any ``concurrent.futures.Executor``, also for one of several machines that see the same folder.

    Parameters
    ----------
    path : path
        Plan file of the link.

    Returns
    -------
    str
        File of the calibration.

    Raises
    ------
    SkinCalibError
        If the plan is not valid, its mesh is missing, or the link cannot be fitted. Nothing is written then.
    """
    plan = load_plan(path)
    return str(save_link(calibrate(plan), plan, Path(path)))


def save_robot(folder: Path, robot: Robot | None, urdf: Path | None) -> str:
    """Write ``robot.json``: all calibrations of a folder. Name, URDF and buses of an earlier one stay.

    Without an argument, the URDF is the mesh of all plans, if it is the same.

    A folder of several calibrations of one link is no robot: without URDF and earlier file, none is written.
    """
    known: dict[tuple[str, str | None], RobotLink] = {}
    lost: list[str] = []
    while True:  # another process may write calibrations and this file, too: the file that stays has to list all
        files = [(path.name, file_hash(path)) for path in sorted(folder.glob("*.calibration.json"))]
        known |= {file: robot_link(folder, file[0]) for file in files if file not in known}
        links = [known[file] for file in files]
        meshes = _meshes_of_records(folder, links)
        before = load_robot_set(folder) if os.path.lexists(folder / FILE) else RobotSet(folder.resolve().name, None, ())
        if not (robot or before.links) and len({link.link for link in links}) < len(links):
            return ""
        if both := same_link({link.calibration: link.link for link in links}):
            raise CalibrationFormatError(f"{both}. Remove one of them, and fit again.")
        if urdf is None and (urdf := _only_urdf(folder, meshes, before)):
            robot = read_robot(urdf)
        now = _updated(before, links, robot)
        if robot and urdf:
            file = UrdfFile(relative_path(folder, urdf), file_hash(urdf) or "")
            now = replace(now, robot=robot.name or urdf.stem, urdf=file)
        if now == before:
            break
        save_robot_set(now, folder)
        lost += (name for link in before.links for name in _lost_buses(link, now))
    if lost:
        return f"{FILE} does not name the bus of {listed(lost)} any more: there are other chains. Write it again."
    urdfs = sorted(mesh for mesh in meshes if is_urdf(Path(mesh)))
    if now.urdf or not urdfs:
        return ""
    which = f"{'only some' if len(urdfs) == 1 else 'its'} links are from {listed(urdfs)}"
    return f"{FILE} names no URDF: {which}. Fit the plans of each robot into a folder of its own."


def _lost_buses(before: RobotLink, now: RobotSet) -> list[str]:
    """Return the chains of a link that have a bus and are not in a later set."""
    kept = {chain for link in now.links if link.link == before.link for chain in link.chains}
    return [
        f"channel {chain.first_channel} of {before.link}" for chain in before.chains if chain.bus and chain not in kept
    ]


def _updated(before: RobotSet, links: Sequence[RobotLink], robot: Robot | None) -> RobotSet:
    """Return a set with other links, whose buses stay; their parents stay, too, without a robot."""
    earlier = {link.link: link for link in before.links}
    return replace(
        before,
        links=tuple(
            replace(
                link,
                parent=robot.parents.get(link.link) if robot else earlier.get(link.link, link).parent,
                bus=earlier.get(link.link, link).bus,
                chains=tuple(
                    next((old for old in earlier.get(link.link, link).chains if replace(old, bus=None) == chain), chain)
                    for chain in link.chains
                ),
            )
            for link in links
        ),
    )


def _meshes_of_records(folder: Path, links: Sequence[RobotLink]) -> set[str]:
    """Return the meshes of links in a folder, by their plans; an empty name if one is not known."""
    records = [load_source(folder / link.calibration) for link in links]
    return {record.mesh if record else "" for record in records}


def _only_urdf(folder: Path, meshes: set[str], before: RobotSet) -> Path | None:
    """Return the URDF that has the meshes of all links; None if an earlier fit had another URDF."""
    mesh = next(iter(meshes)) if len(meshes) == 1 else ""
    is_other = before.urdf is not None and before.urdf.file != mesh
    return folder / mesh if is_urdf(Path(mesh)) and not is_other else None
