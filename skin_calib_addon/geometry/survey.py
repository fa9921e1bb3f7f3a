"""A first look at a mesh in its chart: a few outlines and profiles, and what spacings of lines would leave of them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Array, IntArray, product
from ..errors import EmptySection
from .basis import spline_sites
from .charts import Chart
from .mesh import TriangleMesh
from .rays import TURN
from .samples import cast_rays

OUTLINES, OUTLINE_RAYS = 8, 720  # across
PROFILES = 48  # along
ROWS_PER_SPAN = 4  # of a profile
FEWEST_ROWS, MOST_ROWS = 24, 72
# Lines lie as densely as this power of the curvature: a corner gets them, a flat keeps a few.
CURVATURE_POWER = 0.35
FLAT = 1e-3  # share of the mean below which a curvature is none but rounding
SMOOTHING_STEPS = 2.3  # of the outlines, over which curvature is averaged: facets are corners too
ROUNDS = 4
DENSE = 6  # sites per span where errors along are judged: a short spline passes through three


@dataclass(frozen=True, eq=False)
class Survey:
    """Heights of a mesh over a chart: distances along its rays, on a few dense lines in each direction."""

    chart: Chart
    outline_t: Array  # (l,) all round, or from edge to edge
    outlines: Array  # (OUTLINES, l) [m]
    outlines_known: Array  # (OUTLINES, l) 1 where the mesh was met, 0 where a gap was bridged
    profile_s: Array  # (k,)
    profiles: Array  # (PROFILES, k) [m]
    profiles_known: Array  # (PROFILES, k)

    @classmethod
    def of(cls, mesh: TriangleMesh, chart: Chart, planes: int) -> "Survey":
        """Survey a mesh, finely enough to place up to so many planes.

        Raises
        ------
        EmptySection
            If no ray meets the mesh.
        """
        rows = min(max(ROWS_PER_SPAN * planes, FEWEST_ROWS), MOST_ROWS)
        s, t = np.linspace(*chart.span, rows + 1), np.linspace(*chart.breadth, OUTLINE_RAYS + 1)
        if chart.closed:
            t = t[:-1]
        outline_s = np.linspace(*chart.span, 2 * OUTLINES + 1)[1::2]
        profile_t = t[:: OUTLINE_RAYS // PROFILES][:PROFILES]
        outlines, profiles = (
            cast_rays(mesh, chart.planes(rows), *chart.rays(rows, columns))
            for rows, columns in ((outline_s, t), (s, profile_t))
        )
        met, profiles_met = (~np.isnan(h) * 1.0 for h in (outlines, profiles.T))
        return cls(chart, t, filled(outlines, chart.closed), met, s, filled(profiles.T, False), profiles_met)

    @cached_property
    def densities(self) -> dict[str, Array]:
        """Arc length, and a power of the curvature over it, per step of t on the outlines, shapes (l,)."""
        origins, rays = self.chart.rays(self.profile_s[:1], self.outline_t)
        points = origins + self.outlines[..., None] * rays
        step = np.roll(points, -1, axis=1) - points
        length = np.sqrt((step**2).sum(axis=2))
        heading = step / np.maximum(length, 1e-300)[..., None]
        turn = np.sqrt(((heading - np.roll(heading, 1, axis=1)) ** 2).sum(axis=2))
        length = (length + np.roll(length, 1, axis=1)) / 2
        if not self.chart.closed:  # the ends have no curve on one side
            turn[:, [0, -1]], length[:, [0, -1]] = turn[:, [1, -2]], length[:, [1, -2]]
        # Averaged as a convolution all round.
        l = len(self.outline_t)
        window = np.exp(-0.5 * (TURN * np.fft.rfftfreq(l) * SMOOTHING_STEPS) ** 2)
        smooth_turn, smooth_length = (np.fft.irfft(np.fft.rfft(x) * window, l) for x in (turn, length))
        curvature = np.abs(smooth_turn) / smooth_length
        curvature = np.maximum(curvature, FLAT * curvature.mean())
        curved = curvature**CURVATURE_POWER * smooth_length
        return {"arc": length.mean(axis=0), "curvature": curved.mean(axis=0)}

    def error_across(self, t: Array, degree: int) -> tuple[float, Array]:
        """What lines at some t leave between outlines and fits.

        Returns
        -------
        error : float
            Root mean square, corrected for what went into the unknowns [m].
        energies : array, shape (spans,)
            Mean square of each span of the spline [m^2].
        """
        sites = spline_sites(len(t), degree, self.chart.closed)
        at, steps = self.chart.blend(sites.values, t)
        closed = self.chart.closed
        heights, met = (interpolated(h, self.outline_t, at, closed) for h in (self.outlines, self.outlines_known))
        # The lines fan out from the rays: a few rounds mend what the factors of parallel ones leave.
        for _ in range(ROUNDS if steps is not sites.values else 1):
            heights = heights - product(product(heights, sites.inverse.T), steps.T)
        return spread(heights, met, len(t), len(t) if closed else len(t) - degree)

    def error_along(self, s: Array, degree: int) -> tuple[float, Array]:
        """What planes at some s leave between profiles and fits, as for lines across."""
        sites = spline_sites(len(s), degree, False, DENSE)
        at = sites.values @ s
        heights, met = (interpolated(h, self.profile_s, at, False) for h in (self.profiles, self.profiles_known))
        left = heights - product(product(heights, sites.inverse.T), sites.values.T)
        return spread(left, met, len(s), len(s) - degree)


def interpolated(heights: Array, known: Array, wanted: Array, closed: bool) -> Array:
    """Heights (r, k) at even places ``known`` as straight lines between them, at ``wanted``; shape (r, len(wanted))."""
    step = known[1] - known[0]
    place = (wanted - known[0]) / step
    if closed:
        before: IntArray = np.floor(place).astype(np.int64) % len(known)
        after = (before + 1) % len(known)
    else:
        place = np.clip(place, 0, len(known) - 1)
        before = np.minimum(place.astype(np.int64), len(known) - 2)
        after = before + 1
    share = place - np.floor(place) if closed else place - before
    return heights[:, before] * (1 - share) + heights[:, after] * share


def spread(residuals: Array, met: Array, unknowns: int, spans: int) -> tuple[float, Array]:
    """Root mean square of residuals (r, sites) of which some went into unknowns, and mean squares by span.

    Sites beside which the mesh was not met (``met`` below 1) do not count; a span of such has no error.
    """
    counts = (met == 1).sum(axis=0)
    squares = (residuals**2 * (met == 1)).sum(axis=0)
    span = np.minimum((np.arange(len(squares)) * spans) // len(squares), spans - 1)
    by_span = np.bincount(span, squares) / np.maximum(np.bincount(span, counts), 1)
    return float(np.sqrt(squares.sum() / max(counts.sum() * (1 - unknowns / len(squares)), 1))), by_span


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
    heights, places = heights.copy(), np.arange(heights.shape[1])
    whole = np.flatnonzero(~missing.all(axis=1))
    for i in np.flatnonzero(missing.any(axis=1)):
        source = i if i in whole else whole[np.argmin(np.abs(whole - i))]
        known = np.flatnonzero(~missing[source])
        period = len(places) if closed else None
        heights[i] = np.interp(places, known, heights[source, known], period=period)
    return heights
