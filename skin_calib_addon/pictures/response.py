"""Picture of fitted responses: measurements, curves and residuals."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..calibration.measurements import Measurements
from ..calibration.response_fit import ResponseFit, predicted
from ..validation.gains import GainFit
from .calibration import blank, save_png

# Points of a drawn curve. Larger: smoother.
RESPONSE_CURVE_POINTS = 400
# Largest number of curves with their own colours and names.
MAX_CURVES_NAMED = 10


def draw_responses(
    measured: Sequence[Measurements],
    fits: Sequence[ResponseFit],
    path: str | Path,
    quantity: str = "force",
    unit: str = "N",
) -> None:
    """Draw forces over readings with the fitted curves, and the residuals, into a PNG file."""
    figure = blank(11, 4.6)
    curves, errors = figure.subplots(1, 2)
    for k, (one, fit) in enumerate(zip(measured, fits)):
        colour = f"C{k % MAX_CURVES_NAMED}" if len(fits) <= MAX_CURVES_NAMED else "C0"
        alpha = 1.0 if len(fits) <= MAX_CURVES_NAMED else 0.3
        x = np.linspace(one.readings.min(), one.readings.max(), RESPONSE_CURVE_POINTS)
        label = fit.kind if one.taxel is None else f"{one.taxel}: {fit.kind}"
        curves.plot(one.readings[fit.used], one.forces[fit.used], ".", color=colour, alpha=0.5 * alpha, markersize=4)
        curves.plot(one.readings[~fit.used], one.forces[~fit.used], "x", color="#d62728", alpha=alpha, markersize=4)
        curves.plot(x, predicted(fit.response, x, quantity), color=colour, alpha=alpha, linewidth=1.3, label=label)
        errors.plot(one.readings[fit.used], fit.residuals, ".", color=colour, alpha=0.6 * alpha, markersize=4)
    errors.axhline(0.0, color="0.4", linewidth=0.8)
    for axis, label in ((curves, f"{quantity} [{unit}]"), (errors, f"residual, measured minus fitted [{unit}]")):
        axis.set_xlabel("reading")
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    if len(fits) <= MAX_CURVES_NAMED:
        curves.legend(fontsize=8)
    residuals = np.concatenate([fit.residuals for fit in fits])
    curves.set_title(f"{sum(len(one.forces) for one in measured)} measurements")
    errors.set_title(f"rms {np.sqrt(np.mean(residuals**2)):.3g} {unit}, largest {np.abs(residuals).max():.3g} {unit}")
    figure.tight_layout()
    save_png(figure, path)


def draw_gains(fit: GainFit, path: str | Path) -> None:
    """Draw the response of each taxel, and the total forces by the other presses, into a PNG file."""
    figure = blank(11, 4.6)
    curves, totals = figure.subplots(1, 2)
    for response in fit.responses.values():
        curves.plot(response.readings, response.forces, color="C0", alpha=0.3, linewidth=0.8)
    curves.plot(fit.common.readings, fit.common.forces, color="#d62728", linewidth=2, label="usual taxel")
    curves.set_xlabel("reading")
    curves.set_ylabel("force [N]")
    curves.set_title(f"{len(fit.gains)} taxels, gains {fit.gains.min():.2f} to {fit.gains.max():.2f}")
    measured, computed = fit.forces[fit.used], fit.predicted[fit.used]
    totals.plot([0, measured.max()], [0, measured.max()], color="0.4", linewidth=0.8)
    totals.plot(measured, computed, ".", color="C0", alpha=0.6, markersize=4)
    totals.set_xlabel("measured total force [N]")
    totals.set_ylabel("force by the other presses [N]")
    totals.set_title(f"{len(measured)} presses, rms {fit.rms:.1%}, sum {fit.bias:+.1%}")
    for axis in (curves, totals):
        axis.grid(alpha=0.3)
    curves.legend(fontsize=8)
    figure.tight_layout()
    save_png(figure, path)
