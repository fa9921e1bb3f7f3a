"""Fit links one by one or in parallel; an error of one link does not affect the others."""

import json
import os
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Literal

from ..calibration.file import load_calibration, save_calibration
from ..calibration.model import LinkCalibration
from ..calibration.source_record import Source, load_source, save_source
from ..common.atomic_file import write_bytes_safely
from ..common.errors import CalibrationFormatError, OutputError, SkinCalibError
from ..common.warnings import Warning
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..pipeline import Calibrated, calibrate
from ..pipeline.report import report_document, summary
from ..pipeline.sources import add_outputs, input_files, is_current, source_of
from ..plan import Plan, load_plan
from ..proposal.links import Fitted
from ..robot.link_mesh import load_plan_mesh
from ..robot.urdf import Robot, compare
from .common import check_target
from .worker_processes import run_tasks

EDITED = Warning(
    "edited",
    "warning",
    "The calibration was changed after its last fit, and this fit replaces those changes.",
    advice="Apply them again.",
)


@dataclass(frozen=True, eq=False)
class Job:
    """A link to fit, and the files to write."""

    name: str
    plan: Plan | Path
    mesh: TriangleMesh | None  # from a scene; None to read the file
    calibration: Path
    picture: Path | None = None
    report: Path | None = None
    robot: Robot | None = None
    folder: Path | None = None  # whose calibrations have records and robot.json; None without
    again: bool = False  # whether a calibration that is up to date is fitted, too
    fitted: Fitted | None = None  # the plan as it was proposed, and its calibration

    @property
    def outputs(self) -> list[Path]:
        """Return the files to write."""
        return [path for path in (self.calibration, self.picture, self.report) if path is not None]


@dataclass(frozen=True, eq=False)
class Outcome:
    """The outcome of a job."""

    job: Job
    state: Literal["fitted", "up to date", "kept", "failed"]
    text: str = ""  # summary, or reason of the failure
    warnings: tuple[Warning, ...] = ()
    taxels: int = 0
    mean: float = 0.0  # distance from surface to mesh [m]
    trace: str = ""  # traceback of an unexpected error
    unwritable: bool = False  # whether an output cannot be written


def outcomes(jobs: Sequence[Job], processes: int) -> Iterator[Outcome]:
    """Yield the outcome of each job as soon as it is finished."""
    # What only has to be written is not worth another process.
    fitted = [job for job in jobs if job.fitted]
    others = [job for job in jobs if not job.fitted]
    return chain(map(_fit_safely, fitted), _fitted_now(others, processes, len(jobs) == 1))


def _fitted_now(jobs: Sequence[Job], processes: int, is_only: bool) -> Iterator[Outcome]:
    if processes == 1 or len(jobs) <= 1:
        return map(fit_one if is_only else _fit_safely, jobs)
    # Long plans first, so that no process is still busy with one of them in the end.
    jobs = sorted(jobs, key=_plan_size, reverse=True)
    return run_tasks(
        _fit_safely, jobs, min(processes, len(jobs)), lambda job, problem: Outcome(job, "failed", str(problem))
    )


def _plan_size(job: Job) -> int:
    return os.path.getsize(job.plan) if isinstance(job.plan, Path) and os.path.isfile(job.plan) else 0


def fit_one(job: Job) -> Outcome:
    """Fit one link and write its files, unless they are up to date."""
    try:
        plan = load_plan(job.plan) if isinstance(job.plan, Path) else job.plan
        if isinstance(job.plan, Path):
            for output in job.outputs:
                check_target(output, *input_files(plan))
        warnings = compare(job.robot, plan) if job.robot else ()
        source = source_of(job.plan, plan, job.folder) if job.folder and isinstance(job.plan, Path) else None
        before = load_source(job.calibration) if source and not job.again else None
        if source and before and job.folder:
            if is_current(source, before, job.folder, job.outputs):
                return _unchanged(job, "up to date", before, warnings)
            edited = _edited(job.calibration, before)
            if edited and edited.link == plan.link and is_current(source, before, job.folder, []):
                return _unchanged(job, "kept", before, warnings)
            warnings += (EDITED,) if edited else ()
        calibration = _known(job.fitted, plan) if job.fitted else None
        if job.fitted and calibration:
            mean, text = job.fitted.mean, ""
        else:
            result = calibrate(plan, job.mesh)
            result = replace(result, calibration=result.calibration_of(plan))
            if job.picture:
                _draw(result, job.picture)
            if job.report:
                write_bytes_safely(job.report, (json.dumps(report_document(result), indent=2) + "\n").encode())
            calibration, mean, text = result.calibration, result.mean, summary(result, job.calibration)
        save_calibration(calibration, job.calibration)
        taxels, found = calibration.taxel_count, calibration.warnings
        if source and job.folder:
            numbers = {"taxels": taxels, "mean": mean, "warnings": found}
            save_source(job.calibration, add_outputs(source, job.folder, job.outputs, **numbers))
    except SkinCalibError as error:
        return Outcome(job, "failed", str(error), unwritable=isinstance(error, OutputError))
    return Outcome(job, "fitted", text, warnings + found, taxels, mean)


def _known(fitted: Fitted, plan: Plan) -> LinkCalibration | None:
    """Return the calibration of a plan that was just proposed; None if the plan or its mesh is another one now."""
    calibration = fitted.calibration_of(plan)
    if calibration and load_plan_mesh(plan).sha256 == calibration.mesh.sha256:
        return calibration
    return None


def _unchanged(
    job: Job, state: Literal["up to date", "kept"], source: Source, warnings: tuple[Warning, ...]
) -> Outcome:
    text = "changed after its fit; --again would replace it" if state == "kept" else ""
    return Outcome(job, state, text, warnings + source.warnings, source.taxels, source.mean)


def _edited(calibration: Path, before: Source) -> LinkCalibration | None:
    """Return a calibration if it is valid, but was changed after its fit, for example by ``response``."""
    known = before.outputs.get(calibration.name, "")
    if not os.path.isfile(calibration) or before.has_files(calibration.parent, {calibration.name: known}):
        return None
    try:
        return load_calibration(calibration)
    except CalibrationFormatError:
        return None


def _fit_safely(job: Job) -> Outcome:
    """Fit one link; an unexpected error becomes its outcome."""
    try:
        return fit_one(job)
    except MemoryError:
        return Outcome(job, "failed", "There is not enough memory. Reduce --jobs, or use a coarser mesh.")
    except Exception as error:
        text = f"unexpected error in the program, please report it: {type(error).__name__}: {error}"
        return Outcome(job, "failed", text, trace=traceback.format_exc())


def _draw(result: Calibrated, path: Path) -> None:
    from ..pictures.calibration import draw_calibration  # matplotlib is optional

    draw_calibration(result.calibration, path, result.cover)
