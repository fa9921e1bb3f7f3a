"""Landmarks: cells of a sheet that the author fixes to points of the mesh."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...common.arrays import Array, IntArray
from ...common.errors import InvalidPlan, millimetres
from ...common.warnings import Place, point_of
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.footpoints import footpoints
from ..lattice import ROUNDING, SheetLattice
from .constraints import Constraints, flat_axes, rigid_loads
from .geodesic import unroll
from .net import Net

# Iterations in which a sheet is rotated towards its landmarks before the placement. Larger: better for a direction that
# is far off.
ROTATION_ITERATIONS = 6
# Largest distance of an origin or a landmark from the surface [m]. Larger: points on another link are accepted.
MAX_POINT_DISTANCE = 5e-3


@dataclass(frozen=True)
class Landmark:
    """A cell of a sheet, and the point of the mesh for its centre."""

    cell: tuple[int, int]
    point: tuple[float, float, float]  # [m]


@dataclass(frozen=True, eq=False)
class LandmarkTargets:
    """Targets of two or more cells; the first of them is the pinned node of every net."""

    layer: BSplineSurface
    flat: Array  # (k, 2) flat positions of the cells relative to the first [m]
    uv: Array  # (k, 2) parameters of their landmarks
    cell_sides: Array  # (2,) sides of a cell, along the row and across [m]

    @classmethod
    def of(
        cls, surface: BSplineSurface, layer: BSplineSurface, lattice: SheetLattice, landmarks: Sequence[Landmark]
    ) -> "LandmarkTargets":
        """Return the targets for some landmarks."""
        for k, landmark in enumerate(landmarks):
            for other in landmarks[:k]:
                if other.cell == landmark.cell or other.point == landmark.point:
                    raise InvalidPlan(
                        f"landmarks {landmarks.index(other)} and {k} have the same cell or the same point. Give each "
                        "cell its own point"
                    )
        cells, points = (np.array([getattr(m, name) for m in landmarks], float) for name in ("cell", "point"))
        uv = located(surface, points, [f"Landmark {k}" for k in range(len(points))])
        flat = (cells - cells[0])[:, ::-1] * (lattice.pitch[1], 2 * lattice.step[0])
        return cls(layer, flat, uv, np.array(lattice.pitch[::-1]))

    def heading(self, along: Array, step: float) -> Array:
        """Rotate the tangent ``along`` (3,) at the first landmark until the others are nearest to their landmarks."""
        start, aims = self.uv[0], self.layer.points(self.uv[1:])
        normal = self.layer.normals(start[None])[0]

        angle_step = np.sqrt(ROUNDING)  # of the finite difference [rad]: `unroll` rounds distances
        turned = self.flat[1:] + angle_step * np.column_stack((-self.flat[1:, 1], self.flat[1:, 0]))
        for _ in range(ROTATION_ITERATIONS):
            uv = unroll(self.layer, np.concatenate((self.flat[1:], turned)), start, along, step)
            ends, moved = np.split(self.layer.points(uv), 2)
            slope = (moved - ends) / angle_step
            angle = np.clip(((aims - ends) * slope).sum() / (slope**2).sum(), -1, 1)
            along = np.cos(angle) * along + np.sin(angle) * np.cross(normal, along)
        return along

    def constraints(self, net: Net, uv: Array) -> Constraints:
        """Return the constraints of a net: two landmarks rotate it, more of them stretch it."""
        nodes = np.array([int(np.argmin(((net.flat - place) ** 2).sum(axis=1))) for place in self.flat])
        targets = self.uv + np.where(self.layer.closed, np.rint(uv[nodes] - self.uv), 0.0)
        x_axis, y_axis = flat_axes(self.layer, net, uv)
        if len(nodes) == 2:
            return self._rotating(net, nodes, targets, x_axis, y_axis)
        # Each force is distributed over the adjacent cells. A force on one node would make a spike.
        near = (
            np.maximum(1 - np.abs(net.flat - net.flat[nodes][:, None]) / self.cell_sides, 0).prod(axis=2)
            * net.load_fractions
        )
        near /= near.sum(axis=1, keepdims=True)
        loads = (near[:, None, :, None] * np.stack((x_axis, y_axis))).reshape(-1, len(uv), 3)
        no_vectors = np.zeros((0, 3))
        return Constraints(nodes, targets, net.pin, np.zeros(0, np.int64), no_vectors, no_vectors, loads)

    def _rotating(self, net: Net, nodes: IntArray, targets: Array, x_axis: Array, y_axis: Array) -> Constraints:
        """Return constraints that fix the first landmark and the direction to the second."""
        second = nodes[1]
        arm = net.flat[second]
        side = (arm[0] * y_axis[second] - arm[1] * x_axis[second]) / (arm @ arm)
        vector = np.diff(self.layer.points(targets), axis=0)
        loads = rigid_loads(net, x_axis, y_axis)
        return Constraints(nodes[:1], targets[:1], net.pin, nodes[1:], vector, side[None], loads)


def located(surface: BSplineSurface, points: Array, names: Sequence[str]) -> Array:
    """Return the parameters (k, 2) of the surface points nearest to points (k, 3) [m] of an author."""
    uv, distance = footpoints(surface, points)
    far = np.flatnonzero(distance > MAX_POINT_DISTANCE)
    if len(far):
        i = int(far[0])
        raise InvalidPlan(
            f"{names[i]}, {millimetres(points[i])}, is {distance[i] * 1e3:.1f} mm from the surface. Choose a point on "
            "the mesh that the grid covers, in metres in the link frame.",
            distance=float(distance[i]),
            place=Place(point_of(points[i])),
        )
    return uv
