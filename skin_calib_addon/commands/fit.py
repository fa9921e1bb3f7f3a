"""``fit``: plans, or the links of an open scene, to calibration files."""

import argparse
import json
import os.path
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from ..atomic_file import write_bytes_safely
from ..calibration.file import save_calibration
from ..errors import OutputError, SkinCalibError
from ..geometry.mesh import TriangleMesh
from ..pipeline import Calibrated, calibrate
from ..plan import Plan, load_plan
from ..report import report_document, summary
from .common import DONE, WRONG_DATA, check_folder, complain, count

# What a scene gives in place of plan files: each link's plan, and its mesh as it stands in the scene.
ScenePlans = Callable[[], Sequence[tuple[Plan, TriangleMesh]]]

# Name of the result, the plan or its file, and the mesh where a scene has it.
Job = tuple[str, Plan | Path, TriangleMesh | None]


def add(commands, scene_plans: ScenePlans | None) -> None:
    """Describe the command; with a scene's plans it needs no plan file."""
    fit = commands.add_parser("fit", help="turn plans into calibration files")
    fit.add_argument("plans", nargs="*" if scene_plans else "+", type=Path, metavar="PLAN", help="plan file")
    fit.add_argument("-o", "--output", required=True, type=Path, metavar="OUT", help="calibration file, or a folder")
    fit.add_argument("--picture", type=Path, metavar="PNG", help="picture of surface, error, taxels; or a folder")
    fit.add_argument("--report", type=Path, metavar="JSON", help="errors and times; or a folder")
    fit.add_argument("--jobs", type=count, default=1, metavar="N", help="plans at a time (default: 1)")
    fit.set_defaults(run=run, scene_plans=scene_plans)


def run(options: argparse.Namespace) -> int:
    for target in (options.output, options.picture, options.report):
        check_folder(target)
    jobs: list[Job]
    if options.plans:
        jobs = [(path.name.removesuffix(".json").removesuffix(".plan"), path, None) for path in options.plans]
    else:
        jobs = [(plan.link, plan, mesh) for plan, mesh in (options.scene_plans() if options.scene_plans else ())]
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
    processes = (
        1 if options.scene_plans else options.jobs
    )  # Blender's program cannot be started again as a plain Python
    for (name, _, _), (text, error, doubts) in zip(jobs, _results(work, processes)):
        which = f"{name}: " if len(jobs) > 1 else ""
        for doubt in doubts:
            complain(f"{which}warning: {doubt}")
        if error is None:
            print(text)
        else:
            failed = True
            complain(which + error)
    return WRONG_DATA if failed else DONE


def _targets(options: argparse.Namespace, name: str) -> dict[str, Path]:
    wanted = {"calibration": options.output, "picture": options.picture, "report": options.report}
    endings = {"calibration": ".calibration.json", "picture": ".png", "report": ".report.json"}
    return {k: p / f"{name}{endings[k]}" if os.path.isdir(p) else p for k, p in wanted.items() if p is not None}


def _results(work: list[Any], jobs: int):
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
    from ..picture import draw_calibration  # matplotlib, which not every place has

    draw_calibration(result.calibration, path, result.cover)
