"""Charts: two coordinates, s along the u-direction and t across it, that give the plane and the ray at each place."""

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
    """Around an axis: s is the station [m], t the angle [rad], clockwise so that r_u x r_v points outward."""

    frame: TubeFrame | CurvedAxis
    span: tuple[float, float]  # first and last station [m]
    sector: tuple[float, float] | None = None  # first and last angle, counter-clockwise [rad]; None: all round

    @property
    def closed(self) -> bool:
        """Whether t goes all round."""
        return self.sector is None

    @property
    def bends(self) -> bool:
        """Whether the rays start on a curve."""
        return isinstance(self.frame, CurvedAxis)

    @property
    def breadth(self) -> tuple[float, float]:
        """First and last t."""
        return (0.0, TURN) if self.sector is None else (0.0, self.sector[1] - self.sector[0])

    @property
    def seam(self) -> Array | None:
        """Of what goes all round: the ray at angle zero half way along, a point [m] and a unit direction."""
        if not self.closed:
            return None
        origins, directions = self.rays(np.array([sum(self.span) / 2]), np.zeros(1))
        return np.stack((origins[0, 0], directions[0, 0]))

    def angles(self, t: Array) -> Array:
        """Angles from ``frame.e1`` towards ``frame.e2``."""
        return (0.0 if self.sector is None else self.sector[1]) - t

    def planes(self, s: Array) -> Planes:
        """One plane across the axis at each station."""
        return self.frame.planes(s)

    def rays(self, s: Array, t: Array) -> tuple[Array, Array]:
        """Origins and unit directions of the rays at every pair, shapes (k, l, 3)."""
        directions = self.frame.fan(s, self.angles(t))
        return np.broadcast_to(self.frame.planes(s).points[:, None], directions.shape), directions

    def blend(self, weights: Array, t: Array, heights: Array) -> tuple[Array, Array]:
        """Where a spline lies whose control points stand on some lines.

        Parameters
        ----------
        weights : array, shape (l, m)
            Basis functions at the sites.
        t : array, shape (..., m)
            Of the lines; of several choices of them at once.
        heights : array, shape (..., r, m)
            Of the control points along their lines, in each of r rows [m].

        Returns
        -------
        t, heights : array, shape (..., r, l)
            Of the spline's points.
        """
        x, y = (over_rows(heights * wave(t)[..., None, :], weights.T) for wave in (np.cos, np.sin))
        return np.arctan2(y, x) % TURN, np.hypot(x, y)

    def steps(self, heights: Array) -> Array:
        """How far apart places one t apart are at some heights, of any shape [m]."""
        return heights

    def residual_slopes(
        self, weights: Array, t: Array, heights: Array, at: Array, height: Array, slope: Array
    ) -> Array:
        """How the gaps between mesh and spline at its points change as lines move across, shape (r, l, m).

        Parameters
        ----------
        weights, t, heights
            As for ``blend``; one choice of lines.
        at, reach : array, shape (r, l)
            Its answer.
        steep : array, shape (r, l)
            How the height of the mesh changes with t there.
        """
        c, s, ratio = np.cos(at), np.sin(at), slope / height
        # Across the ray a moving line takes a point along the mesh, which rises; along the ray it takes it up or down.
        x, y = (part[:, None] * weights for part in (heights * np.cos(t), heights * np.sin(t)))
        return (ratio * c - s)[..., None] * x + (ratio * s + c)[..., None] * y

    def names(self, t: Array) -> tuple[str, ...]:
        """What the lines are called in messages."""
        return tuple(f"half-plane at {round(np.rad2deg(a), 1) % 360:g} degrees" for a in self.angles(t))


@dataclass(frozen=True, eq=False)
class FaceParametrization:
    """Over a face: s and t are lengths along two directions across its outward normal [m]."""

    corner: Array  # (3,) [m], inside of the robot; s = t = 0
    along: Array  # (3,) unit, of s
    side: Array  # (3,) unit, of t; along x side = up
    up: Array  # (3,) unit, of the rays
    span: tuple[float, float]
    breadth: tuple[float, float]
    closed = False
    bends = False
    seam = None

    def planes(self, s: Array) -> Planes:
        """One plane across ``along`` at each s."""
        points = self.corner + s[:, None] * self.along
        return Planes(points, np.broadcast_to(self.along, points.shape))

    def rays(self, s: Array, t: Array) -> tuple[Array, Array]:
        """Origins and unit directions of the rays at every pair, shapes (k, l, 3)."""
        origins = self.planes(s).points[:, None] + t[:, None] * self.side
        return origins, np.broadcast_to(self.up, origins.shape)

    def blend(self, weights: Array, t: Array, heights: Array) -> tuple[Array, Array]:
        """As for a tube; all rays run the same way."""
        height = over_rows(heights, weights.T)
        return np.broadcast_to((t @ weights.T)[..., None, :], height.shape), height

    def steps(self, heights: Array) -> Array:
        """As for a tube; all rays run the same way."""
        return np.ones_like(heights)

    def residual_slopes(
        self, weights: Array, t: Array, heights: Array, at: Array, height: Array, slope: Array
    ) -> Array:
        """As for a tube; no line moves up or down."""
        return slope[..., None] * weights

    def names(self, t: Array) -> tuple[str, ...]:
        """What the lines are called in messages."""
        return tuple(f"v-plane {j}" for j in range(len(t)))


Parametrization = TubeParametrization | FaceParametrization


def parametrized_lines(parametrization: Parametrization, s: Array, t: Array) -> LineGrid:
    """The lines of the control points at every pair of s and t."""
    return LineGrid(
        parametrization.planes(s),
        *parametrization.rays(s, t),
        parametrization.closed,
        parametrization.names(t),
        seam=parametrization.seam,
    )
