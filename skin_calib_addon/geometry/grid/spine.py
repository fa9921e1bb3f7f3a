"""A bent axis: the curve through the centres of a tube's sections, with planes across it that follow."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from ...common.arrays import Array, unit
from ...common.errors import EmptySection, InvalidPlan
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.frames import TubeFrame
from ..sampling.planes import Planes
from ..sampling.samples import cast_rays
from .axis import ALL_ROUND, longest_run

STATIONS = 15  # at which centres are found
ROUNDS = 8  # of cutting across the curve found so far
REACH = 0.06  # share of its length by which a curve is longer in the next round, where sections are whole
MISSED = 0.05  # share of the rays that may meet nothing in a section that is whole
DEGREE = 4  # of the curve: a limb bends once or twice
# A straight axis serves where the centres stay within this share of the mean radius of it.
STRAIGHT = 0.25
TRIALS = 192  # stations tried for complete sections
INSET = 0.15  # share of the length left out at both ends, where sections slant off the mesh


@dataclass(frozen=True, eq=False)
class Spine:
    """Coordinates about a curve: stations along it, angles from ``e1`` towards ``e2``, which turn as little as may be.

    Beyond its ends the curve goes on straight.
    """

    stations: Array  # (k,) arc length [m]
    points: Array  # (k, 3) [m]
    e1: Array  # (k, 3) unit, across the curve

    @cached_property
    def _curve(self) -> CubicSpline:
        return CubicSpline(self.stations, self.points, bc_type="natural")

    def planes(self, stations: Array) -> Planes:
        """Planes across the curve."""
        s = np.asarray(stations, float)
        inside = np.clip(s, self.stations[0], self.stations[-1])
        tangents = unit(self._curve(inside, 1))
        return Planes(self._curve(inside) + (s - inside)[:, None] * tangents, tangents)

    def fan(self, stations: Array, angles: Array) -> Array:
        """Unit directions away from the curve, shape (len(stations), len(angles), 3)."""
        e3 = self.planes(stations).normals
        near = np.stack([np.interp(stations, self.stations, column) for column in self.e1.T], axis=1)
        e1 = unit(near - (near * e3).sum(axis=1, keepdims=True) * e3)
        e2 = np.cross(e3, e1)
        return np.cos(angles)[:, None] * e1[:, None] + np.sin(angles)[:, None] * e2[:, None]


def find_spine(mesh: TriangleMesh, frame: TubeFrame) -> Spine | None:
    """The curve through the centres of the sections across a straight axis; None if that serves.

    Centres of the sections across a first curve give the next one, until the planes stand upright on it.

    Raises
    ------
    EmptySection
        If the sections across a bent axis are open.
    """
    height = frame.stations(mesh.vertices)
    inset = INSET * float(np.ptp(height))
    stations = np.linspace(height.min() + inset, height.max() - inset, STATIONS)
    centres, radius = section_centres(mesh, frame.planes(stations), frame.fan(stations, ALL_ROUND))
    if len(centres) <= DEGREE:
        return None
    off = centres - centres.mean(axis=0)
    direction = np.linalg.svd(off)[2][0]
    if np.linalg.norm(off - np.outer(off @ direction, direction), axis=1).max() < STRAIGHT * radius:
        return None
    spine = curve_through(centres, frame.e1)
    for _ in range(ROUNDS):
        length = spine.stations[-1]
        stations = np.linspace(-REACH * length, (1 + REACH) * length, STATIONS)
        centres, _ = section_centres(mesh, spine.planes(stations), spine.fan(stations, ALL_ROUND))
        if len(centres) <= DEGREE:
            raise EmptySection("no axis found that the sections of the mesh follow; give the axis, or cut the mesh")
        spine = curve_through(centres, spine.e1[0])
    return spine


def section_centres(mesh: TriangleMesh, planes: Planes, fan: Array) -> tuple[Array, float]:
    """Centres of the sections that nearly all rays from their plane's point meet, (k, 3), and the mean radius [m]."""
    reach = cast_rays(mesh, planes, np.broadcast_to(planes.points[:, None], fan.shape), fan)
    whole = np.isnan(reach).mean(axis=1) < MISSED
    if not whole.any():
        return np.empty((0, 3)), 0.0
    reach, fan = reach[whole], fan[whole]
    return planes.points[whole] + centroids(reach[..., None] * fan), float(np.nanmean(reach))


def centroids(arms: Array) -> Array:
    """Centroids of the fans of triangles between neighbouring arms (k, l, 3), but for those beside a missing one."""
    following = np.roll(arms, -1, axis=1)
    areas = np.linalg.norm(np.cross(arms, following), axis=2)
    return np.nansum(areas[..., None] * (arms + following) / 3, axis=1) / np.nansum(areas, axis=1)[:, None]


def curve_through(centres: Array, first: Array) -> Spine:
    """A smooth curve near some centres in order, with frames that turn as little as may be from ``first`` on."""
    place = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(centres, axis=0), axis=1)))
    fine = np.linspace(0, place[-1], 16 * len(centres))
    scaled = 2 * place / place[-1] - 1
    coefficients = np.polynomial.legendre.legfit(scaled, centres, DEGREE)
    points = np.polynomial.legendre.legval(2 * fine / place[-1] - 1, coefficients).T
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    even = np.linspace(0, length[-1], len(centres))
    chosen = np.stack([np.interp(even, length, column) for column in points.T], axis=1)
    tangents = unit(np.gradient(chosen, axis=0))
    e1 = np.empty_like(chosen)
    e1[0] = unit(first - (first @ tangents[0]) * tangents[0])
    for i in range(1, len(chosen)):
        e1[i] = unit(e1[i - 1] - (e1[i - 1] @ tangents[i]) * tangents[i])
    return Spine(even, chosen, e1)


def spine_span(mesh: TriangleMesh, spine: Spine, margin: float | None) -> tuple[float, float]:
    """First and last station for the planes: the longest run of complete sections, or a margin from the mesh's ends.

    Raises
    ------
    EmptySection
        If no sections are complete.
    InvalidPlan
        If the margin leaves nothing.
    """
    length = spine.stations[-1]
    trials = np.linspace(-0.5 * length, 1.5 * length, TRIALS)
    planes, fan = spine.planes(trials), spine.fan(trials, ALL_ROUND)
    met = ~np.isnan(cast_rays(mesh, planes, np.broadcast_to(planes.points[:, None], fan.shape), fan))
    first, last = longest_run(met.all(axis=1) if margin is None else met.mean(axis=1) > 0.5)
    if last - first < 2:
        raise EmptySection("no sections across the bent axis go all the way round; use a patch grid, or give the axis")
    low, high = float(trials[first]), float(trials[last - 1])
    if margin is None:
        return low, high
    if low + margin >= high - margin:
        raise InvalidPlan(f"margin {margin * 1e3:g} mm at both ends leaves nothing along the axis; make it smaller")
    return low + margin, high - margin
