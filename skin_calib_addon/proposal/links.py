"""Propose plans for the links of a robot, one by one: the same for each interface."""

import re
import traceback
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

from ..calibration.model import LinkCalibration
from ..common.errors import SkinCalibError, UnknownLink
from ..geometry.blas_threads import one_blas_thread
from ..geometry.mesh.triangle_mesh import TriangleMesh, load_mesh
from ..pipeline import calibrate
from ..pipeline.calibrate import OUTDATED_PROPOSAL
from ..plan import Plan, load_plan
from ..plan.plan import PROPOSAL_MESH
from ..plan.skins import with_channels
from ..robot.keep_out import KeepOut, paths_from
from ..robot.link_mesh import is_urdf, load_plan_mesh, load_urdf_mesh, load_urdf_meshes
from ..robot.mirrored import Twin, find_twins
from ..robot.urdf import Robot, read_robot
from ..skin.boards.layout import forget_layouts
from .one_skin import LinkSurfaces
from .origin import PROPOSAL_FROM, changes, made_from, mirror_of
from .proposal import Proposal, joint_axes, link_surfaces, propose_link, propose_twin
from .skins import SkinChoice

NOT_KNOWN = "covers is not known"  # Format: part of a reason, by which it is found in a plan
MAX_NAME_LENGTH = 100  # characters of a link in the name of its file. Larger: file systems may refuse the names.


@dataclass(frozen=True)
class Task:
    """A link to propose a plan for."""

    file: Path  # of the robot or the mesh
    unit: str
    link: str
    choice: SkinChoice
    mesh: TriangleMesh | None = None  # [m]; None to read it from the file
    twins: Mapping[str, Twin] | None = None  # of the robot; None to find them
    fit: bool = False  # whether the plan is carried out, too, with the fits and layouts of the proposal


@dataclass(frozen=True, eq=False)
class Fitted:
    """The calibration of a proposed plan. Its channels start at zero, because other links precede it."""

    plan: Plan
    calibration: LinkCalibration
    mean: float  # distance from surface to mesh [m]

    def calibration_of(self, plan: Plan) -> LinkCalibration | None:
        """Return the calibration of a plan that was read from a file; None if it is not the proposed plan."""
        first = plan.skins[0].first_channel or 0
        proposed = numbered(self.plan, first)
        plan, proposed = (replace(p, mesh=self.plan.mesh, skins=with_channels(p.skins)) for p in (plan, proposed))
        if plan != proposed:
            return None
        patches = tuple(
            replace(patch, taxels=replace(patch.taxels, channels=patch.taxels.channels + first))
            for patch in self.calibration.patches
        )
        return replace(self.calibration, patches=patches)


@dataclass(frozen=True, eq=False)
class Outcome:
    """A proposal, or what failed."""

    task: Task
    proposal: Proposal | None = None
    problem: str = ""
    trace: str = ""  # of an unexpected error
    fitted: Fitted | None = None


@one_blas_thread()
def propose_task(
    task: Task,
    begin: Callable[[str], None] = lambda stage: None,
    use: Callable[[Proposal], None] = lambda proposal: None,
) -> Outcome:
    """Propose the plan of one link; an unexpected error becomes its outcome."""
    try:
        proposal = _proposal(task, begin)
        use(proposal)
        fitted = _fitted(task, proposal) if task.fit else None
        return Outcome(task, replace(proposal, fits={}, mirror=""), fitted=fitted)  # fits are large
    except SkinCalibError as problem:
        return Outcome(task, None, str(problem))
    except MemoryError:
        return Outcome(task, None, "There is not enough memory. Reduce --jobs, or use a coarser mesh.")
    except Exception as error:
        text = f"unexpected error in the program, please report it: {type(error).__name__}: {error}"
        return Outcome(task, None, text, traceback.format_exc())
    finally:
        forget_layouts()  # they keep the meshes of the link


def _proposal(task: Task, begin: Callable[[str], None]) -> Proposal:
    """Return the proposal for a link; its plan has the hash of the mesh."""
    if is_urdf(task.file):
        found, mesh = _of_robot(task, begin), _mesh_of(task)
    else:
        mesh = _mesh_of(task)
        found = propose_link(task.link, mesh, task.file.absolute(), task.unit, task.choice, begin=begin)
    if found.plan is None:
        return found
    mirror = found.mirror.link if isinstance(found.mirror, Proposal) else ""
    record = {PROPOSAL_MESH: mesh.sha256, PROPOSAL_FROM: made_from(task.file, task.link, task.choice, mirror)}
    return replace(found, plan=replace(found.plan, extra=found.plan.extra | record))


def _of_robot(task: Task, begin: Callable[[str], None]) -> Proposal:
    file = task.file.absolute()
    begin("robot")
    robot = robot_of(task.file)
    unsure = _not_covering(robot, task.link)
    twin = (robot.twins if task.twins is None else task.twins).get(task.link)
    words: tuple[str, ...] = ()
    if twin is not None:
        former = own_proposal(replace(task, link=twin.link, mesh=None), begin)
        found = former.mirror if twin.is_mirrored else ""
        if former.plan and (isinstance(found, Proposal) and task.mesh is not None or not twin.is_mirrored):
            found = propose_twin(former, twin, task.link, _mesh_of(task), file, task.choice, robot.keep_out, begin)
        if isinstance(found, Proposal):
            return replace(found, mirror=former if twin.is_mirrored else "").with_warnings(unsure)
        words = (f"The link is {twin.words} {twin.link}, but has its own layout: {found}.",) if found else ()
    return own_proposal(task, begin).with_reasons(words).with_warnings(unsure)


def _fitted(task: Task, proposal: Proposal) -> Fitted | None:
    """Return the calibration of a proposal; None if it has no plan, or ``fit`` has to say what is wrong with it."""
    if proposal.plan is None:
        return None
    try:
        result = calibrate(proposal.plan, _mesh_of(task), known=proposal.fits)
    except SkinCalibError:
        return None
    return Fitted(proposal.plan, result.calibration, result.mean)


def _mesh_of(task: Task) -> TriangleMesh:
    """Return the mesh of a link; that of a robot is read once."""
    if task.mesh is not None:
        return task.mesh
    if not is_urdf(task.file):
        return load_mesh(task.file, task.unit)
    mesh = robot_of(task.file).keep_out.meshes.get(task.link)
    return load_urdf_mesh(task.file, task.link) if mesh is None else mesh


@one_blas_thread()
def surfaces_of(task: Task) -> tuple[LinkSurfaces, tuple[str, ...]]:
    """Return the surfaces that a link would have in a proposal, and warnings about links that can cover it."""
    mesh, file = _mesh_of(task), task.file.absolute()
    if not is_urdf(task.file):
        return link_surfaces(task.link, mesh, file, task.unit), ()
    whole = robot_of(task.file)
    axes = tuple(joint_axes(whole.robot, task.link))
    return link_surfaces(task.link, mesh, file, "m", axes, whole.keep_out), _not_covering(whole, task.link)


def groups(tasks: Sequence[Task]) -> list[list[Task]]:
    """Return the tasks in groups with common work: a link of a robot, and those that are like it.

    Those with the largest area come first, so that no process is still busy with one of them in the end. The tasks have
    the twins, so that no process finds them again.
    """
    found: dict[str, list[Task]] = {}
    for task in tasks:
        twins = robot_of(task.file).twins if is_urdf(task.file) else {}
        twin = twins.get(task.link)
        found.setdefault(task.link if twin is None else twin.link, []).append(replace(task, twins=twins))
    return sorted(found.values(), key=lambda group: sum(map(_area, group)), reverse=True)


def areas(tasks: Sequence[Task]) -> list[float]:
    """Return the areas of the links [m^2], to which the time that they take is about proportional."""
    return [_area(task) for task in tasks]


def _area(task: Task) -> float:
    mesh = robot_of(task.file).keep_out.meshes.get(task.link) if is_urdf(task.file) else None
    return float(mesh.face_areas.sum()) if mesh else 0.0


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
    """Return a plan whose channels start at a number."""
    first, *others = plan.skins
    return replace(plan, skins=(replace(first, first_channel=channel), *others))


@dataclass(frozen=True, eq=False)
class WholeRobot:
    """A robot, what its links cover of each other, and which are mirror images."""

    robot: Robot
    keep_out: KeepOut
    proposals: dict[tuple[str, SkinChoice], Proposal]  # others may be like these links; grows
    unread: Mapping[str, str]  # links with meshes that could not be read, and why

    @cached_property
    def twins(self) -> Mapping[str, Twin]:
        """Return the links that are like another one, which is like none."""
        found = find_twins(self.robot, self.keep_out.meshes)
        return {link: twin for link, twin in found.items() if twin.link not in found}

    def mirror_of(self, link: str) -> tuple[str, Twin]:
        """Return the link that is the mirror image of a link, and the reflection to it; raise UnknownLink without."""
        for other, twin in self.twins.items():
            if twin.is_mirrored and link == twin.link:
                return other, twin
            if twin.is_mirrored and link == other:
                return twin.link, twin.inverse(other)
        raise UnknownLink(f"No link of {self.robot.file} is the mirror image of {link}: their meshes differ.")


@lru_cache(maxsize=1)
def robot_of(urdf: Path) -> WholeRobot:
    """Return what all links have in common. What is not read covers nothing; proposals next to it say so.

    The last robot is kept. If its files can have changed, call ``robot_of.cache_clear()`` first.
    """
    robot = read_robot(urdf)
    meshes, problems = load_urdf_meshes(urdf, robot)
    return WholeRobot(robot, KeepOut(robot, meshes), {}, problems)


def _not_covering(whole: WholeRobot, link: str) -> tuple[str, ...]:
    """Return a sentence for each link that can cover another one, and whose mesh was not read."""
    return tuple(
        f"What {other} {NOT_KNOWN}: {whole.unread[other]} Then propose again."
        for other, _ in paths_from(whole.robot, link)
        if other in whole.unread
    )


def plan_warnings(path: Path) -> list[str]:
    """Return the warnings about a proposed plan that exists, as sentences.

    They are about links that can cover its skin and whose mesh was not read, and about what has changed since.
    """
    try:
        plan = load_plan(path)
        reasons = plan.extra.get("x_proposal")
        reasons = reasons if isinstance(reasons, list) else []
        found = [reason for reason in reasons if isinstance(reason, str) and f" {NOT_KNOWN}: " in reason]
        if PROPOSAL_MESH in plan.extra and not plan.is_for(load_plan_mesh(plan)):
            found.append(f"{OUTDATED_PROPOSAL.message} {OUTDATED_PROPOSAL.advice}")
        if PROPOSAL_FROM in plan.extra:
            now = made_from(plan.mesh, plan.link, None, mirror_of(plan))
            found += (f"{sentence} {OUTDATED_PROPOSAL.advice}" for sentence in changes(plan, now))
        return found
    except SkinCalibError:
        return []  # ``fit`` says what is wrong with the plan


def is_current(path: Path, task: Task) -> bool:
    """Return whether the plan in a file was proposed for a task, and nothing that it was made from has changed."""
    try:
        plan = load_plan(path)
        is_same = plan.extra.get(PROPOSAL_FROM) == made_from(task.file, task.link, task.choice, mirror_of(plan))
        return is_same and plan.is_for(load_plan_mesh(plan))
    except SkinCalibError:
        return False


def own_proposal(task: Task, begin: Callable[[str], None]) -> Proposal:
    """Return the proposal of a link of a robot that does not follow that of a mirrored one."""
    whole = robot_of(task.file)
    key = task.link, task.choice
    if task.mesh is None and key in whole.proposals:
        return whole.proposals[key]
    mesh = _mesh_of(task)
    axes = tuple(joint_axes(whole.robot, task.link))
    mirrors = ((link, twin) for link, twin in whole.twins.items() if twin.link == task.link and twin.is_mirrored)
    file = task.file.absolute()
    found = propose_link(task.link, mesh, file, "m", task.choice, axes, whole.keep_out, begin, next(mirrors, None))
    for other, proposal in whole.proposals.items():
        whole.proposals[other] = proposal.without_fits()
    whole.proposals[key] = replace(found, fits={})  # that of its mirror image is often next
    return found
