"""The command line, the same words inside and outside Blender."""

import argparse
import json
import os.path
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NoReturn

from . import __version__
from .atomic_file import write_bytes_safely
from .calibration.file import check_bytes, load_calibration, save_calibration
from .calibration.strict_json import parse, read
from .errors import OutputError, SkinCalibError
from .geometry.mesh import TriangleMesh
from .pipeline import Calibrated, calibrate
from .plan import FORMAT, Plan, check_plan_wholly, load_plan
from .report import report_document, summary, table

DONE, WRONG_DATA, WRONG_CALL = 0, 1, 2
# What a scene gives in place of plan files: each link's plan, and its mesh as it stands in the scene.
ScenePlans = Callable[[], Sequence[tuple[Plan, TriangleMesh]]]

# Name of the result, the plan or its file, and the mesh where a scene has it.
Job = tuple[str, Plan | Path, TriangleMesh | None]


def main(argv: Sequence[str] | None = None, scene_plans: ScenePlans | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    argv : sequence of str, optional
        Without the program's name; None takes the process's own.
    scene_plans : callable, optional
        Where a scene is open: ``fit`` without a plan file fits its links.

    Returns
    -------
    int
        0 done, 1 the data is wrong, 2 the call is wrong. Errors are one line each on stderr.
    """
    parser = _parser(needs_plan=scene_plans is None)
    options = parser.parse_args(argv)
    try:
        return options.run(options, scene_plans)
    except (OutputError, SkinCalibError) as error:
        _complain(str(error))
        return WRONG_CALL if isinstance(error, OutputError) else WRONG_DATA


def _complain(message: str) -> None:
    """One line on stderr, whatever names the message holds."""
    print("skin-calib:", " ".join(message.splitlines()), file=sys.stderr)


class _Parser(argparse.ArgumentParser):
    """Says what is wrong with a call in one line; the usage is a ``--help`` away."""

    def error(self, message: str) -> NoReturn:
        self.exit(WRONG_CALL, f"{self.prog}: {' '.join(message.splitlines())}; see {self.prog} --help\n")


def _parser(needs_plan: bool) -> argparse.ArgumentParser:
    parser = _Parser(prog="skin-calib", description="Spatial calibration of robot tactile skin.")
    parser.add_argument("--version", action="version", version=f"skin-calib {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    fit = commands.add_parser("fit", help="turn plans into calibration files")
    fit.add_argument("plans", nargs="+" if needs_plan else "*", type=Path, metavar="PLAN", help="plan file")
    fit.add_argument("-o", "--output", required=True, type=Path, metavar="OUT", help="calibration file, or a folder")
    fit.add_argument("--picture", type=Path, metavar="PNG", help="picture of surface, error, taxels; or a folder")
    fit.add_argument("--report", type=Path, metavar="JSON", help="errors and times; or a folder")
    fit.add_argument("--jobs", type=_count, default=1, metavar="N", help="plans at a time (default: 1)")
    fit.set_defaults(run=_fit)

    check = commands.add_parser("check", help="validate a calibration or plan file")
    check.add_argument("file", type=Path, metavar="FILE")
    check.set_defaults(run=_check)

    show = commands.add_parser("show", help="table and picture of a calibration")
    show.add_argument("file", type=Path, metavar="FILE")
    show.add_argument("--picture", type=Path, metavar="PNG")
    show.set_defaults(run=_show)
    return parser


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of 1 or more")
    return int(text)


def _fit(options: argparse.Namespace, scene_plans: ScenePlans | None) -> int:
    for target in (options.output, options.picture, options.report):
        _check_folder(target)
    jobs: list[Job]
    if options.plans:
        jobs = [(path.name.removesuffix(".json").removesuffix(".plan"), path, None) for path in options.plans]
    else:
        jobs = [(plan.link, plan, mesh) for plan, mesh in (scene_plans() if scene_plans else ())]
    if not jobs:
        raise SkinCalibError("the scene has no link to fit: give an object a link name in the Skin tab, or name a plan")
    names = [name for name, _, _ in jobs]
    for target in (options.output, options.picture, options.report):
        if len(jobs) > 1 and target is not None and not os.path.isdir(target):
            raise OutputError(f"{len(jobs)} links need a folder, and {target} is none; create it, or name one")
    if len(set(names)) < len(names):
        raise OutputError(f"two plans are both called {next(n for n in names if names.count(n) > 1)!r}; rename one")
    work = [(job, _targets(options, job[0])) for job in jobs]
    failed = False
    processes = 1 if scene_plans else options.jobs  # Blender's program cannot be started again as a plain Python
    for (name, _, _), (text, error, doubts) in zip(jobs, _run(work, processes)):
        which = f"{name}: " if len(jobs) > 1 else ""
        for doubt in doubts:
            _complain(f"{which}warning: {doubt}")
        if error is None:
            print(text)
        else:
            failed = True
            _complain(which + error)
    return WRONG_DATA if failed else DONE


def _check_folder(target: Path | None) -> None:
    """A missing folder is said before anything is computed."""
    # os.path, for Path.is_dir raises where a name is too long
    if target is not None and not os.path.isdir(target) and not os.path.isdir(target.absolute().parent):
        raise OutputError(f"no folder {target.absolute().parent} to write {target.name} into; create it first")


def _targets(options: argparse.Namespace, name: str) -> dict[str, Path]:
    wanted = {"calibration": options.output, "picture": options.picture, "report": options.report}
    endings = {"calibration": ".calibration.json", "picture": ".png", "report": ".report.json"}
    return {k: p / f"{name}{endings[k]}" if os.path.isdir(p) else p for k, p in wanted.items() if p is not None}


def _run(work: list[Any], jobs: int):
    if jobs == 1 or len(work) == 1:
        yield from map(_fit_one, work)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(_fit_one, work)


def _fit_one(work: Any) -> tuple[str, str | None, tuple[str, ...]]:
    """Fit one link and write its files; what to print, what went wrong, and what is doubtful."""
    (_, plan, mesh), targets = work
    try:
        result = calibrate(load_plan(plan) if isinstance(plan, Path) else plan, mesh)
        if "picture" in targets:
            _draw(result, targets["picture"])
        if "report" in targets:
            text = json.dumps(report_document(result), indent=2)
            write_bytes_safely(targets["report"], (text + "\n").encode())
        save_calibration(result.calibration, targets["calibration"])
    except SkinCalibError as error:
        return "", str(error), ()
    return summary(result, targets["calibration"]), None, result.doubts


def _draw(result: Calibrated, path: Path) -> None:
    from .picture import draw_calibration  # matplotlib, which not every place has

    draw_calibration(result.calibration, path, result.cover)


def _check(options: argparse.Namespace, _: ScenePlans | None) -> int:
    data = read(options.file)
    document, findings = parse(data)
    if isinstance(document, dict) and document.get("format") == FORMAT:
        findings = tuple(findings) or check_plan_wholly(document)
    else:
        findings = check_bytes(data)[1]
    for finding in findings:
        print(finding)
    errors = sum(f.severity == "error" for f in findings)
    print(f"{options.file}: {errors} errors, {len(findings) - errors} warnings")
    return WRONG_DATA if errors else DONE


def _show(options: argparse.Namespace, _: ScenePlans | None) -> int:
    _check_folder(options.picture)
    calibration = load_calibration(options.file)
    print(table(calibration))
    if options.picture:
        from .picture import draw_calibration

        draw_calibration(calibration, options.picture)
    return DONE
