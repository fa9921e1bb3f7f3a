"""The error of spacings of planes and lines, predicted from a few outlines and profiles of the mesh."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, TypeVar

import numpy as np

from ...common.arrays import Array, BoolArray, over_rows
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import SplineSites, spline_sites
from ..sampling.rays import TURN
from ..surface.bspline import sites_per_span
from .misfits import (
    filled,
    interpolated,
    is_known,
    lengths,
    mean_square,
    misfits,
    moving_part,
    periodic_lengths,
    refitted,
    root_mean_squares,
    shifted,
    span_errors,
)
from .outlines import OUTLINE_RAYS, outline_centre, outline_positions
from .parametrizations import Parametrization, heights

OUTLINES = 17  # [1] outlines across the region. Larger: a more accurate error model, more time
PROFILES = 48  # [1] profiles along the region. Larger: a more accurate error model, more time
PROFILE_SITES_PER_PLANE = 4  # [1] sites of a profile. Larger: more accurate positions of planes, more time
MIN_PROFILE_SITES = 24  # [1] least sites of a profile. Larger: more accurate positions of few planes, more time
MAX_PROFILE_SITES = 72  # [1] most sites of a profile. Larger: more accurate positions of many planes, more time
# [1] The density of lines is this power of the curvature. Larger: more lines at corners, fewer in flat parts.
CURVATURE_EXPONENT = 0.35
# [rad] rotation of an outline in one step below which it is straight, because noise of a nanometre rotates it, too.
# Larger: lines do not follow slight curvature.
FLAT_TURN = 1e-5
# [fraction of the mean] lower bound of the curvature; below, it is rounding. Larger: more lines in flat parts.
MIN_CURVATURE_FRACTION = 1e-3
# [steps of an outline] width of the average of the curvature, because the edges of facets have curvature too. Larger:
# corners get fewer lines.
SMOOTHING_WIDTH = 2.3
# [fraction of the rays] that hit a mesh which fills its region. Larger: more regions get even lines.
MIN_FILLED_FRACTION = 0.98
MAX_REFITS = 5  # [1] most iterations of a fit to the outlines. Larger: no visible effect, more time
# [1] ratio of the squared step to the squared residuals below which these iterations have converged. Larger: less time.
REFIT_TOLERANCE = 1e-3
# [1] least number of sites for a mean or largest distance. Larger: coarse nets are predicted more accurately.
MIN_ERROR_SITES = 80
# [1] sites per span for the selection of positions. A short spline interpolates three. Larger: more accurate, more
# time.
SELECTION_SITES = 7
# [1] sites per span for their validation. It differs from ``SELECTION_SITES``, because the number of facets is often a
# round number. Larger: more accurate, more time.
VALIDATION_SITES = 10
# [1] every which outline and profile compares residuals at even and at shifted positions. Larger: less time, by chance.
FLOOR_STRIDE = 4
# [1] least number of sites across for this comparison, so that facets are seen. Larger: more time.
FLOOR_SITES_ACROSS = 400


def _outline_stations(parametrization: Parametrization) -> Array:
    return np.linspace(*parametrization.span, 2 * OUTLINES + 1)[1::2]


@lru_cache(maxsize=4)  # repeated fits, as in the window, keep the outlines of their mesh: planes do not move them
def _outline_heights(mesh: TriangleMesh, parametrization: Parametrization) -> Array:
    return heights(mesh, parametrization, _outline_stations(parametrization), outline_positions(parametrization))


@lru_cache(maxsize=4)
def _memory(mesh: TriangleMesh, parametrization: Parametrization) -> dict[tuple[Any, ...], Any]:
    return {}


def _profile_heights(mesh: TriangleMesh, parametrization: Parametrization, rows: int) -> Array:
    known = _memory(mesh, parametrization)
    if ("profiles", rows) not in known:
        t = outline_positions(parametrization)[:: OUTLINE_RAYS // PROFILES][:PROFILES]
        s = np.linspace(*parametrization.span, rows + 1)
        known["profiles", rows] = heights(mesh, parametrization, s, t)
    found: Array = known["profiles", rows]
    return found


# A spacing is a piecewise linear map from the fraction of the intervals before a position, 0 to 1, to the position.
SpacingMap = tuple[Array, Array]
Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """Heights of a mesh over a region: distances along its rays, on a few dense lines in each direction.

    Splines fitted to the outlines predict the errors of lines. Splines fitted to the profiles predict the errors of
    planes.
    """

    parametrization: Parametrization
    outline_t: Array  # (l,) of a full turn, or from edge to edge
    outlines: Array  # (OUTLINES, l) [m]
    outlines_known: Array  # (OUTLINES, l) 1 where the mesh was hit, 0 where a gap was filled
    profile_s: Array  # (k,)
    profiles: Array  # (PROFILES, k) [m]
    profiles_known: Array  # (PROFILES, k)
    per_span: int = SELECTION_SITES  # sites in each span for the errors
    centre: Array | None = None  # (3,) point of the mesh at the middle of the region [m]
    # What was computed from the outlines only, for other numbers of planes too, by its input.
    memory: dict[tuple[Any, ...], Any] = field(default_factory=dict)

    @classmethod
    def of(cls, mesh: TriangleMesh, parametrization: Parametrization, planes: int) -> "ErrorModel":
        """Sample a mesh, finely enough to place a number of planes."""
        rows = min(max(PROFILE_SITES_PER_PLANE * planes, MIN_PROFILE_SITES), MAX_PROFILE_SITES)
        s, t = np.linspace(*parametrization.span, rows + 1), outline_positions(parametrization)
        outline_s = _outline_stations(parametrization)
        outlines, profiles = _outline_heights(mesh, parametrization), _profile_heights(mesh, parametrization, rows)
        known, profiles_met = (~np.isnan(h) * 1.0 for h in (outlines, profiles.T))
        outlines = filled(outlines, parametrization.closed)
        middle = OUTLINES // 2
        return cls(
            parametrization,
            t,
            outlines,
            known,
            s,
            filled(profiles.T, False),
            profiles_met,
            centre=outline_centre(parametrization, outline_s[middle], outlines[middle]),
            memory=_memory(mesh, parametrization),
        )

    def remembered(self, given: tuple[Any, ...], make: Callable[[], Result]) -> Result:
        """Return what was computed from the outlines before, or compute it."""
        if given not in self.memory:
            self.memory[given] = make()
        found: Result = self.memory[given]
        return found

    @property
    def is_filled(self) -> bool:
        """Return whether the mesh fills the region; errors at empty corners of an open region are not predictable."""
        return self.parametrization.closed or float(self.outlines_known.mean()) > MIN_FILLED_FRACTION

    @cached_property
    def maps(self) -> dict[str, SpacingMap]:
        """Return the spacings across that follow a density: none, arc length, a power of the curvature."""
        t, edges, closed = self.outline_t, self.parametrization.breadth, self.parametrization.closed
        maps = {"uniform": (np.array((0.0, 1.0)), np.array(edges))}
        for spacing, density in self.densities.items():
            following = np.roll(density, -1) if closed else density[1:]
            fraction = np.append(0.0, np.cumsum((density[: len(following)] + following) / 2))
            if fraction[-1] > 0:  # the curvature of a plane is zero
                maps[spacing] = fraction / fraction[-1], np.append(t, edges[1]) if closed else t
        return maps

    @property
    def densities(self) -> dict[str, Array]:
        r"""Return arc length and curvature density per step of t on the outlines, shapes (l,).

        With the length :math:`\ell` [m] of a step and the curvature :math:`\kappa` [1/m], the curvature density is
        :math:`\kappa^{0.35}\, \ell`.
        """
        origins, rays = self.parametrization.rays(self.profile_s[:1], self.outline_t)
        points = origins + self.outlines[..., None] * rays
        step = np.roll(points, -1, axis=1) - points
        length = np.sqrt((step**2).sum(axis=2))
        heading = step / np.maximum(length, 1e-300)[..., None]
        turn = np.sqrt(((heading - np.roll(heading, 1, axis=1)) ** 2).sum(axis=2))
        turn[turn < FLAT_TURN] = 0.0
        length = (length + np.roll(length, 1, axis=1)) / 2
        if not self.parametrization.closed:  # the ends have a neighbor on one side only
            turn[:, [0, -1]], length[:, [0, -1]] = turn[:, [1, -2]], length[:, [1, -2]]
        # Average by a periodic convolution.
        l = len(self.outline_t)
        window = np.exp(-0.5 * (TURN * np.fft.rfftfreq(l) * SMOOTHING_WIDTH) ** 2)
        smooth_turn, smooth_length = (np.fft.irfft(np.fft.rfft(x) * window, l) for x in (turn, length))
        curvature = np.abs(smooth_turn) / smooth_length
        curvature = np.maximum(curvature, MIN_CURVATURE_FRACTION * curvature.mean())
        curved = curvature**CURVATURE_EXPONENT * smooth_length
        return {"arc": length.mean(axis=0), "curvature": curved.mean(axis=0)}

    @cached_property
    def halves(self) -> tuple["ErrorModel", "ErrorModel"]:
        """Return two models: every second outline and profile selects positions, the rest validates them."""
        return self._every_other(0, SELECTION_SITES), self._every_other(1, VALIDATION_SITES)

    def _every_other(self, start: int, per_span: int) -> "ErrorModel":
        return replace(
            self,
            outlines=self.outlines[start::2],
            outlines_known=self.outlines_known[start::2],
            profiles=self.profiles[start::2],
            profiles_known=self.profiles_known[start::2],
            per_span=per_span,
        )

    def misfits_across(self, t: Array, degree: int, measure: str) -> Array:
        """Return the mean or largest distance of choices of lines from the outlines."""
        closed, count = self.parametrization.closed, t.shape[-1]
        at, height, _, residuals = self._with_enough_sites(count if closed else count - degree)._fit_across(t, degree)
        step = self.parametrization.steps(height)
        slope = np.hypot(1, interpolated(self._outline_slopes, self.outline_t, at, closed) / step)
        widths = periodic_lengths(at) if closed else lengths(at)
        return misfits(residuals / slope, self._known_across(at) * widths * step * slope, measure)

    def misfits_along(self, s: Array, degree: int, measure: str) -> Array:
        """Return the mean or largest distance of choices of planes from the profiles."""
        sites, known, residuals = self._with_enough_sites(s.shape[-1] - degree)._fit_along(s, degree)
        at = over_rows(s, sites.values.T)
        slope = np.hypot(1, interpolated(self._profile_slopes, self.profile_s, at[..., None, :], False))
        return misfits(residuals / slope, known * lengths(at)[..., None, :] * slope, measure)

    def _with_enough_sites(self, spans: int) -> "ErrorModel":
        """Return this model with so many sites per span that few spans, too, sample every facet."""
        return replace(self, per_span=sites_per_span(self.per_span, spans, MIN_ERROR_SITES))

    def errors_across(self, t: Array, degree: int) -> Array:
        """Return the errors of several choices of lines."""
        at, _, _, residuals = self._fit_across(t, degree)
        return root_mean_squares(residuals, self._known_across(at), t.shape[-1])

    def error_across(self, t: Array, degree: int) -> tuple[float, Array]:
        """Return the error of lines, and of each span."""
        closed = self.parametrization.closed
        at, _, _, residuals = self._fit_across(t, degree)
        return span_errors(residuals, self._known_across(at), len(t), len(t) if closed else len(t) - degree, closed)

    def slopes_across(self, t: Array, degree: int) -> tuple[Array, Array]:
        """Return the residuals of lines, and their derivatives by the position of each line."""
        sites = spline_sites(len(t), degree, self.parametrization.closed, self.per_span)
        at, height, offsets, residuals = self._fit_across(t, degree)
        known = self._known_across(at)
        slope = interpolated(self._outline_slopes, self.outline_t, at, self.parametrization.closed)
        slopes = refitted(self.parametrization.residual_slopes(sites.values, t, offsets, at, height, slope), sites)
        return (residuals * known).ravel(), (slopes * known[..., None]).reshape(-1, len(t))

    def movable_fractions(self, planes: int, lines: int, degree: tuple[int, int]) -> tuple[float, float]:
        r"""Return the fraction of the squared residuals at even positions that moves with the lines and the planes.

        Residuals :math:`e` at even positions and :math:`e'` at positions shifted by half an interval have the facets in
        common. The errors of the two splines are independent of each other, so that these are

        .. math::

            \frac{\lVert e - e' \rVert^2}{2\, \lVert e \rVert^2}

        of the squares. Other positions cannot reduce the rest.
        """
        few = replace(
            self,
            outlines=self.outlines[::FLOOR_STRIDE],
            outlines_known=self.outlines_known[::FLOOR_STRIDE],
            profiles=self.profiles[::FLOOR_STRIDE],
            profiles_known=self.profiles_known[::FLOOR_STRIDE],
        )
        (across, moved_across), (along, moved_along) = (
            self.remembered(("moving", lines, degree[1]), lambda: few._moving_across(lines, degree[1])),
            few._moving_along(planes, degree[0]),
        )
        total = max(across + along, 1e-300)
        return moved_across / total, moved_along / total

    def _moving_across(self, count: int, degree: int) -> tuple[float, float]:
        """Return the mean squares of the residuals of even lines, and of the part that moves with them [m^2]."""
        closed, (first, last) = self.parametrization.closed, self.parametrization.breadth
        even = first + (last - first) * (np.arange(count) / (count if closed else count - 1))
        period = TURN if closed else None
        residuals = []
        for t in (even, even + (last - first) / count / 2 if closed else shifted(even)):
            # An even number per span: sites of both splines are at nearly equal angles.
            model = replace(self, per_span=2 * int(np.ceil(FLOOR_SITES_ACROSS / len(t) / 2)))
            at, _, _, left = model._fit_across(t, degree)
            left = left * model._known_across(at)
            order = np.argsort(at, axis=1)
            at, left = (np.take_along_axis(x, order, axis=1) for x in (at, left))
            residuals.append(np.array([np.interp(self.outline_t, *x, period=period) for x in zip(at, left)]))
        return moving_part(*residuals)

    def _moving_along(self, count: int, degree: int) -> tuple[float, float]:
        """Return the mean squares of the residuals of even planes, and of the part that moves with them [m^2]."""
        even = np.linspace(*self.parametrization.span, count)
        residuals = []
        for s in (even, shifted(even)):
            model = replace(self, per_span=2 * int(np.ceil(MIN_ERROR_SITES / len(s) / 2)))
            sites, known, left = model._fit_along(s, degree)
            at = sites.values @ s
            residuals.append(np.array([np.interp(self.profile_s, at, row) for row in left * known]))
        return moving_part(*residuals)

    def _fit_across(self, t: Array, degree: int) -> tuple[Array, Array, Array, Array]:
        """Fit splines on lines at some t (..., m): return positions, heights and residuals (..., r, l), and offsets.

        The order is positions, heights, offsets, residuals. The offsets have the shape (..., r, m).
        """
        closed = self.parametrization.closed
        sites = spline_sites(t.shape[-1], degree, closed, self.per_span)
        offsets = interpolated(self.outlines, self.outline_t, t[..., None, :], closed)
        for _ in range(MAX_REFITS):  # like the iterations of a fit: rays through the spline's own points
            at, height = self.parametrization.blend(sites.values, t, offsets)
            residuals = interpolated(self.outlines, self.outline_t, at, closed) - height
            step = over_rows(residuals, sites.inverse.T)
            moving = mean_square(step) >= REFIT_TOLERANCE * mean_square(residuals)
            if not moving.any():
                break
            offsets = offsets + moving[..., None, None] * step
        return at, height, offsets, residuals

    def _known_across(self, at: Array) -> BoolArray:
        """Return whether the outlines hit the mesh on both sides of positions (..., r, l)."""
        return is_known(self.outlines_known, self.outline_t, at, self.parametrization.closed)

    def errors_along(self, s: Array, degree: int) -> Array:
        """Return the errors of several choices of planes, as for lines across."""
        sites, known, residuals = self._fit_along(s, degree)
        return root_mean_squares(residuals, known, s.shape[-1], lengths(over_rows(s, sites.values.T)))

    def error_along(self, s: Array, degree: int) -> tuple[float, Array]:
        """Return the error of planes and of each span, as for lines across; each site is weighted by its length."""
        sites, known, residuals = self._fit_along(s, degree)
        return span_errors(residuals, known, len(s), len(s) - degree, False, lengths(sites.values @ s))

    def slopes_along(self, s: Array, degree: int) -> tuple[Array, Array]:
        """Return the residuals of planes and their derivatives, as for lines; each site is weighted by its length."""
        sites, known, residuals = self._fit_along(s, degree)
        at = sites.values @ s
        slope = interpolated(self._profile_slopes, self.profile_s, at[None], False)
        root = np.sqrt(lengths(at))
        slopes = root[:, None] * refitted(slope[..., None] * sites.values, sites)
        slopes += residuals[..., None] * (lengths(sites.values.T).T / (2 * root[:, None]))
        return (root * residuals * known).ravel(), (slopes * known[..., None]).reshape(-1, len(s))

    def _fit_along(self, s: Array, degree: int) -> tuple[SplineSites, BoolArray, Array]:
        """Fit splines on planes at some s (..., n): return sites, whether they were hit, and residuals (..., r, l)."""
        sites = spline_sites(s.shape[-1], degree, False, self.per_span)
        at = over_rows(s, sites.values.T)[..., None, :]
        heights = interpolated(self.profiles, self.profile_s, at, False)
        known = is_known(self.profiles_known, self.profile_s, at, False)
        return sites, known, heights - over_rows(over_rows(heights, sites.inverse.T), sites.values.T)

    @cached_property
    def _outline_slopes(self) -> Array:
        if not self.parametrization.closed:
            return np.gradient(self.outlines, self.outline_t, axis=1)
        step = self.outline_t[1] - self.outline_t[0]
        return (np.roll(self.outlines, -1, axis=1) - np.roll(self.outlines, 1, axis=1)) / (2 * step)

    @cached_property
    def _profile_slopes(self) -> Array:
        return np.gradient(self.profiles, self.profile_s, axis=1)
