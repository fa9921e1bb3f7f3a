"""The smallest grid within a tolerance: predicted by the splines that place its lines, confirmed by fits."""

from dataclasses import replace
from functools import cache

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray
from ...common.errors import EmptySection, InvalidPlan, UnderdeterminedFit, UnreachableTolerance
from ..grid.axis import Axis
from ..grid.grids import AutoGrid, Grid, PlanesGrid, Region, Size, Tolerance, Vector, region_of, region_warnings
from ..grid.heights import Heights, sampled_heights
from ..grid.parametrizations import Parametrization
from ..grid.spacing import MAX_MOVES, best_positions, spaced_lines
from ..mesh.outliers import without_outliers
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.lines import LineGrid
from .diagnosis import FOLDED_AREA, MAX_DEVIATION, DeviationLimits, maximum_deviation
from .fitting import check_fit, fit_lines, fit_surface, left_out
from .limits import better_axis, limit_of
from .surface_fit import SurfaceFit

MAX_PLANES = 60  # [1] most u-planes of an automatic grid. Larger: tighter tolerances, more time
MAX_LINES = 160  # [1] most lines per plane of an automatic grid. Larger: tighter tolerances, more time
TRIAL_MOVES = 2  # [1] moves of the lines of nets that are predicted or tried. Larger: smaller nets, more time
COUNT_RATIO = 1.3  # [1] ratio of successive numbers of planes or lines whose error is predicted. Smaller: more time
# [fraction of an error] below which the error of one direction adds little to that of the other. Larger: more time.
MINOR_ERROR_RATIO = 0.6
# [1] most fits before nets are enlarged, and again after it. Larger: a grid nearer to the smallest, more time.
MAX_FITS = 8
# [1] least ratio of the control points of two nets that are both fitted. Their errors have at least this ratio, too: a
# fit that uses more of the tolerance is small enough. Larger: fewer fits.
MIN_SIZE_RATIO = 1.1
# [fraction of the tolerance] aim of the next fit, so that it does not exceed the tolerance narrowly. Larger: smaller
# nets, more fits.
TARGET_RATIO = 0.97
# [1] control points of the nets that are fitted if no prediction is confirmed, before the largest. More: a smaller net
# within the tolerance, more time.
NET_SIZES = 150, 600, 2400
# [1] ratio of the mean errors of two successive of these nets above which larger ones do not help. Larger: more fits.
NO_GAIN_RATIO = 0.8
# [fraction of the tolerance] predicted error of a smaller net that is fitted although it may be too large, because
# predictions are pessimistic as often as optimistic. Larger: smaller nets, more fits.
TRIAL_RATIO = 1.15
# [1] weight of equal factors along u and along v against one fit whose error is the tolerance. Larger: several fits are
# needed to see that one direction is predicted badly.
EQUAL_WEIGHT = 0.3
MIN_FACTOR = 0.05  # [1] least factor over that of both directions. Larger: no direction is taken for exact
# [fraction of the tolerance] error that stands for a fold or a far point, which other nets do not have. Larger: the
# next net is larger.
UNUSABLE_RATIO = 1.3
MEASURES = ("mean", "max")
MIN_DISTANCE = 1e-300  # [m] lower bound of a distance in a logarithm
# [fraction of the largest distance] that is added to it: a peak may be between the points of its search. Larger: safer,
# larger nets.
MAX_MARGIN = 0.01


class Predictor:
    r"""The predicted error of every net over a region, and its fit.

    The errors along u and along v add in squares:

    .. math::

        e(n, m)^2 = e_u(n)^2 + e_v(m)^2 \quad [\text{m}^2]

    Least-squares fits are projections, and those along u and along v commute. Their residuals are therefore orthogonal.
    """

    def __init__(
        self,
        mesh: TriangleMesh,
        parametrization: Parametrization,
        degree: tuple[int, int],
        measure: str = "mean",
        most: tuple[int, int] = (MAX_PLANES, MAX_LINES),
    ):
        self.mesh, self.parametrization, self.degree, self.measure = mesh, parametrization, degree, measure
        self.along, self.across = sampled_heights(mesh, parametrization)
        self.planes, self.lines = (np.arange(p + 1, count + 1) for p, count in zip(degree, most))
        self.nets = self.planes[:, None] * self.lines
        self._error_at = cache(self._predicted)

    def smallest(self, error: float, allowed: BoolArray, factors: Array) -> tuple[int, int] | None:
        """Return the planes and lines of the smallest net with at most this error [m], of those allowed.

        ``allowed`` is of shape (planes, lines). ``factors`` (2,) multiply the squared errors along u and along v.
        """
        errors = self._errors(MINOR_ERROR_RATIO * error, factors)
        fits = allowed & (errors <= error)
        if not fits.any():
            return None
        # Of nets with equal numbers of control points, the one with the least error: the error term is below one.
        return self._size(np.where(fits, self.nets + errors / (2 * error), np.inf))

    def best(self, control_points: int) -> tuple[int, int]:
        """Return the planes and lines of the net of least error with at most some control points, as many as fit."""
        fits = self.nets <= control_points
        fits[:, :-1] &= self.nets[:, 1:] > control_points
        return self._size(np.where(fits, self._errors(0.0, np.ones(2)), np.inf))

    def parts(self, size: tuple[int, int]) -> tuple[float, float]:
        """Return the predicted errors along u and along v of a net [m]."""
        (n, m), (p, q) = size, self.degree
        return self._error_at(self.along, n, p), self._error_at(self.across, m, q)

    def error(self, size: tuple[int, int]) -> float:
        """Return the predicted error of a net [m]."""
        return float(np.hypot(*self.parts(size)))

    def fit(self, size: tuple[int, int], moves: int = TRIAL_MOVES) -> SurfaceFit:
        """Fit the net of a size, whose lines make some moves to less error."""
        lines = spaced_lines(self.mesh, self.parametrization, size, self.degree, moves=moves)
        return fit_lines(self.mesh, lines, self.degree)

    def _size(self, cost: Array) -> tuple[int, int]:
        i, j = divmod(int(np.argmin(cost)), len(self.lines))
        return int(self.planes[i]), int(self.lines[j])

    def _errors(self, enough: float, factors: Array) -> Array:
        """Return the errors of all nets [m]; errors of one direction below ``enough`` are not exact."""
        along, across = (
            factor * self._errors_at(heights, counts, degree, enough / max(factor, MIN_FACTOR) ** 0.5) ** 2
            for heights, counts, degree, factor in zip(
                (self.along, self.across), (self.planes, self.lines), self.degree, factors
            )
        )
        return np.asarray(np.sqrt(along[:, None] + across))

    def _errors_at(self, heights: Heights, counts: IntArray, degree: int, enough: float) -> Array:
        """Return the errors of all counts in one direction, by power laws between some of them [m]."""
        steps = int(np.log(counts[-1] / counts[0]) / np.log(COUNT_RATIO)) + 1
        known, errors = np.unique(np.rint(np.geomspace(counts[0], counts[-1], steps + 1)).astype(np.int64)), []
        for count in known:
            errors.append(max(self._error_at(heights, int(count), degree), MIN_DISTANCE))
            if errors[-1] < enough:
                break
        return np.exp(np.interp(np.log(counts), np.log(known[: len(errors)]), np.log(errors)))

    def _predicted(self, heights: Heights, count: int, degree: int) -> float:
        positions = best_positions(heights, count, degree, TRIAL_MOVES)
        return heights.error(positions, degree, self.measure)


def error_of(fit: SurfaceFit, measure: str) -> float:
    """Return the mean or largest distance from surface to mesh [m]; infinite if no part of it can be measured."""
    try:
        return float(fit.mean_to_mesh if measure == "mean" else (1 + MAX_MARGIN) * fit.to_mesh.max)
    except EmptySection:
        return np.inf


def fit_to_tolerance(
    mesh: TriangleMesh,
    tolerance: float,
    measure: str = "mean",
    degree: int | tuple[int, int] = 3,
    axis: Axis | None = None,
    margin: float | None = None,
    sector: tuple[float, float] | None = None,
    normal: Vector | None = None,
) -> SurfaceFit:
    """Fit the smallest grid whose distance from surface to mesh is within a tolerance.

    Parameters
    ----------
    mesh : TriangleMesh
        The cover, [m] in the link frame.
    tolerance : float
        [m]
    measure : "mean" or "max"
        The distance that the tolerance limits.
    degree : int or pair of int
        As for ``fit_surface``.
    axis, margin, sector, normal
        The region, as for ``AutoGrid``.

    Returns
    -------
    SurfaceFit
        Of the smallest grid that was found.

    Raises
    ------
    UnreachableTolerance
        If no grid meets the tolerance, because the mesh is faceted; the message states the best achievable error.
    PoorFit
        If the mean distance meets the tolerance, but the surface is far from the mesh somewhere.
    """
    degrees = (degree, degree) if isinstance(degree, int) else degree
    return _smallest(mesh, AutoGrid(tolerance, measure, axis, margin, sector, normal), degrees)


def _smallest(
    mesh: TriangleMesh, grid: Grid, degrees: tuple[int, int], max_deviation: float = MAX_DEVIATION
) -> SurfaceFit:
    """Fit the smallest grid over a region that is within the tolerance of ``grid``."""
    assert isinstance(grid.size, Tolerance)
    tolerance, measure = grid.size.tolerance, grid.size.measure
    if not tolerance > 0 or measure not in MEASURES:
        raise InvalidPlan(
            f'The tolerance must be positive and the measure "mean" or "max", not {tolerance} and "{measure}".'
        )
    given, (mesh, outliers) = mesh, without_outliers(mesh)
    parametrization = grid.region.parametrization(mesh)
    search = Search(Predictor(mesh, parametrization, degrees, measure), tolerance, max_deviation)
    fit = search.run()
    if fit is None:
        raise refusal(search, grid.region)
    lines = replace(fit.lines, warnings=region_warnings(grid.region, parametrization, mesh))
    return replace(fit, lines=lines, **left_out(given, outliers))


class Search:
    """A search for the smallest net within a tolerance.

    A surface that folds, or that is too far from the mesh somewhere, does not count.
    """

    def __init__(self, predictor: Predictor, tolerance: float, max_deviation: float):
        self.predictor, self.tolerance, self.measure = predictor, tolerance, predictor.measure
        self.limits = DeviationLimits.of(max_deviation, tolerance, self.measure)
        self.tried: dict[tuple[int, int], tuple[float, SurfaceFit]] = {}  # error [m] and fit of each net
        self.best: SurfaceFit | None = None
        # Larger and larger nets, which do not depend on the tolerance.
        self.nets: list[tuple[float, SurfaceFit]] = []

    def fit(self, size: tuple[int, int]) -> tuple[float, SurfaceFit]:
        """Return error [m] and fit of the net of a size, which becomes the best if it is smaller."""
        if size not in self.tried:
            fit = replace(self.predictor.fit(size), limits=self.limits)
            self.tried[size] = error_of(fit, self.measure), fit
        error, fit = self.tried[size]
        is_smaller = self.best is None or net_size(fit) < net_size(self.best)
        if is_smaller and error <= self.tolerance and self.is_usable(fit, self.tolerance):
            self.best = fit
        return error, fit

    def run(self) -> SurfaceFit | None:
        """Fit nets until the smallest within the tolerance is nearly found; None if none is."""
        self.reduce()
        if self.best is None:
            self.enlarge()
            if self.best is not None:
                self.reduce()
        return self.best

    def reduce(self) -> None:
        """Fit the smallest net that is predicted to meet the tolerance; each fit corrects the next predictions."""
        for _ in range(MAX_FITS):
            for aim in (TARGET_RATIO, TRIAL_RATIO) if self.best else (TARGET_RATIO,):
                size = self.predictor.smallest(aim * self.tolerance, self.allowed(), self.factors())
                if size is not None:
                    break
            else:
                break
            error, fit = self.fit(size)
            if fit is self.best and error > self.tolerance / MIN_SIZE_RATIO:
                break

    def allowed(self) -> BoolArray:
        """Return which nets are smaller than the best one, and have more planes or more lines than each that failed."""
        planes, lines = self.predictor.planes[:, None], self.predictor.lines
        allowed = MIN_SIZE_RATIO * self.predictor.nets < (net_size(self.best) if self.best else np.inf)
        for (n, m), (_, fit) in self.tried.items():
            if fit is not self.best:
                allowed &= (planes >= MIN_SIZE_RATIO * n) | (lines >= MIN_SIZE_RATIO * m)
        return allowed

    def factors(self) -> Array:
        """Return the factors (2,) of the predicted squared errors along u and along v that explain the errors of fits.

        Errors near the tolerance count more. One factor for both is preferred.
        """
        if not self.tried:
            return np.ones(2)
        parts = np.square([self.predictor.parts(size) for size in self.tried]) + MIN_DISTANCE
        errors = np.array([self.counted(*found) for found in self.tried.values()])
        weights = np.minimum(errors / self.tolerance, self.tolerance / errors)
        ratios = errors**2 / parts.sum(axis=1)
        common = np.exp(weights @ np.log(ratios) / weights.sum())
        rows = np.concatenate((weights[:, None] * parts / errors[:, None] ** 2 * common, EQUAL_WEIGHT * np.eye(2)))
        goals = np.append(weights, (EQUAL_WEIGHT, EQUAL_WEIGHT))
        return np.asarray(common * np.maximum(np.linalg.lstsq(rows, goals, rcond=None)[0], MIN_FACTOR))

    def counted(self, error: float, fit: SurfaceFit) -> float:
        """Return the error of a fit [m], or more than the tolerance if it is not usable."""
        if error > self.tolerance or self.is_usable(fit, self.tolerance):
            return float(np.clip(error, 1e-3 * self.tolerance, 1e3 * self.tolerance))
        return UNUSABLE_RATIO * self.tolerance

    def enlarge(self) -> None:
        """Fit larger and larger nets of least predicted error until one meets the tolerance.

        The nets and their errors do not depend on the tolerance. Of two tolerances that are refused, both therefore
        have the same achievable error, and a tolerance that equals it is met. The largest distance of a larger net may
        be larger, so that all of these nets are tried.
        """
        least = np.inf
        for count in (*NET_SIZES, MAX_PLANES * MAX_LINES):
            self.nets.append(self.fit(self.predictor.best(count)))
            before, least = least, self.nets[-1][0]
            if self.best or (self.measure == "mean" and least > NO_GAIN_RATIO * before):
                break

    def is_usable(self, fit: SurfaceFit, error: float) -> bool:
        """Return whether a fit with this error [m] neither folds nor is too far from the mesh somewhere."""
        limit = max(self.limits.refused, error)
        deviation, _ = maximum_deviation(fit.mesh, fit.lines, fit.basis, fit.samples, limit)
        return deviation <= limit and fit.smallest_area >= FOLDED_AREA

    def nearest(self) -> tuple[float, SurfaceFit]:
        """Return the least error of the enlarged nets [m], rounded up, and its fit; infinite if all of them fold."""
        whole = [(error, fit) for error, fit in self.nets if fit.smallest_area >= FOLDED_AREA]
        if not whole:
            return np.inf, self.nets[0][1]
        usable = [(error, fit) for error, fit in whole if self.is_usable(fit, error)]
        error, fit = min(usable or whole, key=lambda found: found[0])
        return rounded_up(error * 1e3) / 1e3, fit


def refusal(search: Search, region: Region) -> UnreachableTolerance:
    """Return why no net is within the tolerance, with the least error of the enlarged nets."""
    wrong = f"No surface is within {search.tolerance * 1e3:g} mm ({search.measure}) of this mesh"
    least, nearest = search.nearest()
    other = better_axis(nearest, region, search.measure, search.tolerance if np.isinf(least) else least)
    if np.isinf(least):
        fold = next(warning for warning in nearest.warnings if warning.code == "folded")
        if other is None:
            return UnreachableTolerance(f"{wrong} without a fold. {fold.message} {fold.advice}", place=fold.where)
        cause, advice = other
        return UnreachableTolerance(
            f"{wrong}, {cause}. {advice[0].upper()}{advice[1:]}. {fold.message}", place=fold.where
        )
    check_fit(replace(nearest, limits=DeviationLimits(least, max(nearest.limits.refused, least))))
    cause, advice = other or limit_of(nearest, least, search.measure)
    return UnreachableTolerance(
        f"{wrong}. The best achievable error is about {least * 1e3:g} mm {cause}. Increase the tolerance, or {advice}.",
        achievable=least,
        place=maximum_deviation(nearest.mesh, nearest.lines, nearest.basis, nearest.samples, least)[1],
    )


def rounded_up(value: float) -> float:
    """Return a positive value rounded up to two digits."""
    step = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(f"{np.ceil(value / step) * step:.3g}")


def fit_to_count(
    mesh: TriangleMesh,
    control_points: int,
    degree: int | tuple[int, int] = 3,
    axis: Axis | None = None,
    margin: float | None = None,
    sector: tuple[float, float] | None = None,
    normal: Vector | None = None,
) -> SurfaceFit:
    """Fit the grid with the least error and at most some control points, in any proportion of planes and lines.

    Parameters
    ----------
    mesh : TriangleMesh
        The cover, [m] in the link frame.
    control_points : int
        Most control points.
    degree : int or pair of int
        As for ``fit_surface``.
    axis, margin, sector, normal
        The region, as for ``AutoGrid``.

    Returns
    -------
    SurfaceFit
        Of the best grid.

    Raises
    ------
    UnderdeterminedFit
        If they are too few for the degree.
    """
    degrees = (degree, degree) if isinstance(degree, int) else degree
    fewest_n, fewest_m = degrees[0] + 1, degrees[1] + 1
    if control_points < fewest_n * fewest_m:
        raise UnderdeterminedFit(
            f"Degree {degrees[0]} x {degrees[1]} needs at least {fewest_n * fewest_m} control points, but "
            f"{control_points} are allowed. Allow more, or lower the degree."
        )
    most = min(control_points // fewest_m, MAX_PLANES), min(control_points // fewest_n, MAX_LINES)
    given, (mesh, outliers) = mesh, without_outliers(mesh)
    predictor = Predictor(mesh, region_of(axis, margin, sector, normal).parametrization(mesh), degrees, most=most)
    fit = replace(predictor.fit(predictor.best(control_points), MAX_MOVES), **left_out(given, outliers))
    check_fit(fit)
    return fit


def net_size(fit: SurfaceFit) -> int:
    """Return the number of control points."""
    return fit.offsets.size


def fit_grid(
    mesh: TriangleMesh,
    grid: Grid | PlanesGrid,
    degree: tuple[int, int],
    chords: bool = False,
    max_deviation: float = MAX_DEVIATION,
    draft: bool = False,
) -> SurfaceFit:
    """Fit along the grid of a plan: planes that the author placed, a size, or the smallest within a tolerance.

    Parameters
    ----------
    mesh : TriangleMesh
        The cover, [m] in the link frame.
    grid : Grid or PlanesGrid
        The grid.
    degree : (int, int)
        Of the surface along u and v.
    chords : bool
        As for ``fit_surface``.
    max_deviation : float
        As for ``fit_surface``. With a tolerance, warnings follow the tolerance.
    draft : bool
        As for ``fit_surface``. Without effect if the grid has a tolerance.

    Returns
    -------
    SurfaceFit
        The surface with its residuals and errors.
    """
    if isinstance(grid, PlanesGrid) or isinstance(grid.size, Size):
        return fit_surface(mesh, grid, degree, chords, max_deviation, draft)
    fit = _smallest(mesh, grid, degree, max_deviation)
    if chords:
        again = fit_lines(fit.mesh, fit.lines, degree, chords)
        fit = replace(again, limits=fit.limits, **left_out(fit.given_mesh, fit.outliers))
        check_fit(fit)
    return fit


def grid_lines(
    mesh: TriangleMesh, grid: Grid | PlanesGrid, degree: tuple[int, int], max_deviation: float = MAX_DEVIATION
) -> LineGrid:
    """Return the lines of the grid of a plan, or of the smallest grid within its tolerance."""
    is_given = isinstance(grid, PlanesGrid) or isinstance(grid.size, Size)
    return grid.line_grid(mesh, degree) if is_given else fit_grid(mesh, grid, degree, False, max_deviation).lines
