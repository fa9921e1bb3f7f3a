"""Where the planes of a tube go when the author leaves it open: where they lower the error most."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from ..arrays import Array, product, unit
from ..errors import EmptySection
from .basis import check_counts, spline_sites
from .bspline import greville
from .frames import TubeFrame
from .lines import LineGrid, fan
from .mesh import TriangleMesh
from .rays import TURN, RayCaster
from .sections import cut_sections

SPACINGS = ("auto", "uniform", "arc", "curvature")
ROWS, RAYS = 29, 720  # of a survey
OUTLINE_STEP = 4  # every so many rows stand for the outline
# Lines lie as densely as this power of the curvature: a corner gets them, a flat keeps a few.
CURVATURE_POWER = 0.35
SMOOTHING_ANGLE = 0.02  # [rad] over which curvature is averaged: facets are corners too
PROFILES = 45  # along the tube, evenly around it
ROUNDS = 4
DENSE = 6  # sites per span where errors along the tube are judged: a short spline passes through three
SAME = 1e-7  # share of an error, and of a radius, by which errors may differ and be the same
PHASES = (0.0, 0.25, 0.5, 0.75)  # shares of a line's interval by which closed lines may be turned


@dataclass(frozen=True, eq=False)
class Survey:
    """A tube as a height map: how far the mesh lies from the axis at even stations and angles.

    The angles go all round, or over a sector from its first to its last half-plane.
    """

    frame: TubeFrame
    span: tuple[float, float]  # first and last station of the planes [m]
    stations: Array  # (k,) [m]
    angles: Array  # (l,) [rad], ascending
    radii: Array  # (k, l) [m]; gaps are filled from beside
    closed: bool

    @classmethod
    def of(
        cls, mesh: TriangleMesh, frame: TubeFrame, span: tuple[float, float], sector: tuple[float, float] | None = None
    ) -> "Survey":
        """Survey a mesh between two stations, all round or in a sector.

        Raises
        ------
        EmptySection
            If no ray meets the mesh.
        """
        stations = np.linspace(*span, ROWS)
        angles = np.arange(RAYS) * TURN / RAYS if sector is None else np.linspace(*sector, RAYS)
        planes = frame.planes(stations)
        sections = cut_sections(mesh, planes, frame.across(mesh.vertices - frame.point))
        caster = RayCaster(sections.plane, sections.ends, ROWS, centres=np.zeros((ROWS, 2)))
        rays = np.broadcast_to(np.column_stack((np.cos(angles), np.sin(angles))), (ROWS, RAYS, 2))
        radii, _ = caster.cast(np.zeros((ROWS, RAYS, 2)), rays)
        return cls(frame, span, stations, angles, filled(radii), sector is None)

    def radii_at(self, angles: Array) -> Array:
        """Radii of every row at some angles, shape (k, len(angles)) [m]."""
        if self.closed:
            place = (angles % TURN) * RAYS / TURN
            before = np.floor(place).astype(int) % RAYS
            after = (before + 1) % RAYS
        else:
            place = np.clip((angles - self.angles[0]) / (self.angles[-1] - self.angles[0]), 0, 1) * (RAYS - 1)
            before = np.minimum(place.astype(int), RAYS - 2)
            after = before + 1
        share = place - np.floor(place)
        return self.radii[:, before] * (1 - share) + self.radii[:, after] * share

    def density(self, spacing: str) -> Array:
        """How densely lines should lie at each angle, shape (l,); any scale."""
        if spacing == "uniform":
            return np.ones(len(self.angles))
        radii = self.radii[::OUTLINE_STEP]
        x, y = radii * np.cos(self.angles), radii * np.sin(self.angles)
        dx, dy = np.roll(x, -1, axis=1) - x, np.roll(y, -1, axis=1) - y
        length, heading = np.hypot(dx, dy), np.arctan2(dy, dx)
        turn = heading - np.roll(heading, 1, axis=1)
        turn -= TURN * np.rint(turn / TURN)
        length = (length + np.roll(length, 1, axis=1)) / 2
        if not self.closed:  # the ends have no curve on one side
            turn[:, [0, -1]], length[:, [0, -1]] = turn[:, [1, -2]], length[:, [1, -2]]
        if spacing == "arc":
            return length.mean(axis=0)
        # Averaged over the smoothing angle as a convolution round the circle.
        waves = np.fft.rfftfreq(RAYS, (self.angles[1] - self.angles[0]) / TURN)
        turn, length = (
            np.fft.irfft(np.fft.rfft(x) * np.exp(-0.5 * (waves * SMOOTHING_ANGLE) ** 2), RAYS) for x in (turn, length)
        )
        return ((np.abs(turn) / length) ** CURVATURE_POWER * length).mean(axis=0)

    def line_grid(self, n: int, lines: int, spacing: str, degree: tuple[int, int]) -> LineGrid:
        """The lines of ``n`` planes and ``lines`` half-planes, clockwise so that r_u x r_v points outward.

        Raises
        ------
        UnderdeterminedFit
            If they are too few for the degree.
        """
        check_counts(n, degree[0], "u-planes")
        check_counts(lines, degree[1], "v-lines")
        angles = self.line_angles(lines, spacing, degree[1])
        return fan(self.frame, self.plane_stations(n, spacing, degree[0]), angles, self.closed)

    def line_angles(self, count: int, spacing: str, degree: int) -> Array:
        """Angles of ``count`` lines, descending; the spacing that leaves the least error where it is ``auto``."""
        choices = SPACINGS[1:] if spacing == "auto" else (spacing,)
        phases = PHASES if self.closed and spacing == "auto" else (0.0,)
        densities = [self.density(choice) for choice in choices]
        candidates = [self._quantiles(density, count, phase) for density in densities for phase in phases]
        if not self.closed:
            ends = np.linspace(self.angles[-1], self.angles[0], 2)
            abscissae = greville(spline_sites(count, degree, False).knots, degree)
            candidates.append(ends[0] + abscissae * (ends[1] - ends[0]))
        errors = [self.error_across(c, degree) for c in candidates] if len(candidates) > 1 else [0.0]
        return candidates[self._least(errors)]

    def _quantiles(self, density: Array, count: int, phase: float) -> Array:
        """Angles with equal shares of a density between them, descending."""
        if self.closed:
            edges = np.append(self.angles, TURN) - self.angles[1] / 2
            shares = (np.arange(count) + phase) / count
            share = np.append(0.0, np.cumsum(density))
        else:
            edges, shares = self.angles, np.linspace(0, 1, count)
            share = np.append(0.0, np.cumsum((density[1:] + density[:-1]) / 2))
        return np.interp(shares, share / share[-1], edges)[::-1]

    def error_across(self, angles: Array, degree: int) -> float:
        """Error that lines at these angles leave between sections and fits, root mean square [m]."""
        lines = np.column_stack((np.cos(angles), np.sin(angles)))
        sites = spline_sites(len(angles), degree, self.closed)
        rays = sites.values @ lines
        radii = self.radii_at(np.arctan2(rays[:, 1], rays[:, 0]))[::OUTLINE_STEP]
        # The lines fan out from the rays: offsets reach a ray by its cosine to each line, and a few rounds mend that.
        fanned = sites.values * (unit(rays) @ lines.T)
        for _ in range(ROUNDS):
            radii = radii - product(product(radii, sites.inverse.T), fanned.T)
        return spread(radii, 1 - len(angles) / len(rays))

    def plane_stations(self, count: int, spacing: str, degree: int) -> Array:
        """Stations of ``count`` planes: even ones, or those of a linear parametrisation where that is better."""
        first, last = self.span
        even = np.linspace(first, last, count)
        linear = first + (last - first) * greville(spline_sites(count, degree, False).knots, degree)
        if spacing != "auto":
            return even
        return (even, linear)[self._least([self.error_along(stations, degree) for stations in (even, linear)])]

    def _least(self, errors: list[float]) -> int:
        """Which error is the smallest; of those that only rounding tells apart, the first, for symmetric shapes."""
        least = min(errors) * (1 + SAME) + SAME * float(self.radii.mean())
        return next(i for i, error in enumerate(errors) if error <= least)

    def error_along(self, stations: Array, degree: int) -> float:
        """Error that planes at these stations leave between profiles and fits, root mean square [m]."""
        sites = spline_sites(len(stations), degree, False, DENSE)
        at = sites.values @ stations
        profiles = self.radii[:, :: RAYS // PROFILES]
        place = np.clip(np.searchsorted(self.stations, at) - 1, 0, len(self.stations) - 2)
        share = ((at - self.stations[place]) / (self.stations[place + 1] - self.stations[place]))[:, None]
        radii = profiles[place] * (1 - share) + profiles[place + 1] * share
        fitted = product(sites.values, product(sites.inverse, radii))
        return spread(radii - fitted, 1 - len(stations) / len(at))


def spread(residuals: Array, free: float) -> float:
    """Root mean square of residuals of which only a share is free: the rest went into the fit's unknowns [m]."""
    return float(np.sqrt(np.mean(residuals**2) / free))


def filled(radii: Array) -> Array:
    """Radii with each gap closed by the nearest value, along its row rather than across rows.

    Raises
    ------
    EmptySection
        If there is nothing to fill from.
    """
    if np.isnan(radii).all():
        raise EmptySection("no ray from the axis meets the mesh; move the axis into it, or give another grid")
    missing = np.isnan(radii)
    if not missing.any():
        return radii
    rows, columns = distance_transform_edt(missing, sampling=(4.0, 1.0), return_distances=False, return_indices=True)
    return radii[rows, columns]
