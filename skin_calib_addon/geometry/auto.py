"""The smallest grid that meets a tolerance: predicted from a survey, proved by fits."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from ..arrays import Array
from ..deviation import DistanceStatistics
from ..errors import InvalidPlan, UnderdeterminedFit, UnreachableTolerance
from .axis import Axis
from .charts import Chart, chart_lines
from .distance import MeshDistance, surface_samples
from .fit import SurfaceFit, check_fit, fit_lines, fit_surface
from .grids import AcrossGrid, Grid, SectorGrid, TubeGrid
from .lines import LineGrid
from .mesh import TriangleMesh
from .spacing import guessed_lines, guessed_planes, moved_lines, moved_planes
from .survey import Survey

LARGEST = MOST_PLANES, MOST_LINES = 60, 160
MOST_FITS, MORE_FITS, MOST_TARGETS, MOST_STEPS = 8, 3, 30, 8
PROMISING = 3  # proportions of planes and lines that are tried, of those that are predicted
CHECKED = 5  # sites per span at which a fit is held against the mesh: not those it was fitted at
# A fit that uses this much of its tolerance is small enough, and so is one between targets as close as this.
GOOD, CLOSE = 0.9, 1.05
SAFETY = 1.05  # of distances to the planes of facets, which where facets meet are a little shorter than to the mesh
EASY = 2.0  # times the least predicted error, which a net of moderate size keeps
HOPE = 1.1  # a prediction may be off by this factor
AIM = 0.97  # a little below the tolerance, so that the next fit does not miss it by a hair
# What a mean and a largest error are of a root mean square, as a first guess; the first fit tells better.
SHARE = {"mean": 0.74, "max": 5.0}


@dataclass(frozen=True)
class AutoGrid:
    """The smallest grid whose distance from surface to mesh keeps within ``tolerance`` [m], mean or max.

    Round a tube; in a sector of it, or over a face that looks along ``normal``, where these are given.
    """

    tolerance: float
    measure: str = "mean"  # or "max"
    axis: Axis | None = None
    margin: float | None = None
    sector: tuple[float, float] | None = None  # [rad], as of SectorGrid
    normal: tuple[float, float, float] | None = None  # as of AcrossGrid


def chart_of(
    mesh: TriangleMesh,
    axis: Axis | None = None,
    margin: float | None = None,
    sector: tuple[float, float] | None = None,
    normal: tuple[float, float, float] | None = None,
) -> Chart:
    """Where an automatic grid lies on a mesh: over a face, in a sector, or else all round; as of ``AutoGrid``."""
    if normal is not None:
        return AcrossGrid(0, 0, normal, axis.direction if axis else None, margin).chart(mesh)
    if sector is not None:
        return SectorGrid(0, 0, *sector, axis, margin).chart(mesh)
    return TubeGrid(0, 0, axis, margin).chart(mesh)


class ErrorModel:
    """Predicted error of every grid on a survey: errors along and across add in squares.

    Least-squares fits are projections, and those along u and along v commute: what the one leaves is at a right angle
    to what the other leaves.
    """

    def __init__(self, survey: Survey, degree: tuple[int, int]):
        self.survey, self.degree = survey, degree
        self.along = cache(self._along)
        self.across = cache(self._across)
        self.planes = cache(lambda n: moved_planes(survey, self.along(n)[1], degree[0]))
        self.v_lines = cache(lambda m: moved_lines(survey, self.across(m)[1], degree[1]))

    def _along(self, planes: int) -> tuple[float, Array]:
        """Error of some planes along the chart, root mean square [m], and where they lie."""
        s = guessed_planes(self.survey, planes, self.degree[0])
        return self.survey.error_along(s, self.degree[0])[0], s

    def _across(self, lines: int) -> tuple[float, Array]:
        """Error of some lines across the chart, root mean square [m], and where they lie."""
        t = guessed_lines(self.survey, lines, self.degree[1])
        return self.survey.error_across(t, self.degree[1])[0], t

    @property
    def smallest(self) -> tuple[int, int]:
        """Planes and lines of the smallest grid that the degree allows."""
        return self.degree[0] + 1, self.degree[1] + 1

    def error(self, size: tuple[int, int]) -> float:
        """Error of a grid of some planes and lines, root mean square [m]."""
        return float(np.hypot(self.along(size[0])[0], self.across(size[1])[0]))

    def lines(self, size: tuple[int, int]) -> LineGrid:
        """The lines of a grid; they are moved to where they leave less than is predicted."""
        return chart_lines(self.survey.chart, self.planes(size[0]), self.v_lines(size[1]))

    def best_below(self, size: tuple[int, int]) -> tuple[int, int] | None:
        """The best grid with fewer control points than one of about as many planes; None if there is none."""
        net = size[0] * size[1]
        planes = range(max(size[0] - 1, self.degree[0] + 1), min(size[0] + 1, MOST_PLANES) + 1)
        sizes = [(n, (net - 1) // n) for n in planes if self.degree[1] < (net - 1) // n <= MOST_LINES]
        return min(sizes, key=self.error, default=None)

    def fewest_lines(self, error: float) -> int | None:
        """Fewest lines that leave at most this error across, found by bisection; None if none do."""
        low, high = self.degree[1] + 1, MOST_LINES
        step = low
        while step < high and self.across(step)[0] > error:  # double up to a first good number: small nets cost little
            low, step = step + 1, 2 * step
        high = min(step, high)
        if self.across(high)[0] > error:
            return None
        while low < high:
            middle = (low + high) // 2
            low, high = (low, middle) if self.across(middle)[0] <= error else (middle + 1, high)
        return high

    def smallest_grid(self, error: float) -> tuple[int, int] | None:
        """Planes and lines of the smallest net with at most this error; None if there is none."""
        best: tuple[int, int] | None = None
        fewest = self.fewest_lines(error)
        for n in range(self.degree[0] + 1, MOST_PLANES + 1):
            if fewest is None or (best and n * fewest >= best[0] * best[1]):
                break
            left, _ = self.along(n)
            if left < error:
                lines = self.fewest_lines(float(np.sqrt(error**2 - left**2)))
                if lines and (best is None or n * lines < best[0] * best[1]):
                    best = n, lines
        return best


def fit_to_tolerance(
    mesh: TriangleMesh,
    tolerance: float,
    measure: str = "mean",
    degree: int | tuple[int, int] = 3,
    axis: Axis | None = None,
    margin: float | None = None,
    sector: tuple[float, float] | None = None,
    normal: tuple[float, float, float] | None = None,
) -> SurfaceFit:
    """Fit the smallest grid whose distance from surface to mesh keeps within a tolerance.

    Parameters
    ----------
    mesh : TriangleMesh
    tolerance : float
        [m]
    measure : "mean" or "max"
        Which distance must keep within it.
    degree, axis, margin
        As for ``TubeGrid`` and ``fit_surface``.
    sector, normal
        As for ``AutoGrid``: where the grid is no tube.

    Raises
    ------
    UnreachableTolerance
        If the mesh's own facets are further from any smooth surface; says what can be reached.
    """
    if not tolerance > 0 or measure not in SHARE:
        raise InvalidPlan(f'a tolerance is a positive length and a "mean" or a "max", not {tolerance} and "{measure}"')
    degrees = (degree, degree) if isinstance(degree, int) else degree
    survey = Survey.of(mesh, chart_of(mesh, axis, margin, sector, normal), MOST_PLANES)
    model = ErrorModel(survey, degrees)
    search = Search(mesh, model, tolerance, measure)
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
    axis: Axis | None = None,
    margin: float | None = None,
    sector: tuple[float, float] | None = None,
    normal: tuple[float, float, float] | None = None,
) -> SurfaceFit:
    """Fit the grid that leaves the least error with at most so many control points, planes and lines in any proportion.

    Parameters
    ----------
    control_points : int
    degree, axis, margin, sector, normal
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
    survey = Survey.of(mesh, chart_of(mesh, axis, margin, sector, normal), most)
    model = ErrorModel(survey, degrees)
    sizes = [(n, min(control_points // n, MOST_LINES)) for n in range(fewest_n, most + 1)]
    fits = [fit_lines(mesh, model.lines(size), degrees) for size in sorted(sizes, key=model.error)[:PROMISING]]
    best = min(fits, key=lambda fit: fit.distances(CHECKED).mean)
    check_fit(best)
    return best


class Search:
    """Fits that look for the smallest net within a tolerance; ``best`` is the smallest that was found."""

    def __init__(self, mesh: TriangleMesh, model: ErrorModel, tolerance: float, measure: str):
        self.mesh, self.model, self.tolerance, self.measure = mesh, model, tolerance, measure
        self.tried: dict[tuple[int, int], tuple[float, SurfaceFit]] = {}
        self.proved: set[tuple[int, int]] = set()  # sizes whose error does not exceed the tolerance for certain
        self.reachable = np.inf  # the least error [m], where it is not hoped to keep the tolerance
        self.exact = cache(MeshDistance)  # made when it is needed

    @property
    def best(self) -> SurfaceFit | None:
        """The smallest of the nets tried that keep the tolerance."""
        kept = [fit for error, fit in self.tried.values() if error <= self.tolerance]
        return min(kept, key=net_size, default=None)

    def run(self) -> None:
        """Look for the smallest net; the winner is proved where ``errors`` looks, and if it fails, the next one is."""
        self.by_target(MOST_FITS)
        if self.best is None:
            self.from_experience()
        proved: SurfaceFit | None = None
        while self.best is not None and self.best is not proved:
            self.downwards()
            proved = self.best
            n, m = proved.offsets.shape
            if (n, m) not in self.proved:
                self.tried[n, m] = self.exact_error(proved), proved
            if self.best is None:  # rays promised what exact distances do not keep
                self.by_target(len(self.tried) + MORE_FITS)

    def from_experience(self) -> None:
        """Where the predictions promise nothing, learn from fits how far they are off; go on while there is hope."""
        least = self.model.error(LARGEST)
        easy = min(self.tried, key=self.error, default=self.model.smallest_grid(EASY * least))
        assert easy is not None  # the largest net is one of those that keep more than its own error
        share = self.share_of_predicted(easy)
        if self.hopes(share * least):
            self.by_target(len(self.tried) + MORE_FITS, start=AIM * SHARE[self.measure] / share * self.tolerance)
        share = self.share_of_predicted(min(self.tried, key=self.error))
        if self.best is None and self.hopes(share * least) and self.error(LARGEST) <= self.tolerance:
            self.by_target(len(self.tried) + MORE_FITS, kept=SHARE[self.measure] * least)

    def share_of_predicted(self, size: tuple[int, int]) -> float:
        """The error of the fit of this size over what is predicted."""
        return self.error(size) / self.model.error(size)

    def hopes(self, least: float) -> bool:
        """Whether the least error to expect [m] is about the tolerance; it is what can be reached where it is not."""
        hope = least <= HOPE * self.tolerance
        self.reachable = np.inf if hope else least
        return hope

    def error(self, size: tuple[int, int]) -> float:
        """What the error of the fit of this size does not exceed, or about what it is [m]."""
        if size not in self.tried:
            fit = fit_lines(self.mesh, self.model.lines(size), self.model.degree)
            bounds = fit.bounds()
            error = float(getattr(bounds, self.measure)) if bounds else np.inf
            if error <= self.tolerance:
                self.proved.add(size)
            else:
                error = min(error, SAFETY * getattr(fit.distances(CHECKED), self.measure))
            self.tried[size] = error, fit
        return self.tried[size][0]

    def exact_error(self, fit: SurfaceFit) -> float:
        """Error of a fit by exact distances [m], as in ``errors``: what spans a hole does not count."""
        uv, weights = surface_samples(fit.surface)
        trusted = fit.is_trusted(uv)
        if not trusted.any():
            return np.inf
        distance = self.exact(self.mesh)(fit.surface.points(uv[trusted]))[0]
        return float(getattr(DistanceStatistics.of(distance, weights[trusted]), self.measure))

    def by_target(self, fits: int, kept: float = 0.0, start: float = 0.0) -> None:
        """Fit the smallest grid that is predicted to reach a target, and learn from each what to aim at.

        Parameters
        ----------
        fits : int
            How many there may be in all.
        kept : float
            A target that is known to keep the tolerance [m]; 0 if none is.
        start : float
            The first target [m]; 0 for the one that is known, or else the tolerance.
        """
        target, share = start or kept or self.tolerance, SHARE[self.measure]
        # Targets between which the answer lies: the largest that kept the tolerance, the smallest that did not.
        missed = self.tolerance if kept else np.inf
        for _ in range(MOST_TARGETS):
            size = self.model.smallest_grid(target / share)
            if size is None or missed <= CLOSE * kept or (size not in self.tried and len(self.tried) == fits):
                break
            error = self.error(size)
            good = error <= self.tolerance
            kept, missed = (max(kept, target), missed) if good else (kept, min(missed, target))
            if GOOD * self.tolerance < error <= self.tolerance or (good and size == self.model.smallest):
                break
            between = float(np.sqrt(kept * missed)) if kept and missed < np.inf else 0.0
            target = between or target * self.tolerance / error * AIM

    def downwards(self) -> None:
        """Try the most promising smaller nets, as long as they keep the tolerance and something is left of it."""
        for _ in range(MOST_STEPS):
            if self.best is None:
                break
            n, m = self.best.offsets.shape
            size = self.model.best_below((n, m))
            allowed = HOPE * self.tolerance / self.tried[n, m][0] * self.model.error((n, m))
            if size is None or self.model.error(size) > allowed or self.error(size) > self.tolerance:
                break


def net_size(fit: SurfaceFit) -> int:
    """Number of control points."""
    return fit.offsets.size


def fit_grid(mesh: TriangleMesh, grid: Grid | AutoGrid, degree: tuple[int, int], chords: bool = False) -> SurfaceFit:
    """Fit along a grid that the author gave, or the smallest that meets a tolerance; ``chords`` as for fit_surface."""
    if not isinstance(grid, AutoGrid):
        return fit_surface(mesh, grid, degree, chords)
    where = (grid.axis, grid.margin, grid.sector, grid.normal)
    fit = fit_to_tolerance(mesh, grid.tolerance, grid.measure, degree, *where)
    return fit_surface(mesh, fit.lines, degree, chords) if chords else fit
