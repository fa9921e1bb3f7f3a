"""Heights of a mesh on a few curves along and across a region, and the errors of splines through them."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ...common.arrays import Array
from ...common.errors import EmptySection
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import SplineSites, spline_sites
from ..sampling.rays import TURN
from ..surface.bspline import sites_per_span
from .parametrizations import Parametrization, TubeParametrization, cast_heights

OUTLINES, OUTLINE_RAYS = 12, 720  # [1] curves across a region, and their rays. Larger: finer features, more time
PROFILES, PROFILE_RAYS = 30, 97  # [1] curves along a region, and their rays. Larger: finer features, more time
# [fraction of the rays] that hit a mesh which fills its region. Larger: more regions get even lines.
MIN_FILLED_FRACTION = 0.98
MAX_REFITS = 5  # [1] most iterations of a spline. Larger: no visible effect, more time
# [1] ratio of the squared step to the squared residuals below which these iterations have converged. Larger: less time.
REFIT_TOLERANCE = 1e-3
SITES = 4  # [1] sites per span of the splines whose error is reduced. Larger: more time
# [1] sites per span of those whose error is stated. They differ from ``SITES``, because the number of facets is often a
# round number. Larger: more accurate, more time.
ERROR_SITES = 10
MIN_ERROR_SITES = 80  # [1] least number of these in all spans. Larger: coarse nets are predicted more accurately


@dataclass(frozen=True, eq=False)
class Splines:
    """Splines whose control points are at some positions, one per curve, and what they miss of the heights."""

    sites: SplineSites
    net: Array  # (r, m) control points in the plane of their curve, as complex numbers [m]
    at: Array  # (r, l) positions of the sites [m] or [rad]
    height: Array  # (r, l) of the splines [m]
    residuals: Array  # (r, l) from there to the heights of the mesh [m]
    known: Array  # (r, l) 1 where the mesh was hit on both sides, else 0
    width: Array  # (r, l) half of the distance between the neighbours of each site [m] or [rad]
    slope: Array  # (r, l) of the mesh per unit of the position


@dataclass(frozen=True, eq=False)
class Heights:
    """Heights of a mesh on curves in one direction; the splines through them are like those of a fit."""

    at: Array  # (k,) even positions, from edge to edge; those of closed curves end where they begin [m] or [rad]
    values: Array  # (r, k) [m]; gaps are filled
    known: Array  # (r, k) 1 where the mesh was hit, 0 in gaps
    closed: bool
    polar: bool  # whether positions are angles and heights are distances from an axis; else both are lengths
    predicts: bool  # whether the splines predict errors: not if the region has empty corners
    bends: bool = False  # whether the rays start on a curve, which the splines do not contain

    @property
    def edges(self) -> tuple[float, float]:
        """Return the first and the last position."""
        return float(self.at[0]), float(self.at[-1])

    def splines(self, positions: Array, degree: int, per_span: int) -> Splines:
        """Fit splines with control points at some positions (m,) to sites in each span."""
        sites = spline_sites(len(positions), degree, self.closed, per_span)
        heights, middle = self._interpolated(self.values, positions), sum(self.edges) / 2
        for _ in range(MAX_REFITS):  # like the iterations of a fit: rays through the spline's own points
            net = heights * np.exp(1j * positions) if self.polar else positions + 1j * heights
            points = net @ sites.values.T
            at, height = points.real, points.imag
            if self.polar:
                at, height = middle + np.angle(points * np.exp(-1j * middle)), np.abs(points)
            residuals = self._interpolated(self.values, at) - height
            step = residuals @ sites.inverse.T
            if (step**2).sum() < REFIT_TOLERANCE * (residuals**2).sum():
                break
            heights = heights + step
        known = np.ones(at.shape) if self.known.all() else 1.0 * (self._interpolated(self.known, at) == 1)
        slope = self._interpolated(self._slopes, at)
        return Splines(sites, net, at, height, residuals, known, widths(at, self.closed), slope)

    def error(self, positions: Array, degree: int, measure: str = "mean") -> float:
        """Return the mean or the largest ("max") distance of splines from the curves [m]."""
        spans = len(positions) - (0 if self.closed else degree)
        found = self.splines(positions, degree, sites_per_span(ERROR_SITES, spans, MIN_ERROR_SITES))
        scale = found.height if self.polar else 1.0  # length per unit of the position
        stretch = np.hypot(1, found.slope / scale)
        distances, areas = np.abs(found.residuals) / stretch, found.known * found.width * stretch * scale
        if measure == "max":
            return float((distances * found.known).max())
        return float((distances * areas).sum() / max(areas.sum(), np.finfo(float).tiny))

    def span_errors(self, positions: Array, degree: int) -> Array:
        """Return the mean square of the residuals in each span [m^2]; 0 without hits.

        A site on a knot counts half for each side, so that a mirrored mesh has mirrored errors.
        """
        found = self.splines(positions, degree, ERROR_SITES)
        sums = np.stack(((found.residuals**2 * found.known).sum(axis=0), found.known.sum(axis=0)))
        pairs = sums + np.roll(sums, -1, axis=1) if self.closed else sums[:, :-1] + sums[:, 1:]
        squares, counts = pairs.reshape(2, -1, ERROR_SITES).sum(axis=2)
        return np.asarray(squares / np.maximum(counts, 1))

    def residual_slopes(self, positions: Array, degree: int) -> tuple[Array, Array]:
        """Return the residuals (r l,) and their derivatives (r l, m) by the positions, weighted by their widths.

        A moving line moves a point across its ray, where the height of the mesh changes, and along its ray. The splines
        are fitted again, so that only what is orthogonal to them remains.
        """
        found = self.splines(positions, degree, SITES)
        sites = found.sites
        if self.polar:
            moved = sites.values * (1j * found.net)[:, None] * np.exp(-1j * found.at)[..., None]
            slopes = (found.slope / found.height)[..., None] * moved.imag - moved.real
        else:
            slopes = found.slope[..., None] * sites.values
        slopes -= sites.values @ (sites.inverse @ slopes)
        weights = found.known * np.sqrt(found.width)
        return (found.residuals * weights).ravel(), (slopes * weights[..., None]).reshape(-1, len(positions))

    @cached_property
    def _slopes(self) -> Array:
        if not self.closed:
            return np.gradient(self.values, self.at, axis=1)
        padded = np.column_stack((self.values[:, -2], self.values, self.values[:, 1]))
        return (padded[:, 2:] - padded[:, :-2]) / (2 * (self.at[1] - self.at[0]))

    def _interpolated(self, values: Array, wanted: Array) -> Array:
        """Interpolate rows (r, k) linearly at positions (m,) or (r, m); beyond the edges they are constant."""
        r, k = values.shape
        if self.closed:
            wanted = wanted % TURN
        place = np.clip((wanted - self.at[0]) / (self.at[1] - self.at[0]), 0, k - 1)
        before = np.minimum(place.astype(np.int64), k - 2)
        start = before + k * np.arange(r)[:, None]
        low, high = values.take(start), values.take(start + 1)
        return np.asarray(low + (place - before) * (high - low))


def widths(positions: Array, closed: bool) -> Array:
    """Return half of the distance between the neighbours of each position (..., l); at an edge there is one."""
    if closed:
        steps = (np.roll(positions, -1, axis=-1) - np.roll(positions, 1, axis=-1) + TURN / 2) % TURN - TURN / 2
        return np.asarray(np.abs(steps) / 2)
    steps = np.diff(positions, axis=-1).clip(0) / 2  # a folded spline goes back
    none = np.zeros_like(steps[..., :1])
    return np.concatenate((none, steps), axis=-1) + np.concatenate((steps, none), axis=-1)


@lru_cache(maxsize=4)  # repeated fits, as in the window, keep the heights of their mesh
def sampled_heights(mesh: TriangleMesh, parametrization: Parametrization) -> tuple[Heights, Heights]:
    """Return the heights of a mesh along a region, on profiles, and across it, on outlines."""
    closed, polar = parametrization.closed, isinstance(parametrization, TubeParametrization)
    t = np.linspace(*parametrization.breadth, OUTLINE_RAYS + 1)
    s = np.linspace(*parametrization.span, PROFILE_RAYS)
    middles = np.linspace(*parametrization.span, 2 * OUTLINES + 1)[1::2]
    across = cast_heights(mesh, parametrization, middles, t[:-1] if closed else t)
    along = cast_heights(mesh, parametrization, s, t[: -1 : OUTLINE_RAYS // PROFILES]).T
    # The errors at empty corners of an open region are not predictable.
    predicts = closed or float((~np.isnan(across)).mean()) > MIN_FILLED_FRACTION
    profiles, outlines = filled(along, False), filled(across, closed)
    hit_along, hit_across = (~np.isnan(rows) * 1.0 for rows in (along, across))
    if closed:
        outlines, hit_across = (np.column_stack((rows, rows[:, 0])) for rows in (outlines, hit_across))
    return (
        Heights(s, profiles, hit_along, False, False, predicts, parametrization.bends),
        Heights(t, outlines, hit_across, closed, polar, predicts),
    )


def filled(heights: Array, closed: bool) -> Array:
    """Fill each gap of heights (r, k) by linear interpolation along its row; copy empty rows from the nearest row."""
    missing = np.isnan(heights)
    if not missing.any():
        return heights
    if missing.all():
        raise EmptySection("No ray of the grid hits the mesh. Move the axis into the mesh, or choose another grid.")
    heights, positions = heights.copy(), np.arange(heights.shape[1])
    whole = np.flatnonzero(~missing.all(axis=1))
    for i in np.flatnonzero(missing.any(axis=1)):
        source = i if i in whole else whole[np.argmin(np.abs(whole - i))]
        known = np.flatnonzero(~missing[source])
        period = len(positions) if closed else None
        heights[i] = np.interp(positions, known, heights[source, known], period=period)
    return heights
