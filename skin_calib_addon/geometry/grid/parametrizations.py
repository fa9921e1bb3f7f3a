"""Parametrizations of a region: s along the u-direction and t across it give the plane and the ray of each point."""

from dataclasses import dataclass

import numpy as np

from ...common.arrays import Array, over_rows
from ..sampling.frames import TubeFrame
from ..sampling.lines import LineGrid
from ..sampling.planes import Planes
from ..sampling.rays import TURN
from .curved_axis import CurvedAxis


@dataclass(frozen=True, eq=False)
class TubeParametrization:
    """About an axis: s is the station [m], t the angle [rad], clockwise, so that r_u x r_v points outward."""

    frame: TubeFrame | CurvedAxis
    span: tuple[float, float]  # first and last station [m]
    sector: tuple[float, float] | None = None  # first and last angle, counter-clockwise [rad]; None: a full turn

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
        """Return the rays at every pair of s and t.

        Parameters
        ----------
        s : array, shape (k,)
            Stations [m].
        t : array, shape (l,)
            Angles [rad].

        Returns
        -------
        origins, directions : array, shape (k, l, 3)
            [m], and of length one.
        """
        directions = self.frame.fan(s, self.angles(t))
        return np.broadcast_to(self.frame.planes(s).points[:, None], directions.shape), directions

    def blend(self, weights: Array, t: Array, heights: Array) -> tuple[Array, Array]:
        r"""Return the points of a spline whose control points are on some lines.

        The plane coordinates of the point at the site :math:`l` are

        .. math::

            (x_l, y_l) = \sum_j w_{lj}\, h_j\, (\cos t_j, \sin t_j)

        with the weights :math:`w_{lj}`, and the heights :math:`h_j` [m] of the control points on lines at :math:`t_j`.

        Parameters
        ----------
        weights : array, shape (l, m)
            Basis functions at the sites.
        t : array, shape (..., m)
            Of the lines; the leading axes are several choices of lines.
        heights : array, shape (..., r, m)
            Of the control points along their lines, in each of r rows [m].

        Returns
        -------
        t, heights : array, shape (..., r, l)
            Of the points of the spline.
        """
        x, y = (over_rows(heights * wave(t)[..., None, :], weights.T) for wave in (np.cos, np.sin))
        return np.arctan2(y, x) % TURN, np.hypot(x, y)

    def steps(self, heights: Array) -> Array:
        """Return the distance of points one unit of t apart at some heights, of any shape [m]."""
        return heights

    def residual_slopes(
        self, weights: Array, t: Array, heights: Array, at: Array, height: Array, slope: Array
    ) -> Array:
        """Return the derivatives of the residuals between mesh and spline by the t of each line, shape (r, l, m).

        Parameters
        ----------
        weights, t, heights : array
            As for ``blend``; one choice of lines.
        at, height : array, shape (r, l)
            The result of ``blend``.
        slope : array, shape (r, l)
            Derivative of the height of the mesh by t there.

        Returns
        -------
        array, shape (r, l, m)
        """
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
    closed = False
    bends = False

    def planes(self, s: Array) -> Planes:
        """Return one plane perpendicular to ``along`` at each s."""
        points = self.corner + s[:, None] * self.along
        return Planes(points, np.broadcast_to(self.along, points.shape))

    def rays(self, s: Array, t: Array) -> tuple[Array, Array]:
        """Return the rays at every pair of s and t.

        Parameters
        ----------
        s : array, shape (k,)
            [m]
        t : array, shape (l,)
            [m]

        Returns
        -------
        origins, directions : array, shape (k, l, 3)
            [m], and of length one.
        """
        origins = self.planes(s).points[:, None] + t[:, None] * self.side
        return origins, np.broadcast_to(self.up, origins.shape)

    def blend(self, weights: Array, t: Array, heights: Array) -> tuple[Array, Array]:
        """Return the points of a spline as for a tube; all rays are parallel.

        Parameters
        ----------
        weights, t, heights : array
            As for a tube.

        Returns
        -------
        t, heights : array, shape (..., r, l)
            Of the points of the spline [m].
        """
        height = over_rows(heights, weights.T)
        return np.broadcast_to((t @ weights.T)[..., None, :], height.shape), height

    def steps(self, heights: Array) -> Array:
        """Return ones, as t is a length."""
        return np.ones_like(heights)

    def residual_slopes(
        self, weights: Array, t: Array, heights: Array, at: Array, height: Array, slope: Array
    ) -> Array:
        """Return the derivatives of the residuals by the t of each line, as for a tube; lines do not change heights.

        Parameters
        ----------
        weights, t, heights, at, height, slope : array
            As for a tube.

        Returns
        -------
        array, shape (r, l, m)
        """
        return slope[..., None] * weights

    def names(self, t: Array) -> tuple[str, ...]:
        """Return the names of the lines in messages."""
        return tuple(f"v-plane {j}" for j in range(len(t)))


Parametrization = TubeParametrization | FaceParametrization


def parametrized_lines(parametrization: Parametrization, s: Array, t: Array, centre: Array | None = None) -> LineGrid:
    """Return the lines of the control points at every pair of s and t.

    Parameters
    ----------
    parametrization : TubeParametrization or FaceParametrization
        The region.
    s : array, shape (n,)
        Of the planes [m].
    t : array, shape (m,)
        Of the lines [rad] or [m].
    centre : array, shape (3,), optional
        Point of the mesh at the middle of the region [m].

    Returns
    -------
    LineGrid
    """
    return LineGrid(
        parametrization.planes(s),
        *parametrization.rays(s, t),
        parametrization.closed,
        parametrization.names(t),
        centre=centre,
    )
