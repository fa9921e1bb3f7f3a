"""``fit``: calculate calibrations from plans, from the plans of a robot, or from an open scene."""

import argparse
import os.path
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ..calibration.robot_set import FILE
from ..calibration.source_record import lost_plan
from ..common.atomic_file import make_folder
from ..common.errors import CalibrationFormatError, InvalidPlan, OutputError, SkinCalibError, counted
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..pipeline.robot_folder import save_robot
from ..plan import Plan
from ..proposal.links import Fitted
from ..robot.link_mesh import is_urdf
from ..robot.urdf import Robot, read_robot
from .common import (
    DONE,
    INTERRUPTED,
    WRONG_CALL,
    WRONG_DATA,
    check_picture,
    check_target,
    complain,
    named_path,
    names_folder,
    not_empty,
    say,
    warn,
)
from .fit_jobs import Job, Outcome, outcomes
from .progress import Progress
from .propose import add_options, propose

# Returns the plans of a scene, with the meshes of their links.
ScenePlans = Callable[[], Sequence[tuple[Plan, TriangleMesh]]]


def add(parser: argparse.ArgumentParser) -> None:
    """Define the command."""
    parser.description = (
        "OUT is a folder if it exists as one, or ends with a slash. For a folder, a URDF or several plans, "
        "a name without an ending is a folder, too. It is created. Calibrations in it that are up to date (same plan, "
        "mesh, taxel files and program) are not fitted again. An error of one link does not stop the others."
    )
    parser.add_argument(
        "plans",
        nargs="*" if parser.get_default("scene_plans") else "+",
        type=named_path,
        metavar="PLAN",
        help="plan file; folder of *.plan.json; or URDF: fit the plans in its folder and compare them with it",
    )
    parser.add_argument(
        "-o", "--output", required=True, type=not_empty, metavar="OUT", help="calibration file, or folder"
    )
    parser.add_argument(
        "--picture", type=not_empty, metavar="PNG", help="picture of surface, errors and taxels; or folder"
    )
    parser.add_argument("--report", type=not_empty, metavar="JSON", help="report of errors and times; or folder")
    parser.add_argument("--again", action="store_true", help="also fit calibrations that are up to date")
    parser.add_argument(
        "--propose",
        action="store_true",
        help="PLAN is a URDF or a mesh: propose plans first, and write them to the folder OUT, see propose",
    )
    add_options(parser)


@dataclass(frozen=True)
class Links:
    """The links that a call fits."""

    plans: Sequence[tuple[Plan | Path, TriangleMesh | None]]  # a plan of a scene comes with its mesh
    urdf: Path | None = None
    fitted: Mapping[Path, Fitted | None] = field(default_factory=dict)  # plans just proposed, and their calibrations
    code: int = DONE  # of the proposal

    @property
    def names(self) -> list[str]:
        """Return the name of each link, from which the names of its files are made."""
        return [
            p.name.removesuffix(".json").removesuffix(".plan") if isinstance(p, Path) else p.link for p, _ in self.plans
        ]

    @property
    def files(self) -> list[Path]:
        """Return the files of the plans."""
        return [plan for plan, _ in self.plans if isinstance(plan, Path)]


def run(options: argparse.Namespace) -> int:
    of_proposals = {
        "--skin": options.skin,
        "--only": options.only,
        "--except": options.left_out,
        "--unit": options.unit,
    }
    for option, value in of_proposals.items():
        if value is not None and not options.propose:
            options.refuse(f"{option} needs --propose: it is about the plans that are proposed")
    links = _links(options)
    if options.propose and not links.plans:
        return max(links.code, WRONG_DATA)
    if not links.plans:
        raise SkinCalibError(
            "The scene has no link to fit. Give an object a link name in the Skin tab, or specify a plan."
        )
    robot = read_robot(links.urdf) if links.urdf else None
    output, picture, report = _targets(options, links)
    folder = output if links.files and os.path.isdir(output) else None
    jobs = []
    for name, (plan, mesh) in zip(links.names, links.plans):
        files = (
            _inside(output, f"{name}.calibration.json"),
            picture and _inside(picture, f"{name}.png"),
            report and _inside(report, f"{name}.report.json"),
        )
        # The summary of a single fit needs more than its calibration.
        fitted = links.fitted.get(plan) if isinstance(plan, Path) and len(links.plans) > 1 else None
        jobs.append(Job(name, plan, mesh, *files, robot, folder, options.again, fitted))
    # Blender's program cannot be started again as a plain Python
    code = _carry_out(jobs, 1 if options.scene_plans else options.jobs)
    if folder and code != INTERRUPTED:
        code = max(code, _write_robot(folder, robot, links.urdf))
    return max(code, links.code)


def _links(options: argparse.Namespace) -> Links:
    """Return the links of a call: of a proposal, of plan files, or of the open scene."""
    if options.propose:
        if len(options.plans) != 1:
            raise InvalidPlan("--propose needs one URDF or one mesh. Specify it instead of plans.")
        options.file = options.plans[0]
        # Pictures and reports need more than the calibration.
        keeps_fits = options.picture is None and options.report is None
        fitted, code = propose(options, Path(options.output), options.again, keeps_fits)
        return Links([(path, None) for path in fitted], options.file if is_urdf(options.file) else None, fitted, code)
    if options.plans:
        files, urdf = _plan_files(options.plans)
        return Links([(path, None) for path in files], urdf)
    return Links(options.scene_plans() if options.scene_plans else ())


def _targets(options: argparse.Namespace, links: Links) -> tuple[Path, Path | None, Path | None]:
    """Check and return the paths of calibrations, pictures and reports; create those that have to be folders."""
    given = [options.output, options.picture, options.report]
    output, picture, report = paths = [None if text is None else Path(text) for text in given]
    for k, path in enumerate(paths):
        check_target(path, *links.files, links.urdf, *paths[:k])
    has_folder = (
        options.propose or len(options.plans) > 1 or any(os.path.isdir(path) or is_urdf(path) for path in options.plans)
    )
    targets = [(path, names_folder(text)) for path, text in zip(paths, given) if path is not None]
    folders = [path for path, has_slash in targets if _is_folder(path, has_slash, has_folder, len(links.plans))]
    check_picture(None if picture in folders else picture)
    twice = [name for name, count in Counter(links.names).items() if count > 1]
    if twice:
        raise OutputError(f"Two plans have the name {twice[0]!r}. Rename one of them.")
    for path in folders:
        make_folder(path)
    assert output is not None  # the option is required
    return output, picture, report


def _inside(path: Path, name: str) -> Path:
    """Return the file of a link: a path itself, or a name in it if it is a folder."""
    return path / name if os.path.isdir(path) else path


def _write_robot(folder: Path, robot: Robot | None, urdf: Path | None) -> int:
    """Write ``robot.json``, and return the exit code; print what is wrong with the calibrations together."""
    try:
        if why := save_robot(folder, robot, urdf):
            complain(f"warning: {why}")
        for path in sorted(folder.glob("*.calibration.json")):
            if plan := lost_plan(path):
                complain(f"warning: {path.name} stays in {FILE}, but its plan {plan} is missing. Remove it.")
    except CalibrationFormatError as problem:
        complain(f"{FILE} is not up to date: {problem}")
        return WRONG_DATA
    return DONE


def _plan_files(named: Iterable[Path]) -> tuple[list[Path], Path | None]:
    """Return the plan files of the arguments (files, folders, folder of a URDF), and the URDF."""
    robots = [path for path in named if path.suffix.lower() == ".urdf"]
    if len(robots) > 1:
        raise OutputError(f"{robots[0]} and {robots[1]} are two robots. Fit one at a time.")
    files: list[Path] = []
    for path in named:
        if path not in robots and not os.path.isdir(path):
            files.append(path)
            continue
        found = sorted((path.parent if path in robots else path).glob("*.plan.json"))
        if not found and (path not in robots or named == robots):
            raise InvalidPlan(
                f"no *.plan.json {'in the folder of' if path in robots else 'in'} {path}. Specify the plans."
            )
        files += found
    unique = {os.path.realpath(path): path for path in files}
    return list(unique.values()), robots[0] if robots else None


def _is_folder(path: Path, has_slash: bool, has_folder: bool, links: int) -> bool:
    """Return whether a target is a folder, or will be; an error if it has to be one and cannot."""
    if os.path.isdir(path):
        return True
    if not (links > 1 or has_slash or (has_folder and not path.suffix)):
        return False
    if os.path.lexists(path) or (path.suffix and not has_slash):
        why = f"{links} links need one" if links > 1 else "this call needs one"
        raise OutputError(f"{path} is not a folder; {why}. Create it, or choose an existing folder.")
    return True


def _carry_out(jobs: list[Job], processes: int) -> int:
    done: dict[str, Outcome] = {}
    progress = Progress(len(jobs))
    try:
        for outcome in outcomes(jobs, processes):
            done[outcome.job.name] = outcome
            progress.step()
            progress.clear()
            _report(outcome, f"{outcome.job.name}: " if len(jobs) > 1 else "")
            progress.show()
    except KeyboardInterrupt:
        progress.clear()
        complain(f"interrupted after {len(done)} of {len(jobs)} links. The same call continues from here.")
        return INTERRUPTED
    progress.clear()
    if len(jobs) > 1:
        say(_table([done[job.name] for job in jobs]))
    if any(outcome.unwritable for outcome in done.values()):
        return WRONG_CALL
    return WRONG_DATA if any(outcome.state == "failed" for outcome in done.values()) else DONE


def _report(outcome: Outcome, which: str) -> None:
    """Print the outcome of a link; completely if it is the only one."""
    warn(outcome.warnings, which)
    if outcome.state == "failed":
        complain(which + outcome.text)
        sys.stderr.write(outcome.trace)
    elif not which:
        say(outcome.text if outcome.state == "fitted" else f"{outcome.job.calibration}: {_state(outcome)}")


def _state(outcome: Outcome) -> str:
    return f"{outcome.state}: {outcome.text}" if outcome.text else outcome.state


def _table(done: list[Outcome]) -> str:
    """Return a table with a line for each link, and one for all."""
    width = max(len(outcome.job.name) for outcome in done)
    lines = []
    for outcome in done:
        text = "" if outcome.state == "fitted" else outcome.text
        if outcome.state == "failed":
            stale = (
                "; the existing calibration is from an earlier fit" if os.path.isfile(outcome.job.calibration) else ""
            )
            what = " ".join(text.splitlines()) + stale
        else:
            warnings = counted(len(outcome.warnings), "warning") if outcome.warnings else ""
            numbers = f"{outcome.taxels:6} taxel{'s' * (outcome.taxels != 1)}, mean error {outcome.mean * 1e3:.4f} mm"
            what = ", ".join(word for word in (numbers, warnings, text) if word)
        lines.append(f"{outcome.job.name:{width}}  {outcome.state:10}  {what}")
    states = Counter(outcome.state for outcome in done)
    counts = [f"{states[state]} {state}" for state in ("fitted", "up to date", "kept", "failed") if states[state]]
    return "\n".join((*lines, f"{counted(len(done), 'link')}: {', '.join(counts)}"))
