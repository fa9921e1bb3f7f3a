"""``fit``: plans, a robot's plans, or the links of an open scene, to calibration files."""

import argparse
import os.path
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from ..common.errors import InvalidPlan, OutputError, SkinCalibError
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..pipeline.sources import Source, load_sources, save_source
from ..plan import Plan
from ..robot.urdf import Robot, read_robot
from .common import DONE, WRONG_DATA, check_target, complain, count
from .fit_jobs import Job, Outcome, outcomes
from .progress import Progress

# What a scene gives in place of plan files: each link's plan, and its mesh as it stands in the scene.
ScenePlans = Callable[[], Sequence[tuple[Plan, TriangleMesh]]]

INTERRUPTED = 130  # as shells count a program that Ctrl+C ended


def add(commands, scene_plans: ScenePlans | None) -> None:
    """Describe the command; with a scene's plans it needs no plan file."""
    fit = commands.add_parser(
        "fit",
        help="turn plans into calibration files",
        description="Into a folder, what is up to date is not fitted again: same plan, mesh and taxel files, same "
        "program. One link that fails does not stop the others.",
    )
    fit.add_argument(
        "plans",
        nargs="*" if scene_plans else "+",
        type=Path,
        metavar="PLAN",
        help="plan file; a folder of *.plan.json; or a URDF, for the plans beside it, which are held against it",
    )
    fit.add_argument("-o", "--output", required=True, type=Path, metavar="OUT", help="calibration file, or a folder")
    fit.add_argument("--picture", type=Path, metavar="PNG", help="picture of surface, error, taxels; or a folder")
    fit.add_argument("--report", type=Path, metavar="JSON", help="errors and times; or a folder")
    fit.add_argument("--jobs", type=count, default=1, metavar="N", help="plans at a time (default: 1)")
    fit.add_argument("--again", action="store_true", help="fit what is up to date, too")
    fit.set_defaults(run=run, scene_plans=scene_plans)


def run(options: argparse.Namespace) -> int:
    check_target(options.output, *options.plans)
    check_target(options.picture, *options.plans, options.output)
    check_target(options.report, *options.plans, options.output, options.picture)
    robot: Robot | None = None
    if options.plans:
        files, robot = _plan_files(options.plans)
        links = [(path.name.removesuffix(".json").removesuffix(".plan"), path, None) for path in files]
    else:
        links = [(plan.link, plan, mesh) for plan, mesh in (options.scene_plans() if options.scene_plans else ())]
    if not links:
        raise SkinCalibError("the scene has no link to fit: give an object a link name in the Skin tab, or name a plan")
    names = [name for name, _, _ in links]
    for target in (options.output, options.picture, options.report):
        if len(links) > 1 and target is not None and not os.path.isdir(target):
            raise OutputError(f"{len(links)} links need a folder, and {target} is none; create it, or name one")
    if len(set(names)) < len(names):
        raise OutputError(f"two plans are both called {next(n for n in names if names.count(n) > 1)!r}; rename one")
    folder = options.output if options.plans and os.path.isdir(options.output) else None
    known = load_sources(folder) if folder else {}
    jobs = [_job(options, name, plan, mesh, robot, folder, known) for name, plan, mesh in links]
    # Blender's program cannot be started again as a plain Python
    return _carry_out(jobs, 1 if options.scene_plans else options.jobs)


def _plan_files(named: Iterable[Path]) -> tuple[list[Path], Robot | None]:
    """The plans that are named, lie in a folder that is, or beside a URDF; and the robot of the URDF."""
    robots = [path for path in named if path.suffix.lower() == ".urdf"]
    if len(robots) > 1:
        raise OutputError(f"{robots[0]} and {robots[1]} are two robots; fit one at a time")
    files: list[Path] = []
    for path in named:
        if path not in robots and not os.path.isdir(path):
            files.append(path)
            continue
        found = sorted((path.parent if path in robots else path).glob("*.plan.json"))
        if not found and (path not in robots or named == robots):
            raise InvalidPlan(f"no *.plan.json {'beside' if path in robots else 'in'} {path}; name the plans")
        files += found
    once = {os.path.realpath(path): path for path in files}
    return list(once.values()), read_robot(robots[0]) if robots else None


def _job(
    options: argparse.Namespace,
    name: str,
    plan: Plan | Path,
    mesh: TriangleMesh | None,
    robot: Robot | None,
    folder: Path | None,
    known: dict[str, Source],
) -> Job:
    def target(path: Path | None, ending: str) -> Path | None:
        return path / f"{name}{ending}" if path is not None and os.path.isdir(path) else path

    calibration = target(options.output, ".calibration.json")
    assert calibration is not None  # the option is required
    pictures = target(options.picture, ".png"), target(options.report, ".report.json")
    before = None if options.again else known.get(calibration.name)
    return Job(name, plan, mesh, calibration, *pictures, robot, folder, before)


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
            if outcome.job.folder and outcome.source:
                save_source(outcome.job.folder, outcome.job.calibration.name, outcome.source)
    except KeyboardInterrupt:
        progress.clear()
        complain(f"interrupted after {len(done)} of {len(jobs)} links; the same call goes on from here")
        return INTERRUPTED
    progress.clear()
    if len(jobs) > 1:
        print(_table([done[job.name] for job in jobs]))
    return WRONG_DATA if any(outcome.state == "failed" for outcome in done.values()) else DONE


def _report(outcome: Outcome, which: str) -> None:
    """What became of a link, as soon as it is known; of one alone, all of it."""
    for warning in outcome.warnings:
        complain(f"{which}{warning.severity}: {warning}")
    if outcome.state == "failed":
        complain(which + outcome.text)
        sys.stderr.write(outcome.trace)
    elif not which:
        print(outcome.text if outcome.state == "fitted" else f"{outcome.job.calibration}: {_state(outcome)}")


def _state(outcome: Outcome) -> str:
    return f"{outcome.state}: {outcome.text}" if outcome.text else outcome.state


def _table(done: list[Outcome]) -> str:
    """A line for each link, and one for all."""
    width = max(len(outcome.job.name) for outcome in done)
    lines = []
    for outcome in done:
        text = "" if outcome.state == "fitted" else outcome.text
        if outcome.state == "failed":
            stale = "; the calibration there is of an earlier fit" if os.path.isfile(outcome.job.calibration) else ""
            what = " ".join(text.splitlines()) + stale
        else:
            warnings = f"{len(outcome.warnings)} warnings" if outcome.warnings else ""
            numbers = f"{outcome.taxels:6} taxels, mean error {outcome.mean * 1e3:.4f} mm"
            what = ", ".join(word for word in (numbers, warnings, text) if word)
        lines.append(f"{outcome.job.name:{width}}  {outcome.state:10}  {what}")
    states = Counter(outcome.state for outcome in done)
    counts = [f"{states[state]} {state}" for state in ("fitted", "up to date", "kept", "failed") if states[state]]
    return "\n".join((*lines, f"{len(done)} links: {', '.join(counts)}"))
