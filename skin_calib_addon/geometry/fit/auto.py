"""The smallest grid that meets a tolerance: predicted from a survey, proved by fits."""

from bisect import insort
from collections.abc import Callable, Sequence
from functools import cache
from typing import TypedDict, Unpack

import numpy as np

from ...common.arrays import Array, IntArray
from ...common.errors import InvalidPlan, UnderdeterminedFit, UnreachableTolerance
from ..grid.axis import Axis
from ..grid.charts import chart_lines
from ..grid.error_model import Survey
from ..grid.grids import AutoGrid, Grid, PlanesGrid, Size, Tolerance, Vector, region_of
from ..grid.spacing import MOST_MOVES, line_places, plain_lines, plane_places
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.lines import LineGrid
from ..surface.distance import MeshDistance
from .proof import proved_error
from .surface_fit import SurfaceFit, check_fit, fit_lines, fit_surface

MOST_PLANES, MOST_LINES = 60, 160
MOST_FITS, MOST_ROUNDS = 6, 12
PROMISING = 3  # proportions of planes and lines that are tried, of those that are predicted
UNLIKE = 1.12  # times the planes of another: predictions tell no smaller differences
CHECKED = 5  # sites per span at which a fit is held against the mesh: not those it was fitted at
GOOD = 0.9  # a fit that uses this much of its tolerance is small enough
EASY = 3.0  # times the least predicted error, which a net of moderate size keeps
NEAR = 1.05  # times the least predicted error: what is nearer takes all there is
CLOSE = 1.1  # times the control points of a net: with less of a difference, no other is tried
HOPE = 1.05  # a prediction may be off by this factor
STUCK, ASTRAY = 0.97, 1.5  # a net for less error that leaves more than the one, and less than the other, gains nothing
LOOSE = 1.5  # times its prediction: an error that is proved this far above, as over steps, may be far less
MOST_STALLS, LEAP = 2, 0.7  # after one such net the next is predicted to leave this share of what it was
AIM = 0.97  # a little below the tolerance, so that the next fit does not miss it by a hair
MEASURES = ("mean", "max")
FEW_MOVES = 2  # of planes and lines in nets that are tried: more take as long as they save in control points
LADDER = 1.4  # from one number of planes or lines to the next whose error is looked at
MOVED = 0.6  # share of the error that is left by places where it is least, as a first guess
TINY = 1e-300  # [m]
SLIGHT = 0.7  # share of an error below which that of one direction adds little to that of the other
SNUG = 0.9  # share of an error that is aimed at first, so that no more is left where that was a guess
ROUGHLY = 1.3  # times an error that is seen to be far from reached: what is thought of smaller grids may be off


class Where(TypedDict, total=False):
    """Where an automatic grid lies, as of ``AutoGrid``."""

    axis: Axis | None
    margin: float | None
    sector: tuple[float, float] | None
    normal: Vector | None


class Family:
    """Planes, or lines: how far any number of them leaves the mesh.

    Errors of plain places are seen at a few numbers, those of the best places at fewer; between them, errors and what
    the best places gain follow power laws.
    """

    def __init__(
        self, plain: Callable[[int], float], best: Callable[[int], tuple[float, Array]], fewest: int, most: int
    ):
        self.counts: IntArray = np.arange(fewest, most + 1)
        self.plain, self.best = cache(plain), cache(best)
        steps = int(np.log(most / fewest) / np.log(LADDER)) + 1
        self.ladder = np.unique(np.rint(np.geomspace(fewest, most, steps + 1)).astype(np.int64))
        self.placed: list[int] = []  # numbers whose best places are known, ascending

    def places(self, count: int) -> Array:
        """Where so many leave the least error."""
        if count not in self.placed:
            insort(self.placed, count)
        return self.best(count)[1]

    def error(self, count: int) -> float:
        """Error of so many at the best places [m]."""
        self.places(count)
        return self.best(count)[0]

    def errors(self, enough: float = 0.0) -> Array:
        """Error of each number at the best places as far as is known [m], but for those below what is ``enough``."""
        seen = []
        for count in self.ladder:
            seen.append(self.plain(int(count)))
            if seen[-1] < enough:
                break
        plain = power_law(self.counts, self.ladder[: len(seen)], seen)
        gains = {int(self.counts[0]): MOVED}
        gains |= {count: self.best(count)[0] / plain[count - self.counts[0]] for count in self.placed}
        return plain * power_law(self.counts, np.array(list(gains)), list(gains.values()))


def power_law(wanted: IntArray, counts: IntArray, values: Sequence[float]) -> Array:
    """Values at some ascending counts, with power laws between them and nothing new beyond, at wanted ones."""
    return np.exp(np.interp(np.log(wanted), np.log(counts), np.log(np.maximum(values, TINY))))


class ErrorModel:
    """Predicted error of every grid on a survey, mean or largest: errors along and across add in squares.

    Least-squares fits are projections, and those along u and along v commute: what the one leaves is at a right angle
    to what the other leaves.
    """

    def __init__(
        self,
        survey: Survey,
        degree: tuple[int, int],
        measure: str = "mean",
        most: int = MOST_LINES,
        moves: int = MOST_MOVES,
    ):
        self.survey, self.degree = survey, degree
        judged = survey.halves[1]  # by what places were not chosen by

        def planes(n: int) -> tuple[float, Array]:
            s = plane_places(survey, n, "auto", degree[0], moves)
            return float(judged.misfits_along(s, degree[0], measure)), s

        def lines(m: int) -> tuple[float, Array]:
            t = line_places(survey, m, "auto", degree[1], moves)
            return float(judged.misfits_across(t, degree[1], measure)), t

        def even_planes(n: int) -> float:
            return float(judged.misfits_along(np.linspace(*survey.chart.span, n), degree[0], measure))

        def plainest_lines(m: int) -> float:
            return float(judged.misfits_across(plain_lines(survey, m, degree[1]), degree[1], measure).min())

        self.along = Family(even_planes, planes, degree[0] + 1, MOST_PLANES)
        self.across = Family(plainest_lines, lines, degree[1] + 1, most)

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
        return chart_lines(self.survey.chart, self.along.places(size[0]), self.across.places(size[1]))

    def smallest_grid(self, error: float, above: float = 0.0, below: float = np.inf) -> tuple[int, int] | None:
        """Planes and lines of the smallest net with at most this error [m]; None if there is none.

        Places are looked for where the answer seems to lie, until they are known there.

        Parameters
        ----------
        above, below : float
            So many control points are too few, and too many.
        """
        along, across = self.along, self.across
        nets = along.counts[:, None] * across.counts
        asked = (nets > above) & (nets < below)
        good: tuple[int, int] | None = None  # the last grid with known places that keeps the error
        aim = SNUG * error
        for _ in range(MOST_ROUNDS):
            errors = np.hypot(along.errors(SLIGHT * error)[:, None], across.errors(SLIGHT * error))
            fits = asked & (errors <= aim)
            if not fits.any():
                if aim == error:
                    break
                aim = error
                continue
            # Of nets of one size that of the least error: that is below one, and nets are whole numbers.
            i, j = divmod(int(np.argmin(np.where(fits, nets + errors / (2 * error), np.inf))), nets.shape[1])
            size = int(along.counts[i]), int(across.counts[j])
            if good and CLOSE * nets[i, j] > good[0] * good[1]:
                break
            known = size[0] in along.placed and size[1] in across.placed
            if self.error(size) <= error:
                good = size
            if known:
                break
            aim = ROUGHLY * error if self.error(size) < error / 2 else error
        return good

    def best_grids(self, control_points: int, count: int) -> list[tuple[int, int]]:
        """The grids of the least error with at most so many control points, best first, each of its own proportion."""
        along, across = self.along, self.across
        widest = np.minimum(control_points // along.counts, across.counts[-1])
        fits = widest >= across.counts[0]
        for _ in range(MOST_ROUNDS):
            errors = np.hypot(along.errors()[fits], across.errors()[widest[fits] - across.counts[0]])
            sizes: list[tuple[int, int]] = []
            for i in np.argsort(errors, kind="stable"):
                n, m = int(along.counts[fits][i]), int(widest[fits][i])
                if len(sizes) < count and all(max(n, other) > UNLIKE * min(n, other) for other, _ in sizes):
                    sizes.append((n, m))
            if all(n in along.placed and m in across.placed for n, m in sizes):
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
    survey = Survey.of(mesh, grid.region.chart(mesh), MOST_PLANES)
    search = Search(mesh, ErrorModel(survey, degrees, measure, moves=FEW_MOVES), tolerance, measure)
    search.run()
    if search.best is None:
        least = min(search.reachable, *(error for error, _ in search.tried.values()))
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
    most = min(control_points // fewest_m, MOST_PLANES)
    survey = Survey.of(mesh, region_of(**where).chart(mesh), most)
    model = ErrorModel(survey, degrees, most=min(control_points // fewest_n, MOST_LINES))
    fits = [fit_lines(mesh, model.lines(size), degrees) for size in model.best_grids(control_points, PROMISING)]
    best = min(fits, key=lambda fit: fit.distances(CHECKED).mean)
    check_fit(best)
    return best


class Search:
    """Fits that look for the smallest net within a tolerance; ``best`` is the smallest that was found."""

    def __init__(self, mesh: TriangleMesh, model: ErrorModel, tolerance: float, measure: str):
        self.mesh, self.model, self.tolerance, self.measure = mesh, model, tolerance, measure
        self.tried: dict[tuple[int, int], tuple[float, SurfaceFit]] = {}
        self.stalls = 0  # nets for less error that gained nothing
        self.reachable = np.inf  # the least error [m], where it is not hoped to keep the tolerance
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
        while len(self.tried) < MOST_FITS:
            below = net_size(self.best) / CLOSE if self.best else np.inf
            size = self.model.smallest_grid(self.target, CLOSE * self.most_missed, below)
            if size is None and not self.tried:
                size = self.model.smallest_grid(EASY * self.model.least)
            elif self.best is None and self.tried and not (size and self.hopes(self.model.error(size))):
                size = self.model.smallest_grid(max(self.needed, NEAR * self.model.least))
                size = size or self.model.smallest_grid(NEAR * self.model.least)  # that is known better now
                if not self.hopes(self.model.error(size) if size else self.model.least):
                    break
            if size is None or size in self.tried:
                break
            least = min((error for error, _ in self.tried.values()), default=np.inf)
            error = self.error(size)
            self.stalls += self.best is None and STUCK * least < error < ASTRAY * least
            if self.stalls == MOST_STALLS or GOOD * self.tolerance < error <= self.tolerance:
                break

    @property
    def most_missed(self) -> int:
        """Control points of the largest net that missed the tolerance and is smaller than the best; 0 if none is."""
        most = net_size(self.best) if self.best else 0
        missed = [n * m for (n, m), (error, _) in self.tried.items() if error > self.tolerance and n * m < most]
        return max(missed, default=0)

    @property
    def target(self) -> float:
        """The predicted error of grids to try: as predictions have been off so far, and below all that missed [m]."""
        missed = [self.model.error(size) for size, (error, _) in self.tried.items() if error > self.tolerance]
        target = AIM * self.tolerance / self.share
        less = LEAP if self.stalls else GOOD
        return min(target, less * min(missed)) if missed and self.best is None else target

    @property
    def share(self) -> float:
        """Error of the fit that comes nearest to the tolerance over what was predicted; 1 before the first."""
        if not self.tried:
            return 1.0
        size = min(self.tried, key=lambda size: abs(np.log(self.tried[size][0] / self.tolerance)))
        return self.tried[size][0] / self.model.error(size)

    def hopes(self, predicted: float) -> bool:
        """Whether a fit of this predicted error may keep the tolerance; if not, its error is what can be reached."""
        expected = self.expected(predicted)
        hope = expected <= HOPE * self.tolerance
        self.reachable = np.inf if hope else expected
        return hope

    def expected(self, predicted: float) -> float:
        """Error to expect where less is predicted than of any fit so far [m]."""
        least, best, power = self.trend
        return float(least * (predicted / best) ** power)

    @property
    def needed(self) -> float:
        """The predicted error at which the tolerance is to be expected [m]."""
        least, best, power = self.trend
        return float(best * (AIM * self.tolerance / least) ** (1 / power)) if power else 0.0

    @property
    def trend(self) -> tuple[float, float, float]:
        """The least error so far, its prediction, and the power of predictions by which the nearest two errors fell.

        Over steps and edges errors fall more slowly than predictions, and less and less.
        """
        told = sorted((error, self.model.error(size)) for size, (error, _) in self.tried.items())[:2]
        (least, best), (other, worse) = told[0], told[-1]
        power = np.log(other / least) / np.log(worse / best) if worse > best else 1.0
        return least, best, float(min(power, 1.0))

    def error(self, size: tuple[int, int]) -> float:
        """Error of the fit of this size [m]: within the tolerance only where that is proved."""
        if size not in self.tried:
            fit = fit_lines(self.mesh, self.model.lines(size), self.model.degree)
            points, bounds, areas = fit.bounds()

            def exact(chosen: IntArray) -> Array:
                return self.distance(self.mesh)(points[chosen])[0]

            error = proved_error(bounds, areas, exact, self.measure, self.tolerance)
            if LOOSE * self.model.error(size) < error <= self.tolerance:
                error = min(error, proved_error(bounds, areas, exact, self.measure, 0.0))  # about what it is
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
