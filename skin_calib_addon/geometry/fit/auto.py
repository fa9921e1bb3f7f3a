"""The smallest grid that meets a tolerance: predicted from a survey, proved by fits."""

from bisect import insort
from collections.abc import Callable, Sequence
from functools import cache
from typing import TypedDict, Unpack

import numpy as np

from ...common.arrays import Array, IntArray
from ...common.errors import InvalidPlan, UnderdeterminedFit, UnreachableTolerance
from ..grid.axis import Axis
from ..grid.error_model import ErrorModel
from ..grid.grids import AutoGrid, Grid, PlanesGrid, Size, Tolerance, Vector, region_of
from ..grid.parametrizations import parametrized_lines
from ..grid.spacing import MAX_MOVES, density_lines, line_positions, plane_positions
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.lines import LineGrid
from ..surface.distance import MeshDistance
from .proof import confirmed_error
from .surface_fit import SurfaceFit, check_fit, fit_lines, fit_surface

MAX_PLANES, MAX_LINES = 60, 160
MAX_FITS, MAX_SEARCH_ROUNDS = 6, 12
MAX_PROPORTIONS = 3  # proportions of planes and lines that are tried, of those that are predicted
MIN_PROPORTION_RATIO = 1.12  # times the planes of another: predictions tell no smaller differences
CHECK_SITES_PER_SPAN = 5  # sites per span at which a fit is held against the mesh: not those it was fitted at
USED_TOLERANCE_RATIO = 0.9  # a fit that uses this much of its tolerance is small enough
MODERATE_ERROR_RATIO = 3.0  # times the least predicted error, which a net of moderate size keeps
LEAST_ERROR_RATIO = 1.05  # times the least predicted error: what is nearer takes all there is
MIN_SIZE_RATIO = 1.1  # times the control points of a net: with less of a difference, no other is tried
PREDICTION_MARGIN = 1.05  # a prediction may be off by this factor
MIN_FAILED_RATIO, MAX_FAILED_RATIO = (
    0.97,
    1.5,
)  # a net for less error that leaves more than the one, and less than the other, gains nothing
LOOSE_BOUND_RATIO = 1.5  # times its prediction: an error that is proved this far above, as over steps, may be far less
MAX_FAILED_NETS, FAILED_STEP_RATIO = (
    2,
    0.7,
)  # after one such net the next is predicted to leave this share of what it was
TARGET_RATIO = 0.97  # a little below the tolerance, so that the next fit does not miss it by a hair
MEASURES = ("mean", "max")
TRIAL_MOVES = 2  # of planes and lines in nets that are tried: more take as long as they save in control points
COUNT_RATIO = 1.4  # from one number of planes or lines to the next whose error is looked at
INITIAL_GAIN = 0.6  # share of the error that is left by places where it is least, as a first guess
MIN_DISTANCE = 1e-300  # [m]
MINOR_ERROR_RATIO = 0.7  # share of an error below which that of one direction adds little to that of the other
FIRST_AIM_RATIO = 0.9  # share of an error that is aimed at first, so that no more is left where that was a guess
CAUTIOUS_AIM_RATIO = (
    1.3  # times an error that is seen to be far from reached: what is thought of smaller grids may be off
)


class Where(TypedDict, total=False):
    """Where an automatic grid lies, as of ``AutoGrid``."""

    axis: Axis | None
    margin: float | None
    sector: tuple[float, float] | None
    normal: Vector | None


class ErrorCurve:
    """Planes, or lines: how far any number of them leaves the mesh.

    Errors of plain places are seen at a few numbers, those of the best places at fewer; between them, errors and what
    the best places gain follow power laws.
    """

    def __init__(self, even: Callable[[int], float], best: Callable[[int], tuple[float, Array]], first: int, most: int):
        self.counts: IntArray = np.arange(first, most + 1)
        self.even, self.best = cache(even), cache(best)
        steps = int(np.log(most / first) / np.log(COUNT_RATIO)) + 1
        self.sampled_counts = np.unique(np.rint(np.geomspace(first, most, steps + 1)).astype(np.int64))
        self.solved: list[int] = []  # numbers whose best places are known, ascending

    def positions(self, count: int) -> Array:
        """Where so many leave the least error."""
        if count not in self.solved:
            insort(self.solved, count)
        return self.best(count)[1]

    def error(self, count: int) -> float:
        """Error of so many at the best places [m]."""
        self.positions(count)
        return self.best(count)[0]

    def errors(self, enough: float = 0.0) -> Array:
        """Error of each number at the best places as far as is known [m], but for those below what is ``enough``."""
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
    """Values at some ascending counts, with power laws between them and nothing new beyond, at wanted ones."""
    return np.exp(np.interp(np.log(wanted), np.log(counts), np.log(np.maximum(values, MIN_DISTANCE))))


class SizePredictor:
    """Predicted error of every grid on a survey, mean or largest: errors along and across add in squares.

    Least-squares fits are projections, and those along u and along v commute: what the one leaves is at a right angle
    to what the other leaves.
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
        validation = error_model.halves[1]  # by what places were not chosen by

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
    def smallest(self) -> tuple[int, int]:
        """Planes and lines of the smallest grid that the degree allows."""
        return self.degree[0] + 1, self.degree[1] + 1

    @property
    def least(self) -> float:
        """The least error of all grids, as far as is known [m]."""
        return float(np.hypot(self.along.errors().min(), self.across.errors().min()))

    def error(self, size: tuple[int, int]) -> float:
        """Error of a grid of some planes and lines [m]."""
        return float(np.hypot(self.along.error(size[0]), self.across.error(size[1])))

    def lines(self, size: tuple[int, int]) -> LineGrid:
        """The lines of a grid, where they leave the least."""
        return parametrized_lines(
            self.error_model.parametrization, self.along.positions(size[0]), self.across.positions(size[1])
        )

    def smallest_size(self, error: float, above: float = 0.0, below: float = np.inf) -> tuple[int, int] | None:
        """Planes and lines of the smallest net with at most this error [m]; None if there is none.

        Places are looked for where the answer seems to lie, until they are known there.

        Parameters
        ----------
        above, below : float
            So many control points are too few, and too many.
        """
        along, across = self.along, self.across
        nets = along.counts[:, None] * across.counts
        allowed = (nets > above) & (nets < below)
        good: tuple[int, int] | None = None  # the last grid with known places that keeps the error
        aim = FIRST_AIM_RATIO * error
        for _ in range(MAX_SEARCH_ROUNDS):
            errors = np.hypot(
                along.errors(MINOR_ERROR_RATIO * error)[:, None], across.errors(MINOR_ERROR_RATIO * error)
            )
            fits = allowed & (errors <= aim)
            if not fits.any():
                if aim == error:
                    break
                aim = error
                continue
            # Of nets of one size that of the least error: that is below one, and nets are whole numbers.
            i, j = divmod(int(np.argmin(np.where(fits, nets + errors / (2 * error), np.inf))), nets.shape[1])
            size = int(along.counts[i]), int(across.counts[j])
            if good and MIN_SIZE_RATIO * nets[i, j] > good[0] * good[1]:
                break
            known = size[0] in along.solved and size[1] in across.solved
            if self.error(size) <= error:
                good = size
            if known:
                break
            aim = CAUTIOUS_AIM_RATIO * error if self.error(size) < error / 2 else error
        return good

    def best_sizes(self, control_points: int, count: int) -> list[tuple[int, int]]:
        """The grids of the least error with at most so many control points, best first, each of its own proportion."""
        along, across = self.along, self.across
        widest = np.minimum(control_points // along.counts, across.counts[-1])
        fits = widest >= across.counts[0]
        for _ in range(MAX_SEARCH_ROUNDS):
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
    **where: Unpack[Where],
) -> SurfaceFit:
    """Fit the smallest grid whose distance from surface to mesh keeps within a tolerance.

    Parameters
    ----------
    mesh : TriangleMesh
    tolerance : float
        [m]
    measure : "mean" or "max"
        Which distance must keep within it.
    degree
        As for ``fit_surface``.
    **where
        ``axis``, ``margin``, ``sector``, ``normal``: the region, as for ``AutoGrid``.

    Raises
    ------
    UnreachableTolerance
        If the mesh's own facets are further from any smooth surface; says what can be reached.
    """
    degrees = (degree, degree) if isinstance(degree, int) else degree
    return _smallest(mesh, AutoGrid(tolerance, measure, **where), degrees)


def _smallest(mesh: TriangleMesh, grid: Grid, degrees: tuple[int, int]) -> SurfaceFit:
    """Fit the smallest grid over a region that keeps within the tolerance of ``grid``."""
    assert isinstance(grid.size, Tolerance)
    tolerance, measure = grid.size.tolerance, grid.size.measure
    if not tolerance > 0 or measure not in MEASURES:
        raise InvalidPlan(f'a tolerance is a positive length and a "mean" or a "max", not {tolerance} and "{measure}"')
    error_model = ErrorModel.of(mesh, grid.region.parametrization(mesh), MAX_PLANES)
    search = Search(mesh, SizePredictor(error_model, degrees, measure, moves=TRIAL_MOVES), tolerance, measure)
    search.run()
    if search.best is None:
        least = min(search.achievable, *(error for error, _ in search.tried.values()))
        raise UnreachableTolerance(
            f"no surface comes within {tolerance * 1e3:g} mm ({measure}) of this mesh: about {least * 1e3:.2g} "
            "mm can be reached, its facets stand off from any smooth surface; ask for more, or refine the mesh",
            reached=float(least),
        )
    return search.best


def fit_to_count(
    mesh: TriangleMesh,
    control_points: int,
    degree: int | tuple[int, int] = 3,
    **where: Unpack[Where],
) -> SurfaceFit:
    """Fit the grid that leaves the least error with at most so many control points, planes and lines in any proportion.

    Parameters
    ----------
    control_points : int
    degree, **where
        As for ``fit_to_tolerance``.

    Raises
    ------
    UnderdeterminedFit
        If they are too few for the degree.
    """
    degrees = (degree, degree) if isinstance(degree, int) else degree
    fewest_n, fewest_m = degrees[0] + 1, degrees[1] + 1
    if control_points < fewest_n * fewest_m:
        raise UnderdeterminedFit(
            f"degree {degrees[0]} x {degrees[1]} needs at least {fewest_n * fewest_m} control points, not "
            f"{control_points}; allow more, or lower the degree"
        )
    most = min(control_points // fewest_m, MAX_PLANES)
    error_model = ErrorModel.of(mesh, region_of(**where).parametrization(mesh), most)
    predictor = SizePredictor(error_model, degrees, most=min(control_points // fewest_n, MAX_LINES))
    fits = [
        fit_lines(mesh, predictor.lines(size), degrees)
        for size in predictor.best_sizes(control_points, MAX_PROPORTIONS)
    ]
    best = min(fits, key=lambda fit: fit.distances(CHECK_SITES_PER_SPAN).mean)
    check_fit(best)
    return best


class Search:
    """Fits that look for the smallest net within a tolerance; ``best`` is the smallest that was found."""

    def __init__(self, mesh: TriangleMesh, predictor: SizePredictor, tolerance: float, measure: str):
        self.mesh, self.predictor, self.tolerance, self.measure = mesh, predictor, tolerance, measure
        self.tried: dict[tuple[int, int], tuple[float, SurfaceFit]] = {}
        self.failed_nets = 0  # nets for less error that gained nothing
        self.achievable = np.inf  # the least error [m], where it is not hoped to keep the tolerance
        self.distance = cache(MeshDistance)  # made when it is needed

    @property
    def best(self) -> SurfaceFit | None:
        """The smallest of the nets tried that keep the tolerance."""
        kept = [fit for error, fit in self.tried.values() if error <= self.tolerance]
        return min(kept, key=net_size, default=None)

    def run(self) -> None:
        """Fit the smallest grid that is predicted to keep the tolerance, and learn from each fit what to aim at.

        A net that gains nothing may have had more planes where lines were wanted: the next one is for much less error,
        and only if that gains nothing either the tolerance is given up.
        """
        while len(self.tried) < MAX_FITS:
            below = net_size(self.best) / MIN_SIZE_RATIO if self.best else np.inf
            size = self.predictor.smallest_size(self.target, MIN_SIZE_RATIO * self.largest_failed, below)
            if size is None and not self.tried:
                size = self.predictor.smallest_size(MODERATE_ERROR_RATIO * self.predictor.least)
            elif self.best is None and self.tried and not (size and self.may_meet(self.predictor.error(size))):
                size = self.predictor.smallest_size(
                    max(self.needed_prediction, LEAST_ERROR_RATIO * self.predictor.least)
                )
                size = size or self.predictor.smallest_size(
                    LEAST_ERROR_RATIO * self.predictor.least
                )  # that is known better now
                if not self.may_meet(self.predictor.error(size) if size else self.predictor.least):
                    break
            if size is None or size in self.tried:
                break
            least = min((error for error, _ in self.tried.values()), default=np.inf)
            error = self.error(size)
            self.failed_nets += self.best is None and MIN_FAILED_RATIO * least < error < MAX_FAILED_RATIO * least
            if self.failed_nets == MAX_FAILED_NETS or USED_TOLERANCE_RATIO * self.tolerance < error <= self.tolerance:
                break

    @property
    def largest_failed(self) -> int:
        """Control points of the largest net that missed the tolerance and is smaller than the best; 0 if none is."""
        most = net_size(self.best) if self.best else 0
        missed = [n * m for (n, m), (error, _) in self.tried.items() if error > self.tolerance and n * m < most]
        return max(missed, default=0)

    @property
    def target(self) -> float:
        """The predicted error of grids to try: as predictions have been off so far, and below all that missed [m]."""
        missed = [self.predictor.error(size) for size, (error, _) in self.tried.items() if error > self.tolerance]
        target = TARGET_RATIO * self.tolerance / self.prediction_ratio
        less = FAILED_STEP_RATIO if self.failed_nets else USED_TOLERANCE_RATIO
        return min(target, less * min(missed)) if missed and self.best is None else target

    @property
    def prediction_ratio(self) -> float:
        """Error of the fit that comes nearest to the tolerance over what was predicted; 1 before the first."""
        if not self.tried:
            return 1.0
        size = min(self.tried, key=lambda size: abs(np.log(self.tried[size][0] / self.tolerance)))
        return self.tried[size][0] / self.predictor.error(size)

    def may_meet(self, predicted: float) -> bool:
        """Whether a fit of this predicted error may keep the tolerance; if not, its error is what can be reached."""
        expected = self.expected(predicted)
        may_meet = expected <= PREDICTION_MARGIN * self.tolerance
        self.achievable = np.inf if may_meet else expected
        return may_meet

    def expected(self, predicted: float) -> float:
        """Error to expect where less is predicted than of any fit so far [m]."""
        least, best, power = self.trend
        return float(least * (predicted / best) ** power)

    @property
    def needed_prediction(self) -> float:
        """The predicted error at which the tolerance is to be expected [m]."""
        least, best, power = self.trend
        return float(best * (TARGET_RATIO * self.tolerance / least) ** (1 / power)) if power else 0.0

    @property
    def trend(self) -> tuple[float, float, float]:
        """The least error so far, its prediction, and the power of predictions by which the nearest two errors fell.

        Over steps and edges errors fall more slowly than predictions, and less and less.
        """
        fits = sorted((error, self.predictor.error(size)) for size, (error, _) in self.tried.items())[:2]
        (least, best), (other, worse) = fits[0], fits[-1]
        power = np.log(other / least) / np.log(worse / best) if worse > best else 1.0
        return least, best, float(min(power, 1.0))

    def error(self, size: tuple[int, int]) -> float:
        """Error of the fit of this size [m]: within the tolerance only where that is proved."""
        if size not in self.tried:
            fit = fit_lines(self.mesh, self.predictor.lines(size), self.predictor.degree)
            points, bounds, areas = fit.bounds()

            def exact(chosen: IntArray) -> Array:
                return self.distance(self.mesh)(points[chosen])[0]

            error = confirmed_error(bounds, areas, exact, self.measure, self.tolerance)
            if LOOSE_BOUND_RATIO * self.predictor.error(size) < error <= self.tolerance:
                error = min(error, confirmed_error(bounds, areas, exact, self.measure, 0.0))  # about what it is
            self.tried[size] = error, fit
        return self.tried[size][0]


def net_size(fit: SurfaceFit) -> int:
    """Number of control points."""
    return fit.offsets.size


def fit_grid(mesh: TriangleMesh, grid: Grid | PlanesGrid, degree: tuple[int, int], chords: bool = False) -> SurfaceFit:
    """Fit along a grid that the author gave, or the smallest that meets a tolerance.

    Parameters
    ----------
    mesh : TriangleMesh
    grid : Grid or PlanesGrid
    degree : (int, int)
        Of the surface along u and v.
    chords : bool
        As for ``fit_surface``.
    """
    if isinstance(grid, PlanesGrid) or isinstance(grid.size, Size):
        return fit_surface(mesh, grid, degree, chords)
    fit = _smallest(mesh, grid, degree)
    return fit_surface(mesh, fit.lines, degree, chords) if chords else fit


def grid_lines(mesh: TriangleMesh, grid: Grid | PlanesGrid, degree: tuple[int, int]) -> LineGrid:
    """Return the lines of a grid that the author gave, or of the smallest that meets a tolerance."""
    is_given = isinstance(grid, PlanesGrid) or isinstance(grid.size, Size)
    return grid.line_grid(mesh, degree) if is_given else fit_grid(mesh, grid, degree).lines
