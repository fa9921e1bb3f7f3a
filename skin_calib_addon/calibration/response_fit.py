"""Fit the response of a sensor to measurements: the simplest monotone one that tells forces as well as any."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray
from ..common.errors import UnderdeterminedFit
from ..common.warnings import Warning
from .response import AnyResponse, Response, ResponseTable
from .response_checks import is_monotone

MOST_DEGREE = 7
KNOTS = (3, 4, 6, 8, 12, 16, 24)
FOLDS = 10
# An error is as good as another within a standard error of their difference, or within this share of its square.
ALIKE = 0.02
EXACT = (
    1e-9  # of the forces: errors below this are rounding, and a polynomial written out may differ by a hundred times
)
# At an end of the readings, measurements that all read the same although their forces spread over more than this share.
STUCK_SPREAD, STUCK_COUNT = 0.05, 4
STUCK_EXCESS = 3.0  # times the spread that single readings have elsewhere
FEW, FEW_READINGS = 10, 5
GAP = 0.2  # of the range of readings
# Loading and unloading differ if by more than this share of the forces, and than so many standard errors.
HYSTERESIS, HYSTERESIS_ERRORS = 0.01, 4.0
BINS = 8
POOR = 0.3  # of the standard deviation of the forces

Predict = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class ResponseFit:
    """A response, and how it fits the measurements it is of."""

    response: AnyResponse
    used: BoolArray  # (n,) False where a measurement says only that the sensor is full, or does not feel
    residuals: Array  # (m,) of those used, force measured less force told [N]
    warnings: tuple[Warning, ...]

    @property
    def kind(self) -> str:
        """The response in words."""
        if isinstance(self.response, ResponseTable):
            return f"table of {len(self.response.readings)} knots"
        return f"polynomial of degree {len(self.response.coefficients) - 1}"


def fit_response(readings: Array, forces: Array) -> ResponseFit:
    """Fit the force of a reading by least squares.

    The smallest degree of a polynomial that is monotone between the least and the largest reading and, by cross
    validation, as good as any other; else a table, isotonic, with as few knots as are as good as more.

    Parameters
    ----------
    readings : array, shape (n,)
        In the order in which they were taken; only hysteresis is told by it.
    forces : array, shape (n,)
        [N]

    Raises
    ------
    UnderdeterminedFit
        If all readings or all forces are the same, or there are not two.
    """
    readings, forces = np.asarray(readings, float), np.asarray(forces, float)
    if len(readings) < 2 or np.ptp(readings) == 0 or np.ptp(forces) == 0:
        raise UnderdeterminedFit(
            f"{_alike(readings, forces)}; measure at two forces or more that the sensor tells apart"
        )
    sign = -1.0 if np.sum((readings - readings.mean()) * (forces - forces.mean())) < 0 else 1.0
    full, rest = _stuck(sign * readings, forces), _stuck(-sign * readings, forces)
    used = ~(full | rest)
    told = forces.copy()
    if rest.any():  # all of them count as the least force, so that a sensor at rest does not press
        told[rest] = forces[readings == readings[rest][0]].min()
    with np.errstate(all="ignore"):  # readings that are hardly apart: what overflows is found worse than the rest
        response = _best(readings[~full], told[~full], sign)
    residuals = forces[used] - response.newtons(readings[used])
    warnings = tuple(_warnings(response, readings, forces, used, residuals))
    return ResponseFit(response, used, residuals, warnings)


def _alike(readings: Array, forces: Array) -> str:
    """Why there is nothing to fit."""
    if len(readings) < 2:
        return ("there is no measurement", "there is one measurement")[len(readings)]
    what = f"read {readings[0]:g}" if np.ptp(readings) == 0 else f"are of {forces[0]:g} N"
    return f"all {len(readings)} measurements {what}"


def _stuck(readings: Array, forces: Array) -> BoolArray:
    """Measurements at the largest reading that spread over so many forces that it tells none of them.

    The one with the least force is left: from there on the sensor is full; or up to the next reading it is at rest.
    """
    at_end = readings == readings.max()
    stuck = np.zeros(len(readings), bool)
    if at_end.sum() < STUCK_COUNT:
        return stuck
    spreads = [np.ptp(forces[readings == x]) for x in np.unique(readings[~at_end]) if (readings == x).sum() >= 3]
    usual = float(np.median(spreads)) if spreads else 0.0
    if np.ptp(forces[at_end]) > max(STUCK_SPREAD * np.ptp(forces), STUCK_EXCESS * usual):
        stuck |= at_end
        stuck[np.flatnonzero(at_end)[np.argmin(forces[at_end])]] = False
    return stuck


def _best(readings: Array, forces: Array, sign: float) -> AnyResponse:
    """The simplest response that is as good as any by cross validation."""
    distinct = len(np.unique(readings))
    degrees = range(1, max(1, min(MOST_DEGREE, (distinct - 1) // 2)) + 1)
    counts = [k for k in KNOTS if k <= distinct]
    if len(readings) == 2:
        return _table(*_knots(readings, forces, sign, [2])[0], sign)
    errors = _squares(readings, forces, degrees, counts, sign)
    floor = (EXACT * float(np.ptp(forces))) ** 2
    best = min(errors.values(), key=np.mean)
    for degree in degrees:
        if _as_good(errors[degree, 0], best, floor):
            polynomial = _written_out(readings, forces, degree)
            if polynomial is not None:
                return polynomial
    if not counts:
        return _table(*_knots(readings, forces, sign, [2])[0], sign)
    best = min((errors[0, k] for k in counts), key=np.mean)
    count = next(k for k in counts if _as_good(errors[0, k], best, floor))
    return _table(*_knots(readings, forces, sign, [count])[0], sign)


def _as_good(squares: Array, best: Array, floor: float) -> bool:
    """Whether squared errors at the same measurements are no larger than others, as far as these can tell."""
    more = squares - best
    by_chance = more.std(ddof=1) / np.sqrt(len(more)) if len(more) > 1 else 0.0
    return bool(more.mean() <= max(by_chance, ALIKE * best.mean(), floor))


def _squares(
    readings: Array, forces: Array, degrees: range, counts: list[int], sign: float
) -> dict[tuple[int, int], Array]:
    """Squared errors (n - 2,) at measurements left out of the fit, by degree of a polynomial or number of knots.

    The least and the largest reading are never left out: beyond what it is of, no response is asked.
    """
    inner = np.lexsort((forces, sign * readings))[1:-1]
    fold = np.full(len(readings), -1)
    fold[inner] = np.arange(len(inner)) % FOLDS
    errors = {**{(d, 0): forces.copy() for d in degrees}, **{(0, k): forces.copy() for k in counts}}
    for k in range(min(FOLDS, len(inner))):
        out = fold == k
        kept, left = (readings[~out], forces[~out]), readings[out]
        told = [_polynomial(*kept, d)(left) for d in degrees]
        told += [np.interp(sign * left, *knots) for knots in _knots(*kept, sign, counts)]
        for error, force in zip(errors.values(), told):
            error[out] -= force
    return {simplicity: error[fold >= 0] ** 2 for simplicity, error in errors.items()}


def _polynomial(readings: Array, forces: Array, degree: int) -> Predict:
    """The polynomial with the least squares, in Chebyshev's basis."""
    low, high = readings.min(), readings.max()

    def basis(x: Array) -> Array:
        return np.asarray(np.polynomial.chebyshev.chebvander((2 * x - (low + high)) / (high - low), degree), float)

    coefficients = np.linalg.lstsq(basis(readings), forces, rcond=None)[0]
    return lambda x: basis(x) @ coefficients


def _written_out(readings: Array, forces: Array, degree: int) -> Response | None:
    """The same in powers of the reading; None if it turns round, or loses its digits so."""
    low, high = float(readings.min()), float(readings.max())
    fitted = _polynomial(readings, forces, degree)
    places = np.polynomial.chebyshev.chebpts1(degree + 1)
    chebyshev = np.polynomial.chebyshev.chebfit(places, fitted((low + high) / 2 + (high - low) / 2 * places), degree)
    powers = np.polynomial.Chebyshev(chebyshev, domain=(low, high)).convert(kind=np.polynomial.Polynomial).coef
    off = np.abs(np.polynomial.polynomial.polyval(readings, powers) - fitted(readings)).max()
    if not off <= 100 * EXACT * np.ptp(forces) or not is_monotone(powers, low, high):
        return None
    return Response(tuple(powers.tolist()), (low, high))


def _knots(readings: Array, forces: Array, sign: float, counts: list[int]) -> list[tuple[Array, Array]]:
    """Monotone tables of several numbers of knots; their readings are mirrored where the sensor falls.

    Knots go where straight lines between those so far are furthest off the isotonic regression; their forces are those
    of the least squares, made isotonic.
    """
    x, group, weight = np.unique(sign * readings, return_inverse=True, return_counts=True)
    mean = np.bincount(group, forces) / weight
    smooth = _isotonic(mean, weight.astype(float))
    chosen, tables = [0, len(x) - 1], []
    for count in counts:
        while len(chosen) < min(count, len(x)):
            at = np.sort(chosen)
            off = np.abs(smooth - np.interp(x, x[at], smooth[at])) * np.sqrt(weight)
            off[chosen] = -1.0
            chosen.append(int(np.argmax(off)))
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
    """The rising sequence nearest to values, by pooling neighbours that fall."""
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
    response: AnyResponse, readings: Array, forces: Array, used: BoolArray, residuals: Array
) -> Iterator[Warning]:
    """What a person should know before using the fit."""
    distinct, span = np.unique(readings), float(np.ptp(forces))
    if len(readings) < FEW or len(distinct) < FEW_READINGS:
        message = f"There are only {len(readings)} measurements at {len(distinct)} readings."
        advice = f"Take {FEW} or more, spread over all forces."
        yield Warning("few-measurements", "warning", message, value=float(len(readings)), advice=advice)
    for end, code, cause in (
        (response.full, "saturated", "The sensor is saturated there"),
        (response.rest, "dead-zone", "The sensor does not react to smaller forces"),
    ):
        count = int((~used & (readings == end)).sum())
        if count:
            between, force = forces[readings == end], float(response.newtons(end))
            yield Warning(
                code,
                "warning",
                f"{count + 1} measurements of {between.min():.3g} to {between.max():.3g} N all read {end:g}. "
                f"{cause}, and the response gives {force:.3g} N.",
                value=force,
            )
    wide = int(np.argmax(np.diff(distinct)))
    if distinct[wide + 1] - distinct[wide] > GAP * np.ptp(distinct) and len(distinct) >= FEW_READINGS:
        yield Warning(
            "reading-gap",
            "warning",
            f"No measurement reads between {distinct[wide]:g} and {distinct[wide + 1]:g}. "
            "The force there is interpolated.",
            value=float(distinct[wide + 1] - distinct[wide]),
            advice="Measure forces in between.",
        )
    poor = np.sqrt(np.mean(residuals**2)) > POOR * forces[used].std()
    apart, chance = _hysteresis(readings[used], residuals, _loads(forces)[used])
    if abs(apart) > max(HYSTERESIS * span, HYSTERESIS_ERRORS * chance) and not poor:
        more = "larger" if apart > 0 else "smaller"
        yield Warning(
            "hysteresis",
            "warning",
            f"At the same reading the force is {abs(apart):.3g} N {more} while it increases than while it decreases "
            "(hysteresis). The response lies between the two.",
            value=float(apart),
        )
    if poor:
        yield Warning(
            "poor-response",
            "warning",
            "The readings hardly depend on the force.",
            advice="Check that they are of the right taxel, and the columns.",
        )


def _loads(forces: Array) -> IntArray:
    """1 where the force has grown last, -1 where it has fallen, 0 before it changes."""
    steps = np.sign(np.diff(forces, prepend=forces[:1])).astype(np.int64)
    last = np.maximum.accumulate(np.where(steps != 0, np.arange(len(steps)), 0))
    return steps[last]


def _hysteresis(readings: Array, residuals: Array, loads: IntArray) -> tuple[float, float]:
    """How far residuals of loading lie above those of unloading at like readings, and its standard error."""
    rank = np.argsort(np.argsort(readings, kind="stable"), kind="stable")
    place = rank * BINS // len(readings)
    apart = weights = squares = 0.0
    freedom = 0
    for k in range(BINS):
        up, down = (residuals[(place == k) & (loads == way)] for way in (1, -1))
        if min(len(up), len(down)) >= 2:
            weight = len(up) * len(down) / (len(up) + len(down))
            apart += weight * (up.mean() - down.mean())
            weights += weight
            squares += len(up) * up.var() + len(down) * down.var()
            freedom += len(up) + len(down) - 2
    if freedom < BINS:
        return 0.0, 0.0
    return apart / weights, float(np.sqrt(squares / freedom / weights))
