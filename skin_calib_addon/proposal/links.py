"""Propose plans for the links of a robot, one by one: the same for each interface."""

import re
import traceback
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from ..common.errors import SkinCalibError
from ..geometry.mesh.triangle_mesh import TriangleMesh, load_mesh
from ..plan import Plan
from ..robot.keep_out import KeepOut
from ..robot.link_mesh import is_urdf, load_urdf_mesh, load_urdf_meshes
from ..robot.mirrored import Twin, find_twins
from ..robot.urdf import Robot, read_robot
from .proposal import Proposal, joint_axes, propose_link, propose_twin
from .skins import SkinChoice

MAX_NAME_LENGTH = 100  # characters of a link in the name of its file. Larger: file systems may refuse the names.


@dataclass(frozen=True)
class Task:
    """A link to propose a plan for."""

    file: Path  # of the robot or the mesh
    unit: str
    link: str
    choice: SkinChoice
    mesh: TriangleMesh | None = None  # [m]; None to read it from the file


@dataclass(frozen=True, eq=False)
class Outcome:
    """A proposal, or what failed."""

    task: Task
    proposal: Proposal | None = None
    problem: str = ""
    trace: str = ""  # of an unexpected error


def propose_task(task: Task, begin: Callable[[str], None] = lambda stage: None) -> Outcome:
    """Propose the plan of one link; an unexpected error becomes its outcome.

    Parameters
    ----------
    task : Task
        The link.
    begin : function, optional
        Called with the name of each stage.
    """
    try:
        file = task.file.absolute()
        if not is_urdf(task.file):
            mesh = load_mesh(task.file, task.unit) if task.mesh is None else task.mesh
            return Outcome(task, propose_link(task.link, mesh, file, task.unit, task.choice, begin=begin))
        begin("robot")
        robot = robot_of(task.file)
        twin = robot.twins.get(task.link)
        if twin is not None:
            former = own_proposal(replace(task, link=twin.link, mesh=None), begin)
            mesh = load_urdf_mesh(task.file, task.link) if task.mesh is None else task.mesh
            found = propose_twin(former, twin, task.link, mesh, file, task.choice, robot.keep_out, begin)
            if found is not None:
                return Outcome(task, found)
        return Outcome(task, own_proposal(task, begin))
    except SkinCalibError as problem:
        return Outcome(task, None, str(problem))
    except MemoryError:
        return Outcome(task, None, "There is not enough memory. Reduce --jobs, or use a coarser mesh.")
    except Exception as error:
        text = f"unexpected error in the program, please report it: {type(error).__name__}: {error}"
        return Outcome(task, None, text, traceback.format_exc())


def groups(tasks: Sequence[Task]) -> list[list[Task]]:
    """Return the tasks in groups with common work: a link of a robot, and those that are like it.

    Those with the most faces come first, so that no process is still busy with one of them in the end.
    """
    found: dict[str, list[Task]] = {}
    for task in tasks:
        twin = robot_of(task.file).twins.get(task.link) if is_urdf(task.file) else None
        found.setdefault(task.link if twin is None else twin.link, []).append(task)
    return sorted(found.values(), key=lambda group: -sum(_face_count(task) for task in group))


def _face_count(task: Task) -> int:
    return robot_of(task.file).face_counts.get(task.link, 0) if is_urdf(task.file) else 0


def propose_group(tasks: Sequence[Task]) -> list[Outcome]:
    """Propose the plans of some links, one after the other."""
    return [propose_task(task) for task in tasks]


def plan_path(folder: Path, link: str) -> Path:
    """Return the path of the plan of a link in a folder.

    A name that is too long for a file, or has characters that files cannot have, gets a checksum: other links then have
    other files.
    """
    name = re.sub(r"[^\w.-]+", "_", link)[:MAX_NAME_LENGTH]
    if name != link:
        name += f"_{zlib.crc32(link.encode()):08x}"
    return folder / f"{name}.plan.json"


def numbered(plan: Plan, channel: int) -> Plan:
    """Return a plan whose channels start at a number.

    Parameters
    ----------
    plan : Plan
        Of a proposal; its later skins continue the channels of the first.
    channel : int
        Of the first taxel.
    """
    first, *others = plan.skins
    return replace(plan, skins=(replace(first, first_channel=channel), *others))


@dataclass(frozen=True, eq=False)
class WholeRobot:
    """A robot, what its links cover of each other, and which are mirror images."""

    robot: Robot
    keep_out: KeepOut
    twins: Mapping[str, Twin]
    face_counts: Mapping[str, int]
    proposals: dict[tuple[str, SkinChoice], Proposal]  # of links that others are like; grows


@lru_cache(maxsize=1)
def robot_of(urdf: Path) -> WholeRobot:
    """Return what all links have in common. A link without mesh covers nothing.

    The last robot is kept. If its files can have changed, call ``robot_of.cache_clear()`` first.
    """
    robot = read_robot(urdf)
    meshes = load_urdf_meshes(urdf, robot)[0]  # problems are reported for the link itself
    found = find_twins(robot, meshes)
    twins = {link: twin for link, twin in found.items() if twin.link not in found}
    face_counts = {link: len(mesh.faces) for link, mesh in meshes.items()}
    return WholeRobot(robot, KeepOut(robot, meshes), twins, face_counts, {})


def own_proposal(task: Task, begin: Callable[[str], None]) -> Proposal:
    """Return the proposal of a link of a robot that does not follow that of a mirrored one.

    Parameters
    ----------
    task : Task
        The link.
    begin : function
        Called with the name of each stage.
    """
    whole = robot_of(task.file)
    key = task.link, task.choice
    if task.mesh is None and key in whole.proposals:
        return whole.proposals[key]
    mesh = load_urdf_mesh(task.file, task.link) if task.mesh is None else task.mesh
    axes = tuple(joint_axes(whole.robot, task.link))
    found = propose_link(task.link, mesh, task.file.absolute(), "m", task.choice, axes, whole.keep_out, begin)
    if any(twin.link == task.link for twin in whole.twins.values()):
        whole.proposals[key] = found
    return found
