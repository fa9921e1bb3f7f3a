"""Fit the response of a sensor: the simplest monotone function within the error of the best by cross-validation."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray
from ..common.errors import UnderdeterminedFit
from ..common.warnings import Warning
from .parts import STORED_ROUNDING
from .response import AnyResponse, Response, ResponseTable
from .response_checks import is_monotone

MAX_DEGREE = 7  # of a polynomial. Larger: responses with more bends are still polynomials.
KNOT_COUNTS = (3, 4, 6, 8, 12, 16, 24)  # sizes of tables that are compared. More: slower, and tables with more rows.
FOLDS = 10  # of the cross-validation. Larger: slower, and less random error.
# Fraction of the smallest mean squared error by which another may be larger. Larger: simpler responses.
ERROR_TOLERANCE = 0.02
# Rounding errors of a polynomial in powers of the reading, in units of STORED_ROUNDING. Larger: higher degrees.
POWERS_ROUNDING_RATIO = 100
# [fraction of the force range] spread of the forces at the first or last reading above which these measurements are
# unusable. Larger: fewer saturated sensors and dead zones are detected.
STUCK_FORCE_SPREAD = 0.05
# [usual spreads at one reading] the spread must also exceed this multiple. Larger: as above.
STUCK_EXCESS = 3.0
MIN_MEASUREMENTS = 10  # fewer give a warning
# Fewer different readings give a warning, and fewer measurements at the first or last reading are usable in any case.
MIN_READINGS = 5
READING_GAP = 0.2  # fraction of the range of readings. Larger: fewer warnings about gaps.
# [force range] difference of loading and unloading from which on it is hysteresis. Larger: fewer warnings.
HYSTERESIS_FRACTION = 0.01
# [standard errors] of this difference that it must exceed, too. Larger: fewer warnings.
HYSTERESIS_STANDARD_ERRORS = 4.0
# [1] Fraction of the measurements at which the force turns, from which on a large scatter is no hysteresis: of forces
# in any order the larger ones follow a rise. Larger: more scatter is called hysteresis.
MAX_TURNS = 1 / 3
HYSTERESIS_BINS = 8  # intervals of readings in which loading and unloading are compared. Larger: fewer pairs in each.
POOR_RESIDUAL_FRACTION = 0.3  # of the standard deviation of the forces. Larger: fewer warnings about poor fits.
# of the standard deviation of the forces: residuals from which on the readings hardly depend on the force. Larger: the
# warning states scatter instead.
INDEPENDENT_RESIDUAL_FRACTION = 0.8


@dataclass(frozen=True, eq=False)
class ResponseFit:
    """A response, and its deviations from the measurements."""

    response: AnyResponse
    used: BoolArray  # (n,) False for unusable measurements of a saturated or insensitive sensor
    residuals: Array  # (m,) measured minus predicted force of the used measurements [N]
    warnings: tuple[Warning, ...]

    @property
    def kind(self) -> str:
        """Return a short description of the response."""
        if isinstance(self.response, ResponseTable):
            return f"table of {len(self.response.readings)} knots"
        return f"polynomial of degree {len(self.response.coefficients) - 1}"


def fit_response(readings: Array, forces: Array, quantity: str = "force", unit: str = "N") -> ResponseFit:
    r"""Fit the force F as a function of the reading I by least squares.

    .. math:: \min_F \sum_i \bigl(f_i - F(I_i)\bigr)^2

    over polynomials F of degree 1 to `MAX_DEGREE` and piecewise linear functions with `KNOT_COUNTS` knots.

    The result is a polynomial that is monotone between the smallest and the largest reading. Its cross-validation error
    is within one standard error of the best function. Of several such polynomials, the result has the smallest degree.
    If there is none, the result is a monotone table with the smallest sufficient number of knots.
    """
    readings, forces = np.asarray(readings, float), np.asarray(forces, float)
    if len(readings) < 2 or np.ptp(readings) == 0 or np.ptp(forces) == 0:
        raise UnderdeterminedFit(
            f"{_missing_variation(readings, forces, unit)}. Measure at two or more {quantity}s with different readings."
        )
    sign = -1.0 if np.sum((readings - readings.mean()) * (forces - forces.mean())) < 0 else 1.0
    full, rest = _stuck(sign * readings, forces), _stuck(-sign * readings, forces)
    used = ~(full | rest)
    targets = forces.copy()
    if rest.any():  # the smallest force of the dead zone, so that a sensor at rest gives no contact
        targets[rest] = forces[readings == readings[rest][0]].min()
    with np.errstate(all="ignore"):  # nearly equal readings may overflow, which counts as a large error
        response = _best(readings[~full], targets[~full], sign)
    residuals = forces[used] - predicted(response, readings[used], quantity)
    warnings = tuple(_warnings(response, readings, forces, used, residuals, quantity, unit))
    return ResponseFit(response, used, residuals, warnings)


def predicted(response: AnyResponse, readings: Any, quantity: str) -> Array:
    """Return forces, or values of another quantity, of readings of any shape."""
    return response.newtons(readings) if quantity == "force" else response.values(readings)


def _missing_variation(readings: Array, forces: Array, unit: str) -> str:
    """Describe why no response can be fitted."""
    if len(readings) < 2:
        return ("there is no measurement", "there is one measurement")[len(readings)]
    what = f"read {readings[0]:g}" if np.ptp(readings) == 0 else f"are of {forces[0]:g} {unit}"
    return f"all {len(readings)} measurements {what}"


def _stuck(readings: Array, forces: Array) -> BoolArray:
    """Return which measurements at the largest reading are unusable because their forces differ too much.

    The measurement with the smallest force is kept: it marks the start of saturation, or the end of the dead zone.
    """
    at_end = readings == readings.max()
    stuck = np.zeros(len(readings), bool)
    if at_end.sum() < MIN_READINGS:
        return stuck
    spreads = [np.ptp(forces[readings == x]) for x in np.unique(readings[~at_end]) if (readings == x).sum() >= 3]
    usual = float(np.median(spreads)) if spreads else 0.0
    if np.ptp(forces[at_end]) > max(STUCK_FORCE_SPREAD * np.ptp(forces), STUCK_EXCESS * usual):
        stuck |= at_end
        stuck[np.flatnonzero(at_end)[np.argmin(forces[at_end])]] = False
    return stuck


def _best(readings: Array, forces: Array, sign: float) -> AnyResponse:
    """Return the simplest response that is as good as the best one in cross-validation."""
    distinct = len(np.unique(readings))
    degrees = range(1, max(1, min(MAX_DEGREE, (distinct - 1) // 2)) + 1)
    counts = [k for k in KNOT_COUNTS if k <= distinct] or [2]
    if len(readings) == 2:
        return _table(*_knots(readings, forces, sign, [2])[0], sign)
    errors = _squares(readings, forces, degrees, counts, sign)
    floor = (STORED_ROUNDING * float(np.ptp(forces))) ** 2
    best = min(errors.values(), key=np.mean)
    for degree in degrees:
        if _is_as_good(errors[degree, 0], best, floor):
            polynomial = _in_powers(readings, forces, degree)
            if polynomial is not None:
                return polynomial
    best = min((errors[0, k] for k in counts), key=np.mean)
    count = next(k for k in counts if _is_as_good(errors[0, k], best, floor))
    return _table(*_knots(readings, forces, sign, [count])[0], sign)


def _is_as_good(squares: Array, best: Array, floor: float) -> bool:
    """Return whether squared errors exceed the best ones by at most one standard error of the difference."""
    more = squares - best
    standard_error = more.std(ddof=1) / np.sqrt(len(more)) if len(more) > 1 else 0.0
    return bool(more.mean() <= max(standard_error, ERROR_TOLERANCE * best.mean(), floor))


def _squares(
    readings: Array, forces: Array, degrees: range, counts: list[int], sign: float
) -> dict[tuple[int, int], Array]:
    """Return cross-validation errors (n - 2,) [N^2] by (degree, 0) of polynomials and (0, knots) of tables.

    The smallest and the largest reading are never left out because no response is needed outside.
    """
    inner = np.lexsort((forces, sign * readings))[1:-1]
    fold = np.full(len(readings), -1)
    fold[inner] = np.arange(len(inner)) % FOLDS
    errors = {**{(d, 0): forces.copy() for d in degrees}, **{(0, k): forces.copy() for k in counts}}
    for k in range(min(FOLDS, len(inner))):
        out = fold == k
        kept, left = (readings[~out], forces[~out]), readings[out]
        predicted = [_polynomial(*kept, d)(left) for d in degrees]
        predicted += [np.interp(sign * left, *knots) for knots in _knots(*kept, sign, counts)]
        for error, force in zip(errors.values(), predicted):
            error[out] -= force
    return {simplicity: error[fold >= 0] ** 2 for simplicity, error in errors.items()}


def _polynomial(readings: Array, forces: Array, degree: int) -> np.polynomial.Chebyshev:
    """Return the least-squares polynomial; with ``full``, NumPy does not warn of few different readings."""
    domain = [readings.min(), readings.max()]
    return np.polynomial.Chebyshev.fit(readings, forces, degree, domain=domain, full=True)[0]


def _in_powers(readings: Array, forces: Array, degree: int) -> Response | None:
    """Return the polynomial in powers of the reading; None if it is not monotone or loses accuracy."""
    low, high = float(readings.min()), float(readings.max())
    fitted = _polynomial(readings, forces, degree)
    powers = fitted.convert(kind=np.polynomial.Polynomial).coef
    deviation = np.abs(np.polynomial.polynomial.polyval(readings, powers) - fitted(readings)).max()
    if not deviation <= POWERS_ROUNDING_RATIO * STORED_ROUNDING * np.ptp(forces) or not is_monotone(powers, low, high):
        return None
    return Response(tuple(powers.tolist()), (low, high))


def _knots(readings: Array, forces: Array, sign: float, counts: list[int]) -> list[tuple[Array, Array]]:
    """Return a monotone table (readings, forces) for each number of knots.

    Readings of a sensor whose readings fall with force are negated. Each new knot is at the largest weighted deviation
    between the isotonic regression and the current table. The forces are the isotonic regression of the least-squares
    forces at the knots.
    """
    x, group, weight = np.unique(sign * readings, return_inverse=True, return_counts=True)
    mean = np.bincount(group, forces) / weight
    smooth = _isotonic(mean, weight.astype(float))
    chosen, tables = [0, len(x) - 1], []
    for count in counts:
        while len(chosen) < min(count, len(x)):
            at = np.sort(chosen)
            deviations = np.abs(smooth - np.interp(x, x[at], smooth[at])) * np.sqrt(weight)
            deviations[chosen] = -1.0
            chosen.append(int(np.argmax(deviations)))
        at = np.sort(chosen)
        hats = np.array([np.interp(x, x[at], unit) for unit in np.eye(len(at))]).T
        root = np.sqrt(weight)
        heights = np.linalg.lstsq(hats * root[:, None], mean * root, rcond=None)[0]
        tables.append((x[at], _isotonic(heights, weight @ hats)))
    return tables


def _table(x: Array, heights: Array, sign: float) -> ResponseTable:
    order = slice(None, None, int(sign))
    return ResponseTable(tuple((sign * x + 0.0)[order].tolist()), tuple(heights[order].tolist()))


def _isotonic(values: Array, weights: Array) -> Array:
    """Return the nondecreasing sequence with the smallest weighted squared distance (pool adjacent violators)."""
    blocks: list[tuple[float, float, int]] = []  # mean, weight, how many
    for value, weight in zip(values.tolist(), weights.tolist()):
        block = (value, weight, 1)
        while blocks and blocks[-1][0] >= block[0]:
            mean, others, many = blocks.pop()
            total = others + block[1]
            block = ((mean * others + block[0] * block[1]) / total, total, many + block[2])
        blocks.append(block)
    return np.repeat(np.array([block[0] for block in blocks]), [block[2] for block in blocks])


def _warnings(
    response: AnyResponse,
    readings: Array,
    forces: Array,
    used: BoolArray,
    residuals: Array,
    quantity: str,
    unit: str,
) -> Iterator[Warning]:
    """Yield warnings about the measurements and the fit."""
    distinct, span = np.unique(readings), float(np.ptp(forces))
    if len(readings) < MIN_MEASUREMENTS or len(distinct) < MIN_READINGS:
        message = f"There are only {len(readings)} measurements at {len(distinct)} readings."
        advice = f"Take {MIN_MEASUREMENTS} or more, spread over all {quantity}s."
        yield Warning("few-measurements", "warning", message, value=float(len(readings)), advice=advice)
    for end, code, cause in (
        (response.full, "saturated", "The sensor is saturated there"),
        (response.rest, "dead-zone", f"The sensor does not react to smaller {quantity}s"),
    ):
        count = int((~used & (readings == end)).sum())
        if count:
            between, force = forces[readings == end], float(predicted(response, end, quantity))
            yield Warning(
                code,
                "warning",
                f"{count + 1} measurements of {between.min():.3g} to {between.max():.3g} {unit} all read {end:g}. "
                f"{cause}, and the response gives {force:.3g} {unit}.",
                value=force,
            )
    wide = int(np.argmax(np.diff(distinct)))
    if distinct[wide + 1] - distinct[wide] > READING_GAP * np.ptp(distinct) and len(distinct) >= MIN_READINGS:
        yield Warning(
            "reading-gap",
            "warning",
            f"No measurement reads between {distinct[wide]:g} and {distinct[wide + 1]:g}. "
            f"The {quantity} there is interpolated.",
            value=float(distinct[wide + 1] - distinct[wide]),
            advice=f"Measure {quantity}s in between.",
        )
    loads, limit = _loads(forces)[used], POOR_RESIDUAL_FRACTION * forces[used].std()
    scatter = float(np.sqrt(np.mean(residuals**2)))
    (difference, most), error, rest = _hysteresis(readings[used], residuals, loads)
    if scatter > limit and np.count_nonzero(np.diff(loads)) > MAX_TURNS * len(loads):
        difference, rest = 0.0, scatter
    if abs(difference) > max(HYSTERESIS_FRACTION * span, HYSTERESIS_STANDARD_ERRORS * error):
        more = "larger" if difference > 0 else "smaller"
        yield Warning(
            "hysteresis",
            "warning",
            f"At the same reading the {quantity} is {abs(difference):.3g} {unit} {more} while it rises than while it "
            f"falls, and at most {abs(most):.3g} {unit}, {abs(most) / span:.0%} of its range (hysteresis). "
            "The response lies between the two.",
            value=float(difference),
        )
    if rest > limit:
        message = (
            f"At the same reading the {quantity} scatters by {rest:.3g} {unit} (rms), {rest / span:.0%} of its range."
        )
        if rest > INDEPENDENT_RESIDUAL_FRACTION * forces[used].std():
            message = f"The readings hardly depend on the {quantity}."
        yield Warning(
            "poor-response",
            "warning",
            message,
            advice="Check the columns, and that the readings belong to the taxel.",
        )


def _loads(forces: Array) -> IntArray:
    """Return 1 if the last change of the force was an increase, -1 if a decrease, 0 before any change."""
    steps = np.sign(np.diff(forces, prepend=forces[:1])).astype(np.int64)
    last = np.maximum.accumulate(np.where(steps != 0, np.arange(len(steps)), 0))
    return steps[last]


def _hysteresis(readings: Array, residuals: Array, loads: IntArray) -> tuple[tuple[float, float], float, float]:
    """Return how much loading differs from unloading at similar readings [N], and what this leaves of the residuals.

    The results are the mean and the largest loading minus unloading residual, the standard error of the mean, and the
    rms of the residuals about those of their direction, all in newtons.
    """
    rank = np.argsort(np.argsort(readings, kind="stable"), kind="stable")
    bins = rank * HYSTERESIS_BINS // len(readings)
    differences, weights, freedom, left = [], [], 0, residuals.copy()
    squares = 0.0
    for k in range(HYSTERESIS_BINS):
        up, down = ((bins == k) & (loads == direction) for direction in (1, -1))
        count_up, count_down = int(up.sum()), int(down.sum())
        if min(count_up, count_down) >= 2:
            differences.append(residuals[up].mean() - residuals[down].mean())
            weights.append(count_up * count_down / (count_up + count_down))
            squares += count_up * residuals[up].var() + count_down * residuals[down].var()
            freedom += count_up + count_down - 2
            for rows, weight in ((up, count_down), (down, -count_up)):  # their mean stays
                left[rows] -= differences[-1] * weight / (count_up + count_down)
    rms = float(np.sqrt(np.mean(left**2)))
    if freedom < HYSTERESIS_BINS:
        return (0.0, 0.0), 0.0, float(np.sqrt(np.mean(residuals**2)))
    most = differences[int(np.abs(differences).argmax())]
    mean = float(np.average(differences, weights=weights))
    return (mean, float(most)), float(np.sqrt(squares / freedom / sum(weights))), rms
