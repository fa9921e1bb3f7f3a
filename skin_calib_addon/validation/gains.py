r"""Response of all taxels from presses whose total force is known: one monotone curve, and a gain for each taxel.

A force sensor measures the sum of what all cells carry. Along the mean normal :math:`\bar{\mathbf{n}}_j` of press j

.. math::

    F_j = \sum_i g_i\, (\mathbf{n}_i \cdot \bar{\mathbf{n}}_j)\, \varphi(r_{ij}), \qquad
    g_i \sim N(1, s^2), \quad \varphi \text{ nondecreasing}, \quad \varphi(0) = 0

with readings :math:`r` above those at rest. The spread :math:`s` of the gains is the most probable one, so that a taxel
that few presses load has a gain near one.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from ..calibration.model import LinkCalibration
from ..calibration.response import ResponseTable
from ..calibration.response_fit import HYSTERESIS_STANDARD_ERRORS, POOR_RESIDUAL_FRACTION
from ..common.arrays import Array, BoolArray, unit, usual_size
from ..common.errors import UnderdeterminedFit
from ..common.warnings import Place, Warning
from .touches import Touches, of_taxels

MIN_PRESSES = 10  # Larger: refuses short sessions.
KNOT_COUNTS = (1, 2, 4, 8, 12)  # Intervals of curves that are compared. More: slower, and curves with more bends.
PRESSES_PER_KNOT = 8  # Larger: simpler curves from few presses.
FOLDS = 5  # of the cross-validation. Larger: slower.
# [1] Usual spread of gains, and by which factor it varies. Larger: gains from few presses differ more.
USUAL_SPREAD, SPREAD_FACTOR = 0.15, 2.0
SPREADS = np.geomspace(0.01, 0.5, 24)  # that are compared. Larger: accepts sensors that differ more.
ROUNDS = 20  # of curve, gains and weights. Larger: no effect after convergence.
TOLERANCE = 0.02  # [1] change of the weights in the last round. Larger: less exact.
# [standard deviations] Residual of a press with weight one half, such as one at an edge. Larger: outliers count more.
ROBUST_SCALE = 3.0
# [fraction of the median force] Presses that are weaker have residuals of this size. Smaller: weak presses count more.
MIN_RELATIVE = 0.3
# [fraction of the largest reading] Least reading of a usual taxel up to which the readings are tared. Larger: takes
# offsets for forces.
MAX_REST_READING = 0.05
# [fraction of the largest reading] Largest reading of a taxel up to which it has no measurement. Larger: names taxels
# that presses load a little; smaller: noise of dead taxels is a measurement.
MIN_PRESSED = 0.05
# Equal largest readings from which on they are saturated, and their fraction of the presses. Smaller: strong presses
# are left out.
MIN_SATURATED, SATURATED_FRACTION = 3, 0.02
# [fraction of the force of a press] Difference of loading and unloading that is hysteresis. Larger: fewer warnings.
HYSTERESIS_FRACTION = 0.03
# [fraction of the force of a press] between which it rises and falls. Wider: more rows, those at rest included.
RAMP = (0.2, 0.7)


@dataclass(frozen=True, eq=False)
class GainFit:
    """Responses of taxels, and their errors for presses that had no part in the fit."""

    ids: tuple[str, ...]  # of all taxels with readings
    common: ResponseTable  # with the gain one
    responses: dict[str, ResponseTable]  # by these ids, each from the rest of its taxel
    pressed: BoolArray  # (k,) taxels with a measurement; the others have the gain of a usual taxel
    gains: Array  # of the taxels that were pressed
    spread: float  # standard deviation of the gains
    used: BoolArray  # (m,) presses
    forces: Array  # (m,) along the mean normal [N]
    predicted: Array  # (m,) of these forces, without the press itself [N]
    hysteresis: float | None  # loading minus unloading, fraction of the force of a press; None: not significant
    saturated: int  # presses with saturated readings
    unfelt: BoolArray  # (m,) presses with a force and without a reading; their predicted force is zero

    @property
    def errors(self) -> Array:
        """Relative errors of the predicted forces of presses that were used or not felt."""
        return (self.predicted / self.forces - 1)[self.used | self.unfelt]

    @property
    def rms(self) -> float:
        """Root mean square of the relative errors."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def bias(self) -> float:
        """Relative error of the sum of all forces."""
        rows = self.used | self.unfelt
        return float(self.predicted[rows].sum() / self.forces[rows].sum() - 1)

    def warnings(self) -> Iterator[Warning]:
        """Yield warnings for the author."""
        if self.saturated:
            message = f"{self.saturated} presses have readings at the upper end of the range, and are not used."
            yield Warning("saturated", "warning", message, value=float(self.saturated), advice="Press with less force.")
        if self.unfelt.any():
            message = f"No taxel felt {self.unfelt.sum()} of {len(self.forces)} presses, of up to "
            message += f"{self.forces[self.unfelt].max():.2g} N. They count as errors of 100 %."
            advice = "Press on the skin only. Sensors with a dead zone miss weak forces."
            yield Warning("unfelt", "warning", message, value=float(self.unfelt.sum()), advice=advice)
        if self.hysteresis is not None:
            more = "larger" if self.hysteresis > 0 else "smaller"
            message = f"At the same readings the force is {more} while it rises than while it falls, by "
            message += f"{abs(self.hysteresis):.0%} of that of a press: hysteresis, or a delay of one sensor. "
            message += "The responses are those of presses that last."
            yield Warning("hysteresis", "warning", message, value=self.hysteresis)
        if self.rms > POOR_RESIDUAL_FRACTION:
            message = f"The readings give the total force within {self.rms:.0%} (rms)."
            advice = "Check the columns, the order of the channels, and that the probe presses on the skin only."
            yield Warning("poor-response", "warning", message, value=self.rms, advice=advice)
        left = tuple(name for name, is_pressed in zip(self.ids, self.pressed) if not is_pressed)
        if left:
            message = (
                f"{len(left)} taxels have no measurement, and the response of a usual taxel; the first is {left[0]}."
            )
            yield Warning("not-measured", "warning", message, Place(taxels=left), float(len(left)))


def fit_gains(calibration: LinkCalibration, touches: Touches) -> GainFit:
    """Fit the response of each taxel to the total forces of presses with the readings of all taxels."""
    recording = touches.recording
    if recording is None or not touches.felt or not len(touches.wrenches):
        message = "a session for the response needs the readings of all taxels of a skin, in columns with their ids"
        raise UnderdeterminedFit(f"{message}, and fx, fy, fz, tx, ty, tz")
    readings = touches.readings
    least = float(np.median(readings.min(axis=0)))
    if recording.rest is None and least > MAX_REST_READING * readings.max():
        message = f"a usual taxel never reads less than {least:g}. Record a second without contact first"
        raise UnderdeterminedFit(f"{message}, as rows without a number of the press if the others have one")
    rest = np.zeros(readings.shape[1]) if recording.rest is None else recording.rest
    normals, cosines = _directions(calibration, touches)
    forces = (touches.wrenches[:, :3] * normals).sum(axis=1)
    raw = recording.sign * readings + rest
    # of the strongest taxel: one that is stuck is not saturated
    top = recording.sign * np.take_along_axis(raw, readings.argmax(axis=1)[:, None], axis=1)[:, 0]
    is_felt, full = (readings > 0).any(axis=1), top == top.max()
    forces = np.where(is_felt, forces, np.linalg.norm(touches.wrenches[:, :3], axis=1))  # without a mean normal
    full &= is_felt & (full.sum() >= max(MIN_SATURATED, SATURATED_FRACTION * len(full)))
    used, unfelt = is_felt & (forces > 0) & ~full, ~is_felt & (forces > 0)
    if used.sum() < MIN_PRESSES:
        reasons = f"{full.sum()} are saturated, no taxel felt {(~is_felt).sum()}, {(forces <= 0).sum()} pull"
        message = f"{used.sum()} of {len(used)} presses can be used, which are too few; {reasons}"
        raise UnderdeterminedFit(f"{message}. Record {MIN_PRESSES} or more")
    loads = _Loads(np.maximum(readings[used], 0.0), cosines[used], forces[used])
    knots, by_others = loads.best()
    fitted = loads.fit(knots)
    predicted = np.where(unfelt, 0.0, np.nan)
    predicted[used] = by_others
    pressed = loads.readings.max(axis=0) > MIN_PRESSED * loads.readings.max()
    heights = np.concatenate(([0.0], np.cumsum(fitted.slopes * np.diff(knots))))
    tables = {
        name: _table(knots, gain * heights, recording.sign, at_rest)
        for name, gain, at_rest in zip(touches.felt, np.where(pressed, fitted.gains, 1.0), rest.tolist())
    }
    return GainFit(
        touches.felt,
        _table(knots, heights, recording.sign, float(np.median(rest))),
        tables,
        pressed,
        fitted.gains[pressed],
        fitted.spread,
        used,
        forces,
        predicted,
        _hysteresis(touches, fitted, knots, normals, cosines),
        int(full.sum()),
        unfelt,
    )


def _table(knots: Array, heights: Array, sign: int, rest: float) -> ResponseTable:
    order = slice(None, None, sign)
    return ResponseTable(tuple((rest + sign * knots)[order].tolist()), tuple(heights[order].tolist()))


def _directions(calibration: LinkCalibration, touches: Touches) -> tuple[Array, Array]:
    """Return the directions of forces (m, 3), along the mean normals, and cosines (m, k) of these with the taxels'."""
    normals = of_taxels(calibration, touches.felt, "normals_link")
    mean = unit(np.maximum(touches.readings, 0.0) @ normals)
    is_reaction = np.median((touches.wrenches[:, :3] * mean).sum(axis=1)) > 0
    return (mean if is_reaction else -mean), mean @ normals.T


@dataclass(frozen=True, eq=False)
class _Curve:
    slopes: Array  # (n,) between knots [N per reading]
    gains: Array  # (k,)
    spread: float  # of the gains

    def loads(self, readings: Array, knots: Array) -> Array:
        """Return forces of readings (..., k) without the gains [N]."""
        return _ramps(readings, knots) @ self.slopes


def _ramps(readings: Array, knots: Array) -> Array:
    """Return the part of readings in each interval of knots, shape (..., n)."""
    return np.clip(readings[..., None] - knots[:-1], 0.0, np.diff(knots))


@dataclass(frozen=True, eq=False)
class _Loads:
    """Readings (m, k) of presses, cosines (m, k) of the taxels with the force, and forces (m,) [N]."""

    readings: Array
    cosines: Array
    forces: Array

    def of(self, rows: BoolArray) -> "_Loads":
        return _Loads(self.readings[rows], self.cosines[rows], self.forces[rows])

    def knots(self, count: int) -> Array:
        """Return knots between which cells carry similar parts of all readings."""
        values = np.sort(self.readings[self.readings > 0])
        parts = np.interp(np.arange(1, count) / count, np.cumsum(values) / values.sum(), values)
        return np.unique(np.concatenate(([0.0], parts, values[-1:])))

    def best(self) -> tuple[Array, Array]:
        """Return the knots of the simplest curve within a standard error of the best, and forces (m,) by the others."""
        tried = [self.knots(n) for n in KNOT_COUNTS if n == 1 or n * PRESSES_PER_KNOT <= len(self.forces)]
        forces = [self.predicted(knots) for knots in tried]
        errors = [np.abs(found / self.forces - 1) for found in forces]
        least = min(errors, key=np.mean)
        more = [error - least for error in errors]
        k = next(k for k, a in enumerate(more) if a.mean() <= a.std() / np.sqrt(len(a)))
        return tried[k], forces[k]

    def predicted(self, knots: Array) -> Array:
        """Return the force of each press by the others (m,) [N]."""
        fold, out = np.arange(len(self.forces)) % FOLDS, np.empty(len(self.forces))
        for k in range(FOLDS):
            rows = fold == k
            curve = self.of(~rows).fit(knots)
            out[rows] = (self.cosines[rows] * curve.loads(self.readings[rows], knots)) @ curve.gains
        return out

    def fit(self, knots: Array) -> _Curve:
        """Return curve and gains, by turns, with less weight for presses that fit badly."""
        ramps = self.cosines[..., None] * _ramps(self.readings, knots)  # (m, k, n)
        gains, spread, weights = np.ones(self.readings.shape[1]), 0.0, np.ones(len(self.forces))
        scale = np.maximum(self.forces, MIN_RELATIVE * np.median(self.forces))
        for _ in range(ROUNDS):
            root = np.sqrt(weights) / scale
            slopes, _ = nnls(root[:, None] * np.einsum("mkn,k->mn", ramps, gains), root * self.forces)
            loads = ramps @ slopes
            gains, spread = _gains(root[:, None] * loads, root * (self.forces - loads.sum(axis=1)))
            residuals = (self.forces - loads @ gains) / scale
            usual = max(ROBUST_SCALE * float(usual_size(residuals)), 1e-9)
            before, weights = weights, 1 / (1 + (residuals / usual) ** 2)
            if np.abs(weights - before).max() < TOLERANCE:
                break
        return _Curve(slopes, gains, spread)


def _gains(loads: Array, residuals: Array) -> tuple[Array, float]:
    """Return gains (k,) near one with their most probable spread, for ``residuals = loads @ (gains - 1)``."""
    values, vectors = np.linalg.eigh(loads @ loads.T)
    projected = vectors.T @ residuals
    variance = np.maximum(values, 0.0)
    least = 1e-4 + 1e-3 * float(np.abs(residuals).max(initial=0.0))
    noises = np.geomspace(least, max(float(residuals.std()), 2 * least), len(SPREADS))
    total = (noises**2)[:, None, None] + (SPREADS**2)[:, None] * variance
    prior = (np.log(SPREADS / USUAL_SPREAD) / np.log(SPREAD_FACTOR)) ** 2
    costs = np.log(total).sum(axis=2) + (projected**2 / total).sum(axis=2) + prior
    a, b = np.unravel_index(costs.argmin(), costs.shape)
    spread = float(SPREADS[b])
    return np.maximum(1 + spread**2 * loads.T @ (vectors @ (projected / total[a, b])), 0.0), spread


def _hysteresis(touches: Touches, curve: _Curve, knots: Array, normals: Array, cosines: Array) -> float | None:
    """Return how much larger forces are while they rise, at the same readings, as a fraction of those of presses."""
    assert touches.recording is not None
    recorded, numbers = touches.recording.recorded, touches.recording.numbers
    assert recorded.wrenches is not None
    strengths = np.linalg.norm(recorded.wrenches[:, :3], axis=1)
    starts = np.searchsorted(recorded.lines, touches.lines).tolist()
    ends = [k + int(np.flatnonzero(numbers[k:] == numbers[k])[-1]) + 1 for k in starts]
    pauses = [a + int(np.argmin(strengths[a:b])) if b > a else a for a, b in zip(ends, [*starts[1:], len(numbers)])]
    differences = []
    for j, (start, end) in enumerate(zip(starts, ends)):
        most = float(touches.wrenches[j, :3] @ normals[j])
        errors = []
        for rows in (np.arange(pauses[j - 1] if j else 0, start), np.arange(end, pauses[j])):
            along = recorded.wrenches[rows, :3] @ normals[j]
            part = (along > RAMP[0] * most) & (along < RAMP[1] * most)
            loads = curve.loads(recorded.readings[rows[part]], knots)
            errors.append((along[part] - (cosines[j] * loads) @ curve.gains) / most)
        if min(map(len, errors)) >= 2:
            differences.append(float(errors[0].mean() - errors[1].mean()))
    if len(differences) < MIN_PRESSES:
        return None
    mean, error = np.mean(differences), np.std(differences) / np.sqrt(len(differences))
    return float(mean) if abs(mean) > max(HYSTERESIS_FRACTION, HYSTERESIS_STANDARD_ERRORS * error) else None
