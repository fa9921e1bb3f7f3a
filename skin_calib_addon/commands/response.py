"""``response``: fit the responses of the sensors to measurements, and store them in a calibration."""

import argparse
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..calibration.file import load_calibration, save_calibration
from ..calibration.measurements import Measurements, read_measurements
from ..calibration.modality import Modality
from ..calibration.model import LinkCalibration, Patch
from ..calibration.response import AnyResponse
from ..calibration.response_fit import ResponseFit, fit_response
from ..common.errors import CalibrationFormatError, UnderdeterminedFit
from ..common.findings import did_you_mean, show
from ..common.tables import has_columns
from ..common.warnings import Place, Warning
from ..inspection.touch_file import read_touch_file
from ..pipeline.sources import mesh_of
from ..validation import directions_of
from ..validation.gains import fit_gains
from .common import DONE, check_outputs, file_name, named_path, say, say_unused, warn


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=named_path, metavar="CALIBRATION", help="calibration file")
    parser.add_argument(
        "measurements",
        type=named_path,
        metavar="MEASUREMENTS",
        help="CSV file with columns reading, force [N], and optionally taxel or channel; "
        "with --modality reading and value; or a session of touches, CSV or MCAP, with all readings and wrenches",
    )
    parser.add_argument(
        "--modality", metavar="NAME", help="fit the response of this modality of the calibration, in its unit"
    )
    parser.add_argument("-o", "--output", required=True, type=file_name, metavar="OUT", help="calibration file")
    parser.add_argument(
        "--picture", type=file_name, metavar="PNG", help="picture of measurements, curves and residuals"
    )


def run(options: argparse.Namespace) -> int:
    check_outputs(options, options.file, options.measurements, replaces=options.file)
    calibration = load_calibration(options.file)
    is_session = options.measurements.suffix.lower() == ".mcap" or has_columns(options.measurements, ("fx",))
    if options.modality is None and is_session:
        return _of_session(options, calibration)
    modality = None if options.modality is None else _modality(calibration, options.modality, options.file)
    quantity, unit = ("force", "N") if modality is None else ("value", modality.unit)
    measured = read_measurements(options.measurements, calibration, quantity)
    if modality is not None and measured[0].taxel is not None:
        what = f"the modality {show(modality.name)} has one response for all taxels. Remove the column of the taxels"
        raise CalibrationFormatError(f"'{options.measurements}': {what}")
    fits = [_fit(one, options.measurements, quantity, unit) for one in measured]
    if modality is None:
        result = with_responses(calibration, {one.taxel: fit.response for one, fit in zip(measured, fits)})
    else:
        fitted = replace(modality, response=fits[0].response)
        result = replace(calibration, modalities=tuple(fitted if m is modality else m for m in calibration.modalities))
    if options.picture:
        from ..pictures.response import draw_responses  # matplotlib is optional

        draw_responses(measured, fits, options.picture, quantity, unit)
    save_calibration(result, options.output)
    warn(_warnings(calibration, measured, fits) if modality is None else fits[0].warnings)
    say_unused(measured[0].unused)
    for one, fit in zip(measured, fits):
        say(_line(one, fit, options.modality, unit))
    say(f"calibration      {options.output}")
    return DONE


def _of_session(options: argparse.Namespace, calibration: LinkCalibration) -> int:
    """Fit gains and a curve to presses of many taxels at once."""
    touches = read_touch_file(options.measurements, calibration, lambda: mesh_of(options.file, calibration))
    directions, touches = directions_of(calibration, touches)
    try:
        fit = fit_gains(calibration, touches)
    except UnderdeterminedFit as problem:
        raise UnderdeterminedFit(f"'{options.measurements}': {problem}") from problem
    result = with_responses(calibration, {name: fit.responses[name] for name in touches.felt})
    if options.picture:
        from ..pictures.response import draw_gains  # matplotlib is optional

        draw_gains(fit, options.picture)
    save_calibration(result, options.output)
    warn((*(directions.warnings() if directions else ()), *fit.warnings(), *_not_measured(calibration, fit.responses)))
    say_unused(touches.unused)
    warn(touches.notes)
    low, high = fit.common.readings[0], fit.common.readings[-1]
    say(f"usual taxel      table of {len(fit.common.readings)} knots on readings {low:g} to {high:g}")
    say(f"gains            {fit.gains.min():.2f} to {fit.gains.max():.2f} of {len(fit.gains)} taxels")
    errors = f"by the other presses within {fit.rms:.1%} (rms), sum {fit.bias:+.1%}"
    say(f"total force      {fit.used.sum()} of {len(fit.used)} presses; {errors}")
    say(f"calibration      {options.output}")
    return DONE


def with_responses(calibration: LinkCalibration, fitted: dict[str | None, AnyResponse]) -> LinkCalibration:
    """Return a calibration with new responses for single taxels, or one for all taxels."""
    if None in fitted:
        plain = tuple(_with_rows(patch, ()) for patch in calibration.patches)
        return replace(calibration, response=fitted[None], responses=(), patches=plain)
    listed: dict[AnyResponse, int] = {}
    patches = []
    for patch in calibration.patches:
        taxels, rows = patch.taxels, []
        for i, name in enumerate(taxels.ids):
            before = calibration.responses[taxels.responses[i]] if len(taxels.responses) else calibration.response
            rows.append(fitted.get(name, before))
        has_own = len(taxels.responses) > 0 or not fitted.keys().isdisjoint(taxels.ids)
        patches.append(_with_rows(patch, [listed.setdefault(r, len(listed)) for r in rows] if has_own else ()))
    return replace(calibration, patches=tuple(patches), responses=tuple(listed))


def _with_rows(patch: Patch, rows: Sequence[int]) -> Patch:
    return replace(patch, taxels=replace(patch.taxels, responses=np.array(rows, np.int64)))


def _modality(calibration: LinkCalibration, name: str, path: Path) -> Modality:
    """Return the modality of a calibration with a name."""
    known = {modality.name: modality for modality in calibration.modalities}
    if name not in known:
        has = f"It has {', '.join(known)}" if known else "It has none. Add it to the plan, and fit again"
        near = did_you_mean(name, known) or "."
        raise CalibrationFormatError(f"'{path}' has no modality {show(name)}{near} {has}")
    return known[name]


def _fit(measured: Measurements, path: Path, quantity: str, unit: str) -> ResponseFit:
    try:
        return fit_response(measured.readings, measured.forces, quantity, unit)
    except UnderdeterminedFit as problem:
        whose = "" if measured.taxel is None else f", taxel {measured.taxel}"
        raise UnderdeterminedFit(f"'{path}'{whose}: {problem}") from problem


def _line(measured: Measurements, fit: ResponseFit, modality: str | None, unit: str) -> str:
    """Return one line about the fit for one taxel, for all taxels, or of a modality."""
    size = np.abs(fit.residuals)
    return (
        f"{modality or measured.taxel or 'all taxels':16} {fit.kind} on readings {measured.readings.min():g} to "
        f"{measured.readings.max():g}, {len(measured.forces)} measurements; residuals mean {size.mean():.4f}, "
        f"rms {np.sqrt(np.mean(size**2)):.4f}, max {size.max():.4f} {unit}"
    )


def _warnings(
    calibration: LinkCalibration, measured: Sequence[Measurements], fits: Sequence[ResponseFit]
) -> Iterator[Warning]:
    for one, fit in zip(measured, fits):
        for warning in fit.warnings:
            if one.taxel is None:
                yield warning
            else:
                yield replace(
                    warning, message=f"Taxel {one.taxel}: {warning.message}", where=Place(taxels=(one.taxel,))
                )
    named = {one.taxel for one in measured}
    if None in named:
        own = sum(len(patch.taxels.responses) for patch in calibration.patches)
        if own:
            message = f"{own} taxels had responses of their own. The response of all taxels replaces them."
            yield Warning("response-replaced", "warning", message, value=float(own))
        return
    yield from _not_measured(calibration, named)


def _not_measured(calibration: LinkCalibration, named: Collection[str | None]) -> Iterator[Warning]:
    """Yield a warning about taxels that are not in a file."""
    left = tuple(name for patch in calibration.patches for name in patch.taxels.ids if name not in named)
    if left:
        message = f"{len(left)} taxels have no measurement and keep their response; the first is {left[0]}."
        yield Warning("not-measured", "warning", message, Place(taxels=left), float(len(left)))
