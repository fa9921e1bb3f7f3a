"""The smallest grid that meets a tolerance: predicted from a survey, proved by fits."""

from dataclasses import dataclass

import numpy as np

from ..deviation import DistanceStatistics
from ..errors import InvalidPlan, UnreachableTolerance
from .axis import Axis
from .charts import Chart
from .distance import MeshDistance, surface_samples
from .fit import SurfaceFit, fit_surface
from .grids import AcrossGrid, Grid, SectorGrid, TubeGrid
from .mesh import TriangleMesh
from .spacing import line_places, plane_places, spaced_lines
from .survey import Survey

MOST_PLANES, MOST_LINES = 60, 160
MOST_FITS, MOST_TARGETS = 8, 30
# A fit that uses this much of its tolerance is small enough, and so is one between targets as close as this.
GOOD, CLOSE = 0.9, 1.05
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

    def chart(self, mesh: TriangleMesh) -> Chart:
        """Where the grid will lie on ``mesh``."""
        if self.normal is not None:
            along = self.axis.direction if self.axis else None
            return AcrossGrid(0, 0, self.normal, along, self.margin).chart(mesh)
        if self.sector is not None:
            return SectorGrid(0, 0, *self.sector, self.axis, self.margin).chart(mesh)
        return TubeGrid(0, 0, self.axis, self.margin).chart(mesh)


class ErrorModel:
    """Predicted error of every grid on a survey: errors along and across add in squares.

    Least-squares fits are projections, and those along u and along v commute: what the one leaves is at a right angle
    to what the other leaves.
    """

    def __init__(self, survey: Survey, degree: tuple[int, int]):
        self.survey, self.degree = survey, degree
        self._along: dict[int, float] = {}
        self._across: dict[int, float] = {}

    def along(self, planes: int) -> float:
        """Error of some planes along the chart, root mean square [m]."""
        if planes not in self._along:
            s = plane_places(self.survey, planes, "auto", self.degree[0])
            self._along[planes], _ = self.survey.error_along(s, self.degree[0])
        return self._along[planes]

    def across(self, lines: int) -> float:
        """Error of some lines across the chart, root mean square [m]."""
        if lines not in self._across:
            t = line_places(self.survey, lines, "auto", self.degree[1])
            self._across[lines], _ = self.survey.error_across(t, self.degree[1])
        return self._across[lines]

    def fewest_lines(self, error: float) -> int | None:
        """Fewest lines that leave at most this error across, found by bisection; None if none do."""
        low, high = self.degree[1] + 1, MOST_LINES
        step = low
        while step < high and self.across(step) > error:  # double up to a first good number: small nets cost little
            low, step = step + 1, 2 * step
        high = min(step, high)
        if self.across(high) > error:
            return None
        while low < high:
            middle = (low + high) // 2
            low, high = (low, middle) if self.across(middle) <= error else (middle + 1, high)
        return high

    def smallest_grid(self, error: float) -> tuple[int, int] | None:
        """Planes and lines of the smallest net with at most this error; None if there is none."""
        best: tuple[int, int] | None = None
        fewest = self.fewest_lines(error)
        for n in range(self.degree[0] + 1, MOST_PLANES + 1):
            if fewest is None or (best and n * fewest >= best[0] * best[1]):
                break
            left = self.along(n)
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
    survey = Survey.of(mesh, AutoGrid(tolerance, measure, axis, margin, sector, normal).chart(mesh), MOST_PLANES)
    model, distance = ErrorModel(survey, degrees), MeshDistance(mesh)
    target, share = tolerance, SHARE[measure]
    best: SurfaceFit | None = None
    tried: dict[tuple[int, int], float] = {}
    # Targets between which the answer lies: the largest that kept the tolerance, the smallest that did not.
    kept, missed = 0.0, np.inf
    for _ in range(MOST_TARGETS):
        size = model.smallest_grid(target / share)
        if size is None or missed <= CLOSE * kept or (size not in tried and len(tried) == MOST_FITS):
            break
        if size not in tried:
            fit = fit_surface(mesh, spaced_lines(survey, *size, "auto", degrees), degrees)
            tried[size] = getattr(quick_error(distance, fit), measure)
            if tried[size] <= tolerance and (best is None or net_size(fit) < net_size(best)):
                best = fit
        error = tried[size]
        kept, missed = (max(kept, target), missed) if error <= tolerance else (kept, min(missed, target))
        if GOOD * tolerance < error <= tolerance:
            break
        target = float(np.sqrt(kept * missed)) if kept and missed < np.inf else target * tolerance / error * AIM
    if best is None:
        if not tried:  # not even the largest net is predicted to come so close
            least = share * float(np.hypot(model.along(MOST_PLANES), model.across(MOST_LINES)))
        else:
            least = min(tried.values())
        raise UnreachableTolerance(
            f"no surface comes within {tolerance * 1e3:g} mm ({measure}) of this mesh: about {least * 1e3:.2g} "
            "mm can be reached, its facets stand off from any smooth surface; ask for more, or refine the mesh",
            reached=float(least),
        )
    return best


def net_size(fit: SurfaceFit) -> int:
    """Number of control points."""
    return int(np.prod(fit.lines.origins.shape[:2]))


def quick_error(distance: MeshDistance, fit: SurfaceFit) -> DistanceStatistics:
    """Distance from surface to mesh."""
    uv, weights = surface_samples(fit.surface)
    return DistanceStatistics.of(distance(fit.surface.points(uv))[0], weights)


def fit_grid(mesh: TriangleMesh, grid: Grid | AutoGrid, degree: tuple[int, int], chords: bool = False) -> SurfaceFit:
    """Fit along a grid that the author gave, or the smallest that meets a tolerance; ``chords`` as for fit_surface."""
    if not isinstance(grid, AutoGrid):
        return fit_surface(mesh, grid, degree, chords)
    where = (grid.axis, grid.margin, grid.sector, grid.normal)
    fit = fit_to_tolerance(mesh, grid.tolerance, grid.measure, degree, *where)
    return fit_surface(mesh, fit.lines, degree, chords) if chords else fit
