"""A curved axis: the curve through the centres of a tube's sections, with planes perpendicular to it."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from ...common.arrays import Array, BoolArray, unit
from ...common.errors import EmptySection, InvalidPlan
from ..mesh.outliers import stray_part
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.frames import TubeFrame
from ..sampling.planes import Planes
from ..sampling.samples import cast_rays
from .axis import (
    FULL_TURN_ANGLES,
    MIN_TUBE_LENGTH,
    SAME_PLANE_FRACTION,
    SECTION_ITERATIONS,
    TRIAL_STATIONS,
    longest_run,
    run_between,
)

# [1] stations at which centres are found. Larger: more bends are seen, more time.
CENTRE_COUNT = 15
# [fraction of its length] by which the next curve extends beyond both ends, if sections are complete there. Larger: the
# curve covers open ends in fewer iterations.
EXTENSION = 0.06
# [fraction of the rays] without a hit below which a section is complete. Larger: centres of open sections are used.
MAX_MISSED_FRACTION = 0.05
CURVE_DEGREE = 4  # of the curve [1]; a limb bends once or twice. Larger: more bends, more influence of noise
# [fraction of the mean radius] largest distance of the centres from a straight axis that still serves. Larger: fewer
# curved axes.
MAX_STRAIGHT_OFFSET = 0.25
END_INSET = 0.15  # [fraction of the length] left out at both ends, where oblique sections leave the mesh


@dataclass(frozen=True, eq=False)
class CurvedAxis:
    """Coordinates about a curve: stations along it, and angles from ``e1`` towards ``e2``.

    The frames have the least rotation about the curve. Beyond its ends the curve is straight.
    """

    stations: Array  # (k,) arc length [m]
    points: Array  # (k, 3) [m]
    e1: Array  # (k, 3) unit, across the curve

    @cached_property
    def _curve(self) -> Any:
        from scipy.interpolate import CubicSpline  # its import takes .1 s, and most links are straight

        return CubicSpline(self.stations, self.points, bc_type="natural")

    def planes(self, stations: Array) -> Planes:
        """Return planes perpendicular to the curve."""
        s = np.asarray(stations, float)
        inside = np.clip(s, self.stations[0], self.stations[-1])
        tangents = unit(self._curve(inside, 1))
        return Planes(self._curve(inside) + (s - inside)[:, None] * tangents, tangents)

    def fan(self, stations: Array, angles: Array) -> Array:
        """Return unit directions away from the curve."""
        e3 = self.planes(stations).normals
        near = np.stack([np.interp(stations, self.stations, column) for column in self.e1.T], axis=1)
        e1 = unit(near - (near * e3).sum(axis=1, keepdims=True) * e3)
        e2 = np.cross(e3, e1)
        return np.cos(angles)[:, None] * e1[:, None] + np.sin(angles)[:, None] * e2[:, None]


@lru_cache(maxsize=4)  # repeated fits, as in the window, keep the axis of their mesh
def find_curved_axis(mesh: TriangleMesh, frame: TubeFrame) -> CurvedAxis | None:
    """Return the curve through the centres of the sections across a straight axis; None if the straight axis serves.

    The centres of the sections across one curve give the next curve, until the planes are perpendicular to it. Where
    steps and ends make the curves alternate, the one nearest to the centres of its own sections counts.
    """
    low, high = frame.extent(mesh.vertices)
    inset = END_INSET * (high - low)
    stations = np.linspace(low + inset, high - inset, CENTRE_COUNT)
    centres, radius, _ = section_centres(mesh, frame.planes(stations), frame.fan(stations, FULL_TURN_ANGLES))
    if len(centres) <= CURVE_DEGREE:
        return None
    off = centres - centres.mean(axis=0)
    direction = np.linalg.svd(off)[2][0]
    if np.linalg.norm(off - np.outer(off @ direction, direction), axis=1).max() < MAX_STRAIGHT_OFFSET * radius:
        return None
    axes, offsets = [curve_through(centres, frame.e1)], []
    for _ in range(SECTION_ITERATIONS):
        length = axes[-1].stations[-1]
        stations = np.linspace(-EXTENSION * length, (1 + EXTENSION) * length, CENTRE_COUNT)
        planes = axes[-1].planes(stations)
        centres, _, complete = section_centres(mesh, planes, axes[-1].fan(stations, FULL_TURN_ANGLES))
        if len(centres) <= CURVE_DEGREE:
            cause = stray_part(mesh) or " Give the axis, or cut the mesh."
            raise EmptySection(f"No axis was found for the sections of the mesh.{cause}")
        offsets.append(np.sqrt(((centres - planes.points[complete]) ** 2).sum(axis=1).mean()))
        axes.append(curve_through(centres, axes[-1].e1[0]))
    return axes[int(np.argmin(offsets))]


def section_centres(mesh: TriangleMesh, planes: Planes, fan: Array) -> tuple[Array, float, BoolArray]:
    """Return the centres of the sections that nearly all rays hit, and their mean radius."""
    distances = cast_rays(mesh, planes, np.broadcast_to(planes.points[:, None], fan.shape), fan)
    whole = np.isnan(distances).mean(axis=1) < MAX_MISSED_FRACTION
    if not whole.any():
        return np.empty((0, 3)), 0.0, whole
    distances, fan = distances[whole], fan[whole]
    return planes.points[whole] + centroids(distances[..., None] * fan), float(np.nanmean(distances)), whole


def centroids(arms: Array) -> Array:
    """Return the centroids of the fans of triangles between adjacent arms (k, l, 3); missing arms are left out."""
    following = np.roll(arms, -1, axis=1)
    areas = np.linalg.norm(np.cross(arms, following), axis=2)
    return np.nansum(areas[..., None] * (arms + following) / 3, axis=1) / np.nansum(areas, axis=1)[:, None]


def curve_through(centres: Array, first: Array) -> CurvedAxis:
    """Return a smooth curve near some centres, with frames of least rotation."""
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
    """Return the first and last station [m]: the longest run of complete sections, or margins from the ends."""
    length = axis.stations[-1]
    trials = np.linspace(-0.5 * length, 1.5 * length, TRIAL_STATIONS)

    def is_complete(stations: Array) -> BoolArray:
        planes, fan = axis.planes(stations), axis.fan(stations, FULL_TURN_ANGLES)
        hit = ~np.isnan(cast_rays(mesh, planes, np.broadcast_to(planes.points[:, None], fan.shape), fan))
        return hit.all(axis=1) if margin is None else hit.mean(axis=1) > 0.5

    first, last = longest_run(is_complete(trials))
    low, high = run_between(is_complete, trials, first, last) if first < last else (0.0, 0.0)
    if high - low < MIN_TUBE_LENGTH:
        raise EmptySection(
            f"The closed part along the curved axis is shorter than {MIN_TUBE_LENGTH * 1e3:g} mm. "
            f"Use a grid over a sector or a face, or give the axis.{stray_part(mesh)}"
        )
    if margin is None:
        return low, high
    if high - low - 2 * margin < SAME_PLANE_FRACTION * mesh.size:
        raise InvalidPlan(f"A margin of {margin * 1e3:g} mm at both ends leaves nothing along the axis. Reduce it.")
    return low + margin, high - margin
