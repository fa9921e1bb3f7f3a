"""Constraints of a net: a point and a direction, or landmarks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...common.arrays import Array, IntArray, cross, tangential, unit
from ...common.errors import InvalidPlan
from ...geometry.surface.bspline import BSplineSurface
from .geodesic import trace
from .net import Net

# Steps of the geodesics that define the direction. They cross knots, where the third derivatives of the surface jump.
# Larger: more exact, and slower.
GEODESIC_STEPS = 2
# Smallest sine of the angle between a direction and the normal. Larger: refuses more directions.
MIN_DIRECTION_SINE = 0.05


@dataclass(frozen=True, eq=False)
class Constraints:
    """Constraints of a net, and the loads that keep them.

    A force on a single node would pull a spike into the net, a higher one the finer the net is. Distributed loads keep
    the strain smooth, as glue or friction do.
    """

    nodes: IntArray  # (k,) the nodes whose parameters are fixed
    uv: Array  # (k, 2) their values
    pin: int  # the pinned node
    turning: IntArray  # (m,) nodes that define the rotation about the pinned node; may be empty
    vectors: Array  # (m, 3) their target vectors from the pinned node [m]
    side_vectors: Array  # (m, 3) across these vectors; the sum of (deviation . side vector) is an angle [1/m]
    loads: Array  # (2 k, or 2 k + 1 with a rotation, n, 3) load of each constraint on each node

    def rows(self, basis: Array) -> Array:
        """Return the derivatives of the constraints with respect to the parameters, shape (constraints, n, 2)."""
        rows = np.zeros((len(self.loads), len(basis), 2))
        for k, node in enumerate(self.nodes):
            rows[[2 * k, 2 * k + 1], node, [0, 1]] = 1.0
        if len(self.turning):
            rows[-1, self.turning] = np.matmul(basis[self.turning], self.side_vectors[..., None])[..., 0]
            rows[-1, self.pin] -= basis[self.pin] @ self.side_vectors.sum(axis=0)
        return rows

    def violations(self, uv: Array, points: Array) -> Array:
        """Return the violation of each constraint, shape (constraints,): parameters, and an angle [rad]."""
        violations = (uv[self.nodes] - self.uv).ravel()
        if len(self.turning) == 0:
            return violations
        return np.append(
            violations, ((points[self.turning] - points[self.pin] - self.vectors) * self.side_vectors).sum()
        )


def row_axis(surface: BSplineSurface, uv: Array, direction: ArrayLike) -> Array:
    """Return the tangential part of a direction at ``uv``, a unit vector of shape (3,)."""
    normal, wanted = surface.normals(uv[None])[0], np.asarray(direction, float)
    tangent = wanted - (wanted @ normal) * normal
    if np.linalg.norm(tangent) < MIN_DIRECTION_SINE * np.linalg.norm(wanted) or not wanted.any():
        raise InvalidPlan(
            f"The direction ({', '.join(f'{x:g}' for x in wanted)}) is perpendicular to the surface at the origin. "
            "Choose one along the rows"
        )
    return unit(tangent)


def pin_constraints(surface: BSplineSurface, net: Net, uv: Array, along: Array) -> Constraints:
    """Return constraints that fix the pinned node and the rotation of the net about it.

    Geodesics from the pinned node give the target positions of the adjacent nodes of its row, which leaves the pinned
    node in the direction ``along``.
    """
    pin, adjacent = net.pin, net.on_row_of_pin
    r = surface.derivatives(uv[pin])[:, :, 0]
    here, across = r[0, 0], cross(unit(cross(r[1, 0], r[0, 1])), along)
    distances = np.linalg.norm(net.flat[adjacent], axis=1)
    headings = net.flat[adjacent] @ np.stack((along, across)) / distances[:, None]
    # A geodesic rotates along its length; its tangent at the end gives the side vector.
    path, tangents = trace(
        surface,
        np.repeat(uv[[pin]], len(adjacent), axis=0),
        headings,
        distances[:, None] / GEODESIC_STEPS,
        GEODESIC_STEPS,
    )
    r = surface.derivatives(path[-1])
    sides = cross(unit(cross(r[1, 0], r[0, 1])), tangents[-1]) * (distances / (distances**2).sum())[:, None]
    loads = rigid_loads(net, *flat_axes(surface, net, uv))
    return Constraints(np.array([pin]), uv[[pin]].copy(), pin, adjacent, r[0, 0] - here, sides, loads)


def rigid_loads(net: Net, x_axis: Array, y_axis: Array) -> Array:
    """Return the loads on all nodes that push a net along x and y, and rotate it, shape (3, n, 3)."""
    x, y = (net.flat - net.load_fractions @ net.flat).T / max(float(np.ptp(net.flat)), net.pitch)
    return np.stack((x_axis, y_axis, x[:, None] * y_axis - y[:, None] * x_axis)) * net.load_fractions[:, None]


def flat_axes(surface: BSplineSurface, net: Net, uv: Array) -> tuple[Array, Array]:
    """Return the flat axes x and y as unit tangents (n, 3) at each node: the mean over the pairs of the node."""
    r = surface.derivatives(uv)
    points, normals = r[0, 0], unit(cross(r[1, 0], r[0, 1]))
    chords = points[net.pairs[:, 1]] - points[net.pairs[:, 0]]
    x, y = (part @ chords for part in net.incident_vectors)
    x_axis = x - cross(normals, y)  # each chord, rotated back by the angle of its flat vector
    x_axis = tangential(x_axis, normals)
    return x_axis, cross(normals, x_axis)
