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
from .axis import FULL_TURN_ANGLES, longest_run

CENTRE_COUNT = 15  # at which centres are found
CURVE_ITERATIONS = 8  # of cutting across the curve found so far
EXTENSION = 0.06  # share of its length by which a curve is longer in the next round, where sections are whole
MAX_MISSED_FRACTION = 0.05  # share of the rays that may meet nothing in a section that is whole
CURVE_DEGREE = 4  # of the curve: a limb bends once or twice
# A straight axis serves where the centres stay within this share of the mean radius of it.
MAX_STRAIGHT_OFFSET = 0.25
TRIAL_STATIONS = 192  # stations tried for complete sections
END_INSET = 0.15  # share of the length left out at both ends, where sections slant off the mesh


@dataclass(frozen=True, eq=False)
class CurvedAxis:
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


def find_curved_axis(mesh: TriangleMesh, frame: TubeFrame) -> CurvedAxis | None:
    """The curve through the centres of the sections across a straight axis; None if that serves.

    Centres of the sections across a first curve give the next one, until the planes stand upright on it.

    Raises
    ------
    EmptySection
        If the sections across a bent axis are open.
    """
    height = frame.stations(mesh.vertices)
    inset = END_INSET * float(np.ptp(height))
    stations = np.linspace(height.min() + inset, height.max() - inset, CENTRE_COUNT)
    centres, radius = section_centres(mesh, frame.planes(stations), frame.fan(stations, FULL_TURN_ANGLES))
    if len(centres) <= CURVE_DEGREE:
        return None
    off = centres - centres.mean(axis=0)
    direction = np.linalg.svd(off)[2][0]
    if np.linalg.norm(off - np.outer(off @ direction, direction), axis=1).max() < MAX_STRAIGHT_OFFSET * radius:
        return None
    axis = curve_through(centres, frame.e1)
    for _ in range(CURVE_ITERATIONS):
        length = axis.stations[-1]
        stations = np.linspace(-EXTENSION * length, (1 + EXTENSION) * length, CENTRE_COUNT)
        centres, _ = section_centres(mesh, axis.planes(stations), axis.fan(stations, FULL_TURN_ANGLES))
        if len(centres) <= CURVE_DEGREE:
            raise EmptySection("no axis found that the sections of the mesh follow; give the axis, or cut the mesh")
        axis = curve_through(centres, axis.e1[0])
    return axis


def section_centres(mesh: TriangleMesh, planes: Planes, fan: Array) -> tuple[Array, float]:
    """Centres of the sections that nearly all rays from their plane's point meet, (k, 3), and the mean radius [m]."""
    distances = cast_rays(mesh, planes, np.broadcast_to(planes.points[:, None], fan.shape), fan)
    whole = np.isnan(distances).mean(axis=1) < MAX_MISSED_FRACTION
    if not whole.any():
        return np.empty((0, 3)), 0.0
    distances, fan = distances[whole], fan[whole]
    return planes.points[whole] + centroids(distances[..., None] * fan), float(np.nanmean(distances))


def centroids(arms: Array) -> Array:
    """Centroids of the fans of triangles between neighbouring arms (k, l, 3), but for those beside a missing one."""
    following = np.roll(arms, -1, axis=1)
    areas = np.linalg.norm(np.cross(arms, following), axis=2)
    return np.nansum(areas[..., None] * (arms + following) / 3, axis=1) / np.nansum(areas, axis=1)[:, None]


def curve_through(centres: Array, first: Array) -> CurvedAxis:
    """A smooth curve near some centres in order, with frames that turn as little as may be from ``first`` on."""
    chord_length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(centres, axis=0), axis=1)))
    fine = np.linspace(0, chord_length[-1], 16 * len(centres))
    scaled = 2 * chord_length / chord_length[-1] - 1
    coefficients = np.polynomial.legendre.legfit(scaled, centres, CURVE_DEGREE)
    points = np.polynomial.legendre.legval(2 * fine / chord_length[-1] - 1, coefficients).T
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    even = np.linspace(0, length[-1], len(centres))
    chosen = np.stack([np.interp(even, length, column) for column in points.T], axis=1)
    tangents = unit(np.gradient(chosen, axis=0))
    e1 = np.empty_like(chosen)
    e1[0] = unit(first - (first @ tangents[0]) * tangents[0])
    for i in range(1, len(chosen)):
        e1[i] = unit(e1[i - 1] - (e1[i - 1] @ tangents[i]) * tangents[i])
    return CurvedAxis(even, chosen, e1)


def curved_axis_span(mesh: TriangleMesh, axis: CurvedAxis, margin: float | None) -> tuple[float, float]:
    """First and last station for the planes: the longest run of complete sections, or a margin from the mesh's ends.

    Raises
    ------
    EmptySection
        If no sections are complete.
    InvalidPlan
        If the margin leaves nothing.
    """
    length = axis.stations[-1]
    trials = np.linspace(-0.5 * length, 1.5 * length, TRIAL_STATIONS)
    planes, fan = axis.planes(trials), axis.fan(trials, FULL_TURN_ANGLES)
    hit = ~np.isnan(cast_rays(mesh, planes, np.broadcast_to(planes.points[:, None], fan.shape), fan))
    first, last = longest_run(hit.all(axis=1) if margin is None else hit.mean(axis=1) > 0.5)
    if last - first < 2:
        raise EmptySection("no sections across the bent axis go all the way round; use a patch grid, or give the axis")
    low, high = float(trials[first]), float(trials[last - 1])
    if margin is None:
        return low, high
    if low + margin >= high - margin:
        raise InvalidPlan(f"margin {margin * 1e3:g} mm at both ends leaves nothing along the axis; make it smaller")
    return low + margin, high - margin
