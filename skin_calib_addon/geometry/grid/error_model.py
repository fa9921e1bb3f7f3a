"""A first look at a mesh in its chart: a few outlines and profiles, and what spacings of lines would leave of them."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray, over_rows, product
from ...common.errors import EmptySection
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.basis import SplineSites, spline_sites
from ..sampling.rays import TURN
from ..sampling.samples import cast_rays
from ..surface.bspline import sites_per_span
from .parametrizations import Parametrization

OUTLINES, OUTLINE_RAYS = 17, 720  # across
PROFILES = 48  # along
PROFILE_SITES_PER_PLANE = 4  # of a profile
MIN_PROFILE_SITES, MAX_PROFILE_SITES = 24, 72
# Lines lie as densely as this power of the curvature: a corner gets them, a flat keeps a few.
CURVATURE_EXPONENT = 0.35
MIN_CURVATURE_RATIO = 1e-3  # share of the mean below which a curvature is none but rounding
SMOOTHING_WIDTH = 2.3  # of the outlines, over which curvature is averaged: facets are corners too
MIN_FILLED_FRACTION = 0.98  # share of the rays that meet a mesh which fills its chart
MAX_REFITS = 5
REFIT_TOLERANCE = 1e-3  # a round that moves the offsets by this share of what they leave, both squared, is the last
MIN_ERROR_SITES = 80  # sites where a mean or a largest distance is told
SELECTION_SITES, VALIDATION_SITES = (
    7,
    10,
)  # sites per span: a short spline passes through three, and facets come in round numbers

# A spacing is a piecewise linear map from the share of the intervals behind a place, 0 to 1, to the place.
SpacingMap = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """Heights of a mesh over a chart: distances along its rays, on a few dense lines in each direction."""

    parametrization: Parametrization
    outline_t: Array  # (l,) all round, or from edge to edge
    outlines: Array  # (OUTLINES, l) [m]
    outlines_known: Array  # (OUTLINES, l) 1 where the mesh was met, 0 where a gap was bridged
    profile_s: Array  # (k,)
    profiles: Array  # (PROFILES, k) [m]
    profiles_known: Array  # (PROFILES, k)
    per_span: int = SELECTION_SITES  # sites in each span at which errors are seen

    @classmethod
    def of(cls, mesh: TriangleMesh, parametrization: Parametrization, planes: int) -> "ErrorModel":
        """Survey a mesh, finely enough to place up to so many planes.

        Raises
        ------
        EmptySection
            If no ray meets the mesh.
        """
        rows = min(max(PROFILE_SITES_PER_PLANE * planes, MIN_PROFILE_SITES), MAX_PROFILE_SITES)
        s, t = np.linspace(*parametrization.span, rows + 1), np.linspace(*parametrization.breadth, OUTLINE_RAYS + 1)
        if parametrization.closed:
            t = t[:-1]
        outline_s = np.linspace(*parametrization.span, 2 * OUTLINES + 1)[1::2]
        profile_t = t[:: OUTLINE_RAYS // PROFILES][:PROFILES]
        outlines, profiles = (
            cast_rays(mesh, parametrization.planes(rows), *parametrization.rays(rows, columns))
            for rows, columns in ((outline_s, t), (s, profile_t))
        )
        known, profiles_met = (~np.isnan(h) * 1.0 for h in (outlines, profiles.T))
        return cls(
            parametrization,
            t,
            filled(outlines, parametrization.closed),
            known,
            s,
            filled(profiles.T, False),
            profiles_met,
        )

    @property
    def is_filled(self) -> bool:
        """Whether the mesh fills the chart; where it leaves corners of an open one out, errors there are guesses."""
        return self.parametrization.closed or float(self.outlines_known.mean()) > MIN_FILLED_FRACTION

    @cached_property
    def maps(self) -> dict[str, SpacingMap]:
        """Spacings across that follow a density: none, arc length, a power of the curvature."""
        t, edges, closed = self.outline_t, self.parametrization.breadth, self.parametrization.closed
        maps = {"uniform": (np.array((0.0, 1.0)), np.array(edges))}
        for spacing, density in self.densities.items():
            following = np.roll(density, -1) if closed else density[1:]
            fraction = np.append(0.0, np.cumsum((density[: len(following)] + following) / 2))
            if fraction[-1] > 0:  # a plane has no curvature
                maps[spacing] = fraction / fraction[-1], np.append(t, edges[1]) if closed else t
        return maps

    @property
    def densities(self) -> dict[str, Array]:
        """Arc length, and a power of the curvature over it, per step of t on the outlines, shapes (l,)."""
        origins, rays = self.parametrization.rays(self.profile_s[:1], self.outline_t)
        points = origins + self.outlines[..., None] * rays
        step = np.roll(points, -1, axis=1) - points
        length = np.sqrt((step**2).sum(axis=2))
        heading = step / np.maximum(length, 1e-300)[..., None]
        turn = np.sqrt(((heading - np.roll(heading, 1, axis=1)) ** 2).sum(axis=2))
        length = (length + np.roll(length, 1, axis=1)) / 2
        if not self.parametrization.closed:  # the ends have no curve on one side
            turn[:, [0, -1]], length[:, [0, -1]] = turn[:, [1, -2]], length[:, [1, -2]]
        # Averaged as a convolution all round.
        l = len(self.outline_t)
        window = np.exp(-0.5 * (TURN * np.fft.rfftfreq(l) * SMOOTHING_WIDTH) ** 2)
        smooth_turn, smooth_length = (np.fft.irfft(np.fft.rfft(x) * window, l) for x in (turn, length))
        curvature = np.abs(smooth_turn) / smooth_length
        curvature = np.maximum(curvature, MIN_CURVATURE_RATIO * curvature.mean())
        curved = curvature**CURVATURE_EXPONENT * smooth_length
        return {"arc": length.mean(axis=0), "curvature": curved.mean(axis=0)}

    @cached_property
    def halves(self) -> tuple["ErrorModel", "ErrorModel"]:
        """Every other outline and profile, and the rest at other sites: what the one promises the other proves."""
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
        """Mean or largest distance [m], as ``measure`` says, that choices of lines (..., m) leave; shape (...)."""
        closed, count = self.parametrization.closed, t.shape[-1]
        at, height, _, residuals = self._with_enough_sites(count if closed else count - degree)._fit_across(t, degree)
        step = self.parametrization.steps(height)
        slope = np.hypot(1, interpolated(self._outline_slopes, self.outline_t, at, closed) / step)
        widths = periodic_lengths(at) if closed else lengths(at)
        return misfits(residuals / slope, self._known_across(at) * widths * step * slope, measure)

    def misfits_along(self, s: Array, degree: int, measure: str) -> Array:
        """Mean or largest distance [m] that choices of planes (..., n) leave; shape (...)."""
        sites, known, residuals = self._with_enough_sites(s.shape[-1] - degree)._fit_along(s, degree)
        at = over_rows(s, sites.values.T)
        slope = np.hypot(1, interpolated(self._profile_slopes, self.profile_s, at[..., None, :], False))
        return misfits(residuals / slope, known * lengths(at)[..., None, :] * slope, measure)

    def _with_enough_sites(self, spans: int) -> "ErrorModel":
        """The same with so many sites that few spans, too, see every facet."""
        return replace(self, per_span=sites_per_span(self.per_span, spans, MIN_ERROR_SITES))

    def errors_across(self, t: Array, degree: int) -> Array:
        """What several choices of lines (c, m) leave between outlines and fits.

        Returns
        -------
        array, shape (c,)
            Root mean squares, corrected for what went into the unknowns [m].
        """
        at, _, _, residuals = self._fit_across(t, degree)
        return root_mean_squares(residuals, self._known_across(at), t.shape[-1])

    def error_across(self, t: Array, degree: int) -> tuple[float, Array]:
        """What lines at some t (m,) leave between outlines and fits.

        Returns
        -------
        error : float
            Root mean square, corrected for what went into the unknowns [m].
        energies : array, shape (spans,)
            Mean square of each span of the spline [m^2].
        """
        closed = self.parametrization.closed
        at, _, _, residuals = self._fit_across(t, degree)
        return span_errors(residuals, self._known_across(at), len(t), len(t) if closed else len(t) - degree, closed)

    def slopes_across(self, t: Array, degree: int) -> tuple[Array, Array]:
        """What lines at some t leave, and how that changes as each moves.

        Returns
        -------
        residuals : array, shape (k,)
            Between outlines and fits [m]; 0 where the mesh was not met.
        slopes : array, shape (k, m)
            Their derivatives, as far as the heights have any.
        """
        sites = spline_sites(len(t), degree, self.parametrization.closed, self.per_span)
        at, height, offsets, residuals = self._fit_across(t, degree)
        known = self._known_across(at)
        slope = interpolated(self._outline_slopes, self.outline_t, at, self.parametrization.closed)
        slopes = refitted(self.parametrization.residual_slopes(sites.values, t, offsets, at, height, slope), sites)
        return (residuals * known).ravel(), (slopes * known[..., None]).reshape(-1, len(t))

    def _fit_across(self, t: Array, degree: int) -> tuple[Array, Array, Array, Array]:
        """Least squares on lines at some t (..., m): where their points lie, heights, offsets, residuals, (..., r, l).

        The offsets are of shape (..., r, m).
        """
        closed = self.parametrization.closed
        sites = spline_sites(t.shape[-1], degree, closed, self.per_span)
        offsets = interpolated(self.outlines, self.outline_t, t[..., None, :], closed)
        for _ in range(MAX_REFITS):  # as the passes of a fit: rays through the spline's own points
            at, height = self.parametrization.blend(sites.values, t, offsets)
            residuals = interpolated(self.outlines, self.outline_t, at, closed) - height
            step = over_rows(residuals, sites.inverse.T)
            moving = mean_square(step) >= REFIT_TOLERANCE * mean_square(residuals)
            if not moving.any():
                break
            offsets = offsets + moving[..., None, None] * step
        return at, height, offsets, residuals

    def _known_across(self, at: Array) -> BoolArray:
        """Whether the outlines were met on both sides of places (..., r, l)."""
        return is_known(self.outlines_known, self.outline_t, at, self.parametrization.closed)

    def errors_along(self, s: Array, degree: int) -> Array:
        """What several choices of planes (c, n) leave between profiles and fits, as for lines across."""
        sites, known, residuals = self._fit_along(s, degree)
        return root_mean_squares(residuals, known, s.shape[-1], lengths(over_rows(s, sites.values.T)))

    def error_along(self, s: Array, degree: int) -> tuple[float, Array]:
        """What planes at some s (n,) leave between profiles and fits, as for lines across; each place by its length."""
        sites, known, residuals = self._fit_along(s, degree)
        return span_errors(residuals, known, len(s), len(s) - degree, False, lengths(sites.values @ s))

    def slopes_along(self, s: Array, degree: int) -> tuple[Array, Array]:
        """What planes at some s leave, and how that changes as each moves; as for lines across, but for the lengths."""
        sites, known, residuals = self._fit_along(s, degree)
        at = sites.values @ s
        slope = interpolated(self._profile_slopes, self.profile_s, at[None], False)
        root = np.sqrt(lengths(at))
        slopes = root[:, None] * refitted(slope[..., None] * sites.values, sites)
        slopes += residuals[..., None] * (lengths(sites.values.T).T / (2 * root[:, None]))
        return (root * residuals * known).ravel(), (slopes * known[..., None]).reshape(-1, len(s))

    def _fit_along(self, s: Array, degree: int) -> tuple[SplineSites, BoolArray, Array]:
        """Least squares on planes at some s (..., n): the sites, whether they were met, what is left, (..., r, l)."""
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


def refitted(changes: Array, sites: SplineSites) -> Array:
    """What least squares leave of changes (r, l, m) at the sites."""
    r, l, m = changes.shape
    flat = changes.transpose(1, 0, 2).reshape(l, -1)
    left = flat - product(sites.values, product(sites.inverse, flat))
    return left.reshape(l, r, m).transpose(1, 0, 2)


def lengths(positions: Array) -> Array:
    """How much lies about each of some ascending places (..., l): half of the way between its neighbours."""
    steps = np.diff(positions) / 2
    none = np.zeros_like(steps[..., :1])
    return np.concatenate((none, steps), axis=-1) + np.concatenate((steps, none), axis=-1)


def periodic_lengths(positions: Array) -> Array:
    """As ``lengths``, of angles (..., l) that go all round [rad]."""
    lengths = np.roll(positions, -1, axis=-1) - np.roll(positions, 1, axis=-1)
    return np.abs((lengths + TURN / 2) % TURN - TURN / 2) / 2


def mean_square(values: Array) -> Array:
    """Over the last two axes, shape (...)."""
    return np.asarray(np.einsum("...ij,...ij->...", values, values) / (values.shape[-2] * values.shape[-1]))


def is_known(known: Array, positions: Array, at: Array, closed: bool) -> BoolArray:
    """Whether rows that are ``known`` at even places are so on both sides of others; shapes as of ``interpolated``."""
    if known.all():
        return np.ones((*at.shape[:-2], len(known), at.shape[-1]), bool)
    return interpolated(known, positions, at, closed) == 1


def interpolated(heights: Array, known: Array, wanted: Array, closed: bool) -> Array:
    """Heights at even places as straight lines between them.

    Parameters
    ----------
    heights : array, shape (r, k)
    known : array, shape (k,)
        The even places.
    wanted : array, shape (..., r, l), or (..., 1, l) for the same in all rows
    closed : bool
        Whether the first height follows the last.

    Returns
    -------
    array, shape (..., r, l)
    """
    r, k = heights.shape
    position = (wanted - known[0]) / (known[1] - known[0])
    if not closed:
        position = np.clip(position, 0, k - 1)
    before: IntArray = np.floor(position).astype(np.int64)
    if not closed:
        before = np.minimum(before, k - 2)
    fraction = position - before
    after = before + 1
    if closed:
        before, after = before % k, after % k
    start = k * np.arange(r)[:, None]
    low, high = heights.take(before + start), heights.take(after + start)
    return low + fraction * (high - low)


def misfits(residuals: Array, weights: Array, measure: str) -> Array:
    """Mean or largest size of residuals (..., r, sites), as ``measure`` says; shape (...). Zero weight: none."""
    size = np.abs(residuals) * (weights if measure == "mean" else weights > 0)
    if measure == "max":
        return np.asarray(size.max(axis=(-2, -1)))
    return np.asarray(size.sum(axis=(-2, -1)) / np.maximum(weights.sum(axis=(-2, -1)), 1e-300))


def root_mean_squares(residuals: Array, known: BoolArray, unknowns: int, weights: Array | float = 1.0) -> Array:
    """Of residuals (..., r, sites) of which some went into unknowns; shape (...).

    Sites beside which the mesh was not met do not count; the others have ``weights`` (..., sites).
    """
    counts, squares = known.sum(axis=-2), (residuals**2 * known).sum(axis=-2)
    known = (counts * weights).sum(axis=-1) * (1 - unknowns / residuals.shape[-1])
    return np.sqrt((squares * weights).sum(axis=-1) / np.where(known > 0, known, np.inf))


def span_errors(
    residuals: Array, known: BoolArray, unknowns: int, spans: int, closed: bool, weights: Array | float = 1.0
) -> tuple[float, Array]:
    """Root mean square of residuals (r, sites), as of several choices, and mean squares by span.

    A span that the mesh was met nowhere beside has no error. A site on a knot counts half for each side, so that a
    mirrored mesh has mirrored errors.
    """
    sites = residuals.shape[1]
    counts, squares = known.sum(axis=0) * 0.5, (residuals**2 * known).sum(axis=0) * 0.5
    position, last = np.arange(sites) * spans, sites if closed else sites - 1
    sides = [(position + side) // last for side in (0, -1)]
    sides = [side % spans if closed else np.clip(side, 0, spans - 1) for side in sides]
    by_span, count = (sum(np.bincount(side, x, spans) for side in sides) for x in (squares, counts))
    return float(root_mean_squares(residuals, known, unknowns, weights)), by_span / np.maximum(count, 1)


def filled(heights: Array, closed: bool) -> Array:
    """Heights (r, k) with each gap bridged by a straight line along its row; a row of gaps is taken from beside.

    Raises
    ------
    EmptySection
        If there is nothing to fill from.
    """
    missing = np.isnan(heights)
    if not missing.any():
        return heights
    if missing.all():
        raise EmptySection("no ray of the grid meets the mesh; move the axis into it, or give another grid")
    heights, positions = heights.copy(), np.arange(heights.shape[1])
    whole = np.flatnonzero(~missing.all(axis=1))
    for i in np.flatnonzero(missing.any(axis=1)):
        source = i if i in whole else whole[np.argmin(np.abs(whole - i))]
        known = np.flatnonzero(~missing[source])
        period = len(positions) if closed else None
        heights[i] = np.interp(positions, known, heights[source, known], period=period)
    return heights
