"""The smallest grid within a tolerance: predicted by the error model, confirmed by fits."""

from bisect import insort
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from ...common.arrays import Array, IntArray
from ...common.errors import EmptySection, InvalidPlan, UnderdeterminedFit, UnreachableTolerance
from ..grid.axis import Axis
from ..grid.error_model import ErrorModel
from ..grid.grids import AutoGrid, Grid, PlanesGrid, Region, Size, Tolerance, Vector, length_warnings, region_of
from ..grid.parametrizations import parametrized_lines
from ..grid.spacing import MAX_MOVES, density_lines, line_positions, plane_positions
from ..mesh.outliers import without_outliers
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.lines import LineGrid
from .diagnosis import FOLDED_AREA, MAX_DEVIATION, DeviationLimits, maximum_deviation
from .fitting import check_fit, fit_lines, fit_surface, left_out
from .limits import better_axis, limit_of
from .surface_fit import SurfaceFit

MAX_PLANES = 60  # [1] most u-planes of an automatic grid. Larger: tighter tolerances, more time
MAX_LINES = 160  # [1] most lines per plane of an automatic grid. Larger: tighter tolerances, more time
MAX_FITS = 6  # [1] most fits of a search. Larger: a grid nearer to the smallest, more time
# [1] proportions of planes and lines that are fitted, of those with the least predicted error. Larger: less error, more
# time.
MAX_PROPORTIONS = 3
# [1] least ratio of the planes of two proportions, because predictions do not separate closer ones. Larger: fewer.
MIN_PROPORTION_RATIO = 1.12
# [1] control points of the nets that are fitted if no prediction is confirmed, before the largest. More: a smaller net
# within the tolerance, more time.
NET_SIZES = 150, 600, 2400
# [1] ratio of the mean errors of two successive of these nets above which larger ones do not help. Larger: more fits.
NO_GAIN_RATIO = 0.8
NET_BISECTIONS = 2  # [1] nets between the last two of them. Larger: a smaller net, more time
# [1] least ratio of the control points of two nets that are both fitted. Their errors have at least this ratio, too: a
# fit that uses more of the tolerance is small enough. Larger: fewer fits.
MIN_SIZE_RATIO = 1.1
# [fraction of the tolerance] aim of the next fit, so that it does not exceed the tolerance narrowly. Larger: smaller
# nets, more fits.
TARGET_RATIO = 0.97
MEASURES = ("mean", "max")
MIN_DISTANCE = 1e-300  # [m] lower bound of a distance in a logarithm
# [fraction of the largest distance] that is added to it: a peak may be between the points of its search. Larger: safer,
# larger nets.
MAX_MARGIN = 0.01
# [1] steps of planes and lines for nets that are fitted on trial. Larger: fewer control points, more time.
TRIAL_MOVES = 2
COUNT_RATIO = 1.4  # [1] ratio of successive numbers of planes or lines whose error is computed. Smaller: more time
INITIAL_GAIN = 0.6  # [1] first estimate of the ratio of the errors at the best and at even positions
# [fraction of an error] below which the error of one direction adds little to that of the other. Larger: more time.
MINOR_ERROR_RATIO = 0.7
# [fraction of an error] first aim of a prediction, because errors at unknown positions are estimates.
FIRST_AIM_RATIO = 0.9


class ErrorCurve:
    """The error of planes, or of lines, as a function of their number.

    The errors of even positions are computed for a few numbers, and those of the best positions for fewer. Between
    them, the errors and the gains of the best positions follow power laws.
    """

    def __init__(self, even: Callable[[int], float], best: Callable[[int], tuple[float, Array]], first: int, most: int):
        self.counts: IntArray = np.arange(first, most + 1)
        self.even, self.best = cache(even), cache(best)
        steps = int(np.log(most / first) / np.log(COUNT_RATIO)) + 1
        self.sampled_counts = np.unique(np.rint(np.geomspace(first, most, steps + 1)).astype(np.int64))
        self.solved: list[int] = []  # numbers whose best positions are computed, ascending

    def positions(self, count: int) -> Array:
        """Return the positions of ``count`` planes or lines with the least error."""
        if count not in self.solved:
            insort(self.solved, count)
        return self.best(count)[1]

    def error(self, count: int) -> float:
        """Return the error of ``count`` planes or lines at the best positions [m]."""
        self.positions(count)
        return self.best(count)[0]

    def errors(self, enough: float = 0.0) -> Array:
        """Return the estimated error of each number at the best positions [m]; less exact below ``enough``."""
        seen = []
        for count in self.sampled_counts:
            seen.append(self.even(int(count)))
            if seen[-1] < enough:
                break
        even = power_law(self.counts, self.sampled_counts[: len(seen)], seen)
        gains = {int(self.counts[0]): INITIAL_GAIN}
        gains |= {count: self.best(count)[0] / even[count - self.counts[0]] for count in self.solved}
        return even * power_law(self.counts, np.array(list(gains)), list(gains.values()))


def power_law(wanted: IntArray, counts: IntArray, values: Sequence[float]) -> Array:
    """Interpolate values at some counts by power laws; beyond the counts the values are constant."""
    return np.exp(np.interp(np.log(wanted), np.log(counts), np.log(np.maximum(values, MIN_DISTANCE))))


class SizePredictor:
    r"""The predicted error of every grid, mean or largest.

    The errors along u and along v add in squares:

    .. math::

        e(n, m)^2 = e_u(n)^2 + e_v(m)^2 \quad [\text{m}^2]

    Least-squares fits are projections, and those along u and along v commute. Their residuals are therefore orthogonal.
    """

    def __init__(
        self,
        error_model: ErrorModel,
        degree: tuple[int, int],
        measure: str = "mean",
        most: int = MAX_LINES,
        moves: int = MAX_MOVES,
    ):
        self.error_model, self.degree = error_model, degree
        validation = error_model.halves[1]  # the half that did not select the positions

        def planes(n: int) -> tuple[float, Array]:
            s = plane_positions(error_model, n, "auto", degree[0], moves)
            return float(validation.misfits_along(s, degree[0], measure)), s

        def lines(m: int) -> tuple[float, Array]:
            t = line_positions(error_model, m, "auto", degree[1], moves)
            return float(validation.misfits_across(t, degree[1], measure)), t

        def even_planes(n: int) -> float:
            return float(
                validation.misfits_along(np.linspace(*error_model.parametrization.span, n), degree[0], measure)
            )

        def plainest_lines(m: int) -> float:
            return float(validation.misfits_across(density_lines(error_model, m, degree[1]), degree[1], measure).min())

        self.along = ErrorCurve(even_planes, planes, degree[0] + 1, MAX_PLANES)
        self.across = ErrorCurve(plainest_lines, lines, degree[1] + 1, most)

    @property
    def most_control_points(self) -> int:
        """Return the number of control points of the largest grid."""
        return int(self.along.counts[-1] * self.across.counts[-1])

    def forget(self) -> None:
        """Return to the predictions before the first fit."""
        self.along.solved.clear()
        self.across.solved.clear()

    def error(self, size: tuple[int, int]) -> float:
        """Return the predicted error of a grid of some planes and lines [m]."""
        return float(np.hypot(self.along.error(size[0]), self.across.error(size[1])))

    def lines(self, size: tuple[int, int]) -> LineGrid:
        """Return the lines of a grid at the positions with the least error."""
        return parametrized_lines(
            self.error_model.parametrization,
            self.along.positions(size[0]),
            self.across.positions(size[1]),
            self.error_model.centre,
        )

    def smallest_size(self, error: float, above: float = 0.0, below: float = np.inf) -> tuple[int, int] | None:
        """Return planes and lines of the smallest net with at most this error; None without such a net.

        The best positions are computed where the answer seems to be, until they are known there.
        """
        along, across = self.along, self.across
        nets = along.counts[:, None] * across.counts
        allowed = (nets > above) & (nets < below)
        good: tuple[int, int] | None = None  # the last grid with computed positions within the error
        aim = FIRST_AIM_RATIO * error
        while True:
            errors = np.hypot(
                along.errors(MINOR_ERROR_RATIO * error)[:, None], across.errors(MINOR_ERROR_RATIO * error)
            )
            fits = allowed & (errors <= aim)
            if not fits.any():
                if aim == error:
                    break
                aim = error
                continue
            # Of nets with equal numbers of control points, the one with the least error: the error term is below one.
            i, j = divmod(int(np.argmin(np.where(fits, nets + errors / (2 * error), np.inf))), nets.shape[1])
            size = int(along.counts[i]), int(across.counts[j])
            if good and MIN_SIZE_RATIO * nets[i, j] > good[0] * good[1]:
                break
            known = size[0] in along.solved and size[1] in across.solved
            if self.error(size) <= error:
                good = size
            if known:
                break
            aim = error
        return good

    def best_sizes(self, control_points: int, count: int) -> list[tuple[int, int]]:
        """Return the sizes of least error with at most some control points, best first, in different proportions."""
        along, across = self.along, self.across
        widest = np.minimum(control_points // along.counts, across.counts[-1])
        fits = widest >= across.counts[0]
        while True:
            errors = np.hypot(along.errors()[fits], across.errors()[widest[fits] - across.counts[0]])
            sizes: list[tuple[int, int]] = []
            for i in np.argsort(errors, kind="stable"):
                n, m = int(along.counts[fits][i]), int(widest[fits][i])
                if len(sizes) < count and all(
                    max(n, other) > MIN_PROPORTION_RATIO * min(n, other) for other, _ in sizes
                ):
                    sizes.append((n, m))
            if all(n in along.solved and m in across.solved for n, m in sizes):
                break
            for size in sizes:
                self.error(size)
        return sizes


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
    error_model = ErrorModel.of(mesh, parametrization, MAX_PLANES)
    predictor = SizePredictor(error_model, degrees, measure, moves=TRIAL_MOVES)
    limits = DeviationLimits.of(max_deviation, tolerance, measure)
    search = Search(mesh, predictor, tolerance, measure, limits)
    search.run()
    if search.best is None:
        search.enlarge()
    if search.best is None:
        raise refusal(search, grid.region)
    lines = replace(search.best.lines, warnings=length_warnings(grid.region, parametrization, mesh))
    return replace(search.best, lines=lines, **left_out(given, outliers))


def refusal(search: "Search", region: Region) -> UnreachableTolerance:
    """Return why no net is within the tolerance, with the least error of the enlarged nets."""
    wrong = f"No surface is within {search.tolerance * 1e3:g} mm ({search.measure}) of this mesh"
    least, nearest = search.nearest
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
    most = min(control_points // fewest_m, MAX_PLANES)
    given, (mesh, outliers) = mesh, without_outliers(mesh)
    error_model = ErrorModel.of(mesh, region_of(axis, margin, sector, normal).parametrization(mesh), most)
    predictor = SizePredictor(error_model, degrees, most=min(control_points // fewest_n, MAX_LINES))
    fits = [
        fit_lines(mesh, predictor.lines(size), degrees)
        for size in predictor.best_sizes(control_points, MAX_PROPORTIONS)
    ]
    best = min(fits, key=lambda fit: fit.to_mesh.mean)
    best = replace(best, **left_out(given, outliers))
    check_fit(best)
    return best


class Search:
    """A search for the smallest net within a tolerance; ``best`` is the smallest that was found.

    A surface that folds, or that is too far from the mesh somewhere, does not count.
    """

    def __init__(
        self, mesh: TriangleMesh, predictor: SizePredictor, tolerance: float, measure: str, limits: DeviationLimits
    ):
        self.mesh, self.predictor, self.tolerance, self.measure = mesh, predictor, tolerance, measure
        self.limits = limits
        self.tried: dict[tuple[int, int], tuple[float, SurfaceFit]] = {}
        self.enlarged: list[tuple[int, int]] = []  # the enlarged nets, which do not depend on the tolerance
        self.is_usable = cache(self._is_usable)
        self.measured = cache(self._measured)

    @property
    def best(self) -> SurfaceFit | None:
        """Return the smallest of the fitted nets within the tolerance; None without one."""
        return min((fit for size, (_, fit) in self.tried.items() if self.meets(size)), key=net_size, default=None)

    def meets(self, size: tuple[int, int]) -> bool:
        """Return whether the fit of this size is within the tolerance and usable."""
        error, fit = self.tried[size]
        return error <= self.tolerance and self.is_usable(fit, self.tolerance)

    def _is_usable(self, fit: SurfaceFit, error: float) -> bool:
        """Return whether a fit with this error [m] neither folds nor is too far from the mesh somewhere."""
        limit = max(self.limits.refused, error)
        deviation, _ = maximum_deviation(fit.mesh, fit.lines, fit.basis, fit.samples, limit)
        return deviation <= limit and fit.smallest_area >= FOLDED_AREA

    def run(self) -> None:
        """Fit the smallest grid that is predicted to meet the tolerance; each fit corrects the next prediction."""
        while len(self.tried) < MAX_FITS:
            below = net_size(self.best) / MIN_SIZE_RATIO if self.best else np.inf
            size = self.predictor.smallest_size(self.target, MIN_SIZE_RATIO * self.largest_failed, below)
            if size is None or size in self.tried:
                break
            error = self.error(size)
            if self.tolerance / MIN_SIZE_RATIO < error and self.meets(size):
                break

    def enlarge(self) -> None:
        """Fit larger and larger nets of least predicted error until one meets the tolerance.

        The nets and their errors do not depend on the tolerance. Of two tolerances that are refused, both therefore
        have the same achievable error, and a tolerance that equals it is met. The largest distance of a larger net may
        be larger, so that all of these nets are tried.
        """
        self.predictor.forget()
        failed, most = 0, self.predictor.most_control_points
        least = np.inf
        for count in (*NET_SIZES, most):
            size = self.predictor.best_sizes(min(count, most), 1)[0]
            if size not in self.enlarged:
                self.enlarged.append(size)
                self.error(size)
            if self.best:
                break
            failed = size[0] * size[1]
            if self.measure == "mean":
                before, least = least, self.tried[size][0]
                if least > NO_GAIN_RATIO * before:
                    break
        for _ in range(NET_BISECTIONS):  # between the last two nets
            if self.best is None:
                break
            count = int(np.sqrt(failed * net_size(self.best)))
            if count <= MIN_SIZE_RATIO * failed:
                break
            size = self.predictor.best_sizes(count, 1)[0]
            self.error(size)
            if not self.meets(size):
                failed = count

    @property
    def nearest(self) -> tuple[float, SurfaceFit]:
        """Return the least error of the enlarged nets [m], rounded up, and its fit; infinite if all of them fold."""
        fits = [self.tried[size][1] for size in self.enlarged]
        whole = [(self.measured(fit), fit) for fit in fits if fit.smallest_area >= FOLDED_AREA]
        if not whole:
            return np.inf, fits[0]
        usable = [(error, fit) for error, fit in whole if self.is_usable(fit, error)]
        error, fit = min(usable or whole, key=lambda found: found[0])
        return rounded_up(error * 1e3) / 1e3, fit

    def _measured(self, fit: SurfaceFit) -> float:
        """Return the mean or largest distance of a fit from the mesh [m]; infinite if no part of it can be measured."""
        try:
            return float(fit.to_mesh.mean if self.measure == "mean" else (1 + MAX_MARGIN) * fit.to_mesh.max)
        except EmptySection:
            return np.inf

    @property
    def largest_failed(self) -> int:
        """Return the control points of the largest net that does not count, smaller than the best; 0 without one."""
        most = net_size(self.best) if self.best else 0
        missed = [net_size(fit) for size, (_, fit) in self.tried.items() if not self.meets(size)]
        return max((count for count in missed if count < most), default=0)

    @property
    def target(self) -> float:
        """Return the predicted error of the next grid [m].

        It is corrected by the errors so far, and less than the predictions of all nets above the tolerance.
        """
        missed = [self.predictor.error(size) for size, (error, _) in self.tried.items() if error > self.tolerance]
        target = TARGET_RATIO * self.tolerance / self.prediction_ratio
        return min(target, min(missed) / MIN_SIZE_RATIO) if missed and self.best is None else target

    @property
    def prediction_ratio(self) -> float:
        """Return the ratio of error and prediction of the fit nearest to the tolerance; 1 before the first fit."""
        if not self.tried:
            return 1.0
        size = min(self.tried, key=lambda size: abs(np.log(self.tried[size][0] / self.tolerance)))
        return self.tried[size][0] / self.predictor.error(size)

    def error(self, size: tuple[int, int]) -> float:
        """Return the error of the fit of this size [m]."""
        if size not in self.tried:
            fit = self.fit(size)
            self.tried[size] = self.measured(fit), fit
        return self.tried[size][0]

    def fit(self, size: tuple[int, int]) -> SurfaceFit:
        """Return the fit of this size."""
        fit = fit_lines(self.mesh, self.predictor.lines(size), self.predictor.degree)
        return replace(fit, limits=self.limits)


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
