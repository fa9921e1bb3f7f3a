"""Picture of fitted responses: measurements, curves and residuals."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..calibration.measurements import Measurements
from ..calibration.response_fit import ResponseFit, predicted
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
