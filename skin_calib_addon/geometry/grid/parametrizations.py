"""Parametrizations of a region: s along the u-direction and t across it give the plane and the ray of each point."""

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np

from ...common.arrays import Array, BoolArray, freeze, over_rows
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

    def blend(self, weights: Array, t: Array, heights: Array) -> tuple[Array, Array]:
        r"""Return the points of a spline whose control points are on some lines.

        The plane coordinates of the point at the site :math:`l` are

        .. math::

            (x_l, y_l) = \sum_j w_{lj}\, h_j\, (\cos t_j, \sin t_j)

        with the weights :math:`w_{lj}`, and the heights :math:`h_j` [m] of the control points on lines at :math:`t_j`.
        """
        x, y = (over_rows(heights * wave(t)[..., None, :], weights.T) for wave in (np.cos, np.sin))
        return np.arctan2(y, x) % TURN, np.hypot(x, y)

    def steps(self, heights: Array) -> Array:
        """Return the distance of points one unit of t apart at some heights, of any shape [m]."""
        return heights

    def residual_slopes(
        self, weights: Array, t: Array, heights: Array, at: Array, height: Array, slope: Array
    ) -> Array:
        """Return the derivatives of the residuals between mesh and spline by the t of each line, shape (r, l, m)."""
        c, s, ratio = np.cos(at), np.sin(at), slope / height
        # A moving line moves a point across its ray, where the height of the mesh changes, and along its ray.
        x, y = (part[:, None] * weights for part in (heights * np.cos(t), heights * np.sin(t)))
        return (ratio * c - s)[..., None] * x + (ratio * s + c)[..., None] * y

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

    def blend(self, weights: Array, t: Array, heights: Array) -> tuple[Array, Array]:
        """Return the points of a spline as for a tube; all rays are parallel."""
        height = over_rows(heights, weights.T)
        return np.broadcast_to((t @ weights.T)[..., None, :], height.shape), height

    def steps(self, heights: Array) -> Array:
        """Return ones, as t is a length."""
        return np.ones_like(heights)

    def residual_slopes(
        self, weights: Array, t: Array, heights: Array, at: Array, height: Array, slope: Array
    ) -> Array:
        """Return the derivatives of the residuals by the t of each line, as for a tube; lines do not change heights."""
        return slope[..., None] * weights

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


def heights(mesh: TriangleMesh, parametrization: Parametrization, s: Array, t: Array) -> Array:
    """Return the heights of a mesh along the rays of a region."""
    origins, directions = parametrization.rays(s, t)
    found = cast_rays(mesh, parametrization.planes(s), origins, directions)
    if parametrization.boundary is not None:
        found[~inside(parametrization, origins + found[..., None] * directions)] = np.nan
    return found


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
