"""Parametrizations of a region: s along the u-direction and t across it give the plane and the ray of each point."""

from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import TypeVar

import numpy as np

from ...common.arrays import Array, BoolArray, freeze
from ..mesh.triangle_mesh import TriangleMesh
from ..sampling.frames import TubeFrame
from ..sampling.lines import LineGrid
from ..sampling.planes import Planes
from ..sampling.rays import TURN
from ..sampling.samples import cast_rays
from .boundary import Boundary
from .curved_axis import CurvedAxis

# [fraction] of the extent of a boundary by which the grid goes beyond it. Larger: more sites are outside; without it,
# rounding decides about those on an edge that is parallel to the first row.
BEYOND_BOUNDARY = 1e-3
CENTRE_RAYS = 721  # [1] rays from edge to edge that find the rims of a hole in the middle. Larger: a more exact centre


@dataclass(frozen=True, eq=False)
class TubeParametrization:
    """About an axis: s is the station [m], t the angle [rad], clockwise, so that r_u x r_v points outward."""

    frame: TubeFrame | CurvedAxis
    span: tuple[float, float]  # first and last station [m]
    sector: tuple[float, float] | None = None  # first and last angle, counter-clockwise [rad]; None: a full turn
    boundary: Boundary | None = None

    period = TURN  # of the second coordinate

    def coordinates(self, points: Array) -> Array:
        """Return station [m] and angle [rad] of points (..., 3), shape (..., 2)."""
        assert isinstance(self.frame, TubeFrame)  # a region with a boundary has a straight axis
        x, y = np.moveaxis(self.frame.across(points - self.frame.point), -1, 0)
        return np.stack((self.frame.stations(points), np.arctan2(y, x)), axis=-1)

    @property
    def closed(self) -> bool:
        """Return whether t covers a full turn."""
        return self.sector is None

    @property
    def bends(self) -> bool:
        """Return whether the rays start on a curve."""
        return isinstance(self.frame, CurvedAxis)

    @property
    def breadth(self) -> tuple[float, float]:
        """Return the first and the last t [rad]."""
        return (0.0, TURN) if self.sector is None else (0.0, self.sector[1] - self.sector[0])

    def angles(self, t: Array) -> Array:
        """Return the angles from ``frame.e1`` towards ``frame.e2`` [rad]."""
        return (0.0 if self.sector is None else self.sector[1]) - t

    def planes(self, s: Array) -> Planes:
        """Return one plane across the axis at each station."""
        return self.frame.planes(s)

    def rays(self, s: Array, t: Array) -> tuple[Array, Array]:
        """Return the rays at every pair of s and t."""
        directions = self.frame.fan(s, self.angles(t))
        return np.broadcast_to(self.frame.planes(s).points[:, None], directions.shape), directions

    def names(self, t: Array) -> tuple[str, ...]:
        """Return the names of the lines in messages."""
        return tuple(f"half-plane at {round(np.rad2deg(a), 1) % 360:g} degrees" for a in self.angles(t))


@dataclass(frozen=True, eq=False)
class FaceParametrization:
    """Over a face: s and t are lengths along two directions perpendicular to its outward normal [m]."""

    corner: Array  # (3,) [m], inside the robot; s = t = 0
    along: Array  # (3,) unit, of s
    side: Array  # (3,) unit, of t; along x side = up
    up: Array  # (3,) unit, of the rays
    span: tuple[float, float]
    breadth: tuple[float, float]
    boundary: Boundary | None = None
    closed = False
    bends = False
    period = np.inf  # of the second coordinate

    def coordinates(self, points: Array) -> Array:
        """Return s and t of points (..., 3), shape (..., 2) [m]."""
        arms = points - self.corner
        return np.stack((arms @ self.along, arms @ self.side), axis=-1)

    def planes(self, s: Array) -> Planes:
        """Return one plane perpendicular to ``along`` at each s."""
        points = self.corner + s[:, None] * self.along
        return Planes(points, np.broadcast_to(self.along, points.shape))

    def rays(self, s: Array, t: Array) -> tuple[Array, Array]:
        """Return the rays at every pair of s and t."""
        origins = self.planes(s).points[:, None] + t[:, None] * self.side
        return origins, np.broadcast_to(self.up, origins.shape)

    def names(self, t: Array) -> tuple[str, ...]:
        """Return the names of the lines in messages."""
        return tuple(f"v-plane {j}" for j in range(len(t)))


Parametrization = TubeParametrization | FaceParametrization


Loop = tuple[tuple[float, float, float], ...]
AnyParametrization = TypeVar("AnyParametrization", TubeParametrization, FaceParametrization)


def bounded(parametrization: AnyParametrization, loops: tuple[Loop, ...]) -> AnyParametrization:
    """Return a parametrization of the part of a region inside closed loops of points."""
    if not loops:
        return parametrization
    corners = [parametrization.coordinates(np.array(loop)) for loop in loops]
    every = np.concatenate(corners)
    (first, low), (last, high) = every.min(axis=0).tolist(), every.max(axis=0).tolist()
    boundary = Boundary.of(corners, parametrization.period)
    beyond_s, beyond_t = BEYOND_BOUNDARY * (last - first), BEYOND_BOUNDARY * (high - low)
    first, last, low, high = first - beyond_s, last + beyond_s, low - beyond_t, high + beyond_t
    if isinstance(parametrization, TubeParametrization):
        return replace(parametrization, span=(first, last), boundary=boundary)
    return replace(parametrization, span=(first, last), breadth=(low, high), boundary=boundary)


def inside(parametrization: Parametrization, points: Array) -> BoolArray:
    """Return whether points are inside the boundary of a region; without one, all are."""
    if parametrization.boundary is None:
        return np.ones(points.shape[:-1], bool)
    return parametrization.boundary.contains(parametrization.coordinates(points))


def cast_heights(mesh: TriangleMesh, parametrization: Parametrization, s: Array, t: Array) -> Array:
    """Return the heights of a mesh along the rays of a region."""
    origins, directions = parametrization.rays(s, t)
    found = cast_rays(mesh, parametrization.planes(s), origins, directions)
    if parametrization.boundary is not None:
        found[~inside(parametrization, origins + found[..., None] * directions)] = np.nan
    return found


@lru_cache(maxsize=4)  # repeated fits, as in the window, keep the centre of their mesh
def region_centre(mesh: TriangleMesh, parametrization: Parametrization) -> Array | None:
    """Return the point of a mesh at the middle of a region, shape (3,) [m]; None if the section there is empty.

    Over a hole it is between the rims, at an interpolated height.
    """
    s, (first, last) = np.array([sum(parametrization.span) / 2]), parametrization.breadth
    middle, rays = (first + last) / 2, np.linspace(first, last, CENTRE_RAYS)
    height = cast_heights(mesh, parametrization, s, np.array([middle]))[0, 0]
    if np.isnan(height):
        around = cast_heights(mesh, parametrization, s, rays)[0]
        known = ~np.isnan(around)
        if not known.any():
            return None
        height = np.interp(middle, rays[known], around[known])
    origins, directions = parametrization.rays(s, np.array([middle]))
    return np.asarray(origins[0, 0] + height * directions[0, 0])


@dataclass(frozen=True, eq=False)
class ParametrizedLines(LineGrid):
    """Lines of control points, and where they are in a region."""

    parametrization: Parametrization = field(kw_only=True)
    s: Array = field(kw_only=True)  # (n,) of the planes [m]
    t: Array = field(kw_only=True)  # (m,) of the lines [rad] or [m]

    def __post_init__(self):
        super().__post_init__()
        n, m = self.origins.shape[:2]
        freeze(self, s=(n,), t=(m,))

    def moved_to(self, parametrization: Parametrization, centre: Array | None) -> "ParametrizedLines":
        """Return lines at the same fractions of another region of the same kind."""
        before = self.parametrization
        s = scaled(self.s, before.span, parametrization.span)
        t = scaled(self.t, before.breadth, parametrization.breadth)
        return parametrized_lines(parametrization, s, t, centre)


def scaled(values: Array, ends: tuple[float, float], new_ends: tuple[float, float]) -> Array:
    """Return numbers at the same fractions between other ends."""
    result: Array = new_ends[0] + (values - ends[0]) * ((new_ends[1] - new_ends[0]) / (ends[1] - ends[0]))
    return result


def parametrized_lines(
    parametrization: Parametrization, s: Array, t: Array, centre: Array | None = None
) -> ParametrizedLines:
    """Return the lines of the control points at every pair of s and t."""
    return ParametrizedLines(
        parametrization.planes(s),
        *parametrization.rays(s, t),
        parametrization.closed,
        parametrization.names(t),
        centre=centre,
        region=None if parametrization.boundary is None else partial(inside, parametrization),
        parametrization=parametrization,
        s=s,
        t=t,
    )
