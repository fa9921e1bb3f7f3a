"""Landmarks: cells of a sheet that the author pins to points of the mesh."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...common.arrays import Array, IntArray
from ...common.errors import InvalidPlan
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.distance import footpoints
from ..lattice import SheetLattice
from .constraints import Constraints, flat_axes, rigid_loads
from .geodesic import unroll
from .net import Net

# Rounds in which a sheet turns to its landmarks before it is laid.
ROTATION_ITERATIONS = 4


@dataclass(frozen=True)
class Landmark:
    """A cell of a sheet, and the point of the mesh that its centre lies on."""

    cell: tuple[int, int]
    point: tuple[float, float, float]  # [m]


@dataclass(frozen=True, eq=False)
class LandmarkTargets:
    """Where two or more cells are to lie; the first of them is the pinned node of every net."""

    layer: BSplineSurface
    flat: Array  # (k, 2) flat places of the cells from the first [m]
    uv: Array  # (k, 2) parameters of their landmarks
    cell_sides: Array  # (2,) sides of a cell, along its row and across [m]

    @classmethod
    def of(
        cls, surface: BSplineSurface, layer: BSplineSurface, lattice: SheetLattice, landmarks: Sequence[Landmark]
    ) -> "LandmarkTargets":
        """The goal that some landmarks set.

        Raises
        ------
        InvalidPlan
            If one is not in the sheet, or two are of one cell or one place.
        """
        for k, landmark in enumerate(landmarks):
            for other in landmarks[:k]:
                if other.cell == landmark.cell or other.point == landmark.point:
                    raise InvalidPlan(
                        f"landmarks {landmarks.index(other)} and {k} share a cell or a point; give each cell its own"
                    )
        cells, points = (np.array([getattr(m, name) for m in landmarks], float) for name in ("cell", "point"))
        flat = (cells - cells[0])[:, ::-1] * (lattice.pitch[1], 2 * lattice.step[0])
        return cls(layer, flat, footpoints(surface, points)[0], np.array(lattice.pitch[::-1]))

    def heading(self, along: Array, step: float) -> Array:
        """The tangent ``along`` at the first landmark, turned until the rest lies nearest to its landmarks."""
        start, aims = self.uv[0], self.layer.points(self.uv[1:])
        normal = self.layer.normals(start[None])[0]
        ROTATION_STEP = 1e-3
        turned = self.flat[1:] + ROTATION_STEP * np.column_stack((-self.flat[1:, 1], self.flat[1:, 0]))
        for _ in range(ROTATION_ITERATIONS):
            uv = unroll(self.layer, np.concatenate((self.flat[1:], turned)), start, along, step)
            ends, moved = np.split(self.layer.points(uv), 2)
            slope = (moved - ends) / ROTATION_STEP
            angle = np.clip(((aims - ends) * slope).sum() / (slope**2).sum(), -1, 1)
            along = np.cos(angle) * along + np.sin(angle) * np.cross(normal, along)
        return along

    def constraints(self, net: Net, uv: Array) -> Constraints:
        """What holds a net to the landmarks: two turn it, more of them stretch it."""
        nodes = np.array([int(np.argmin(((net.flat - place) ** 2).sum(axis=1))) for place in self.flat])
        targets = self.uv + np.where(self.layer.closed, np.rint(uv[nodes] - self.uv), 0.0)
        x_axis, y_axis = flat_axes(self.layer, net, uv)
        if len(nodes) == 2:
            return self._rotating(net, nodes, targets, x_axis, y_axis)
        # Each force is spread over the cells around its own: upon one node it would pull a spike.
        near = (
            np.maximum(1 - np.abs(net.flat - net.flat[nodes][:, None]) / self.cell_sides, 0).prod(axis=2)
            * net.load_fractions
        )
        near /= near.sum(axis=1, keepdims=True)
        loads = (near[:, None, :, None] * np.stack((x_axis, y_axis))).reshape(-1, len(uv), 3)
        no_vectors = np.zeros((0, 3))
        return Constraints(_twice(nodes), targets, net.pin, np.zeros(0, np.int64), no_vectors, no_vectors, loads)

    def _rotating(self, net: Net, nodes: IntArray, targets: Array, x_axis: Array, y_axis: Array) -> Constraints:
        second = nodes[1]
        arm = net.flat[second]
        side = (arm[0] * y_axis[second] - arm[1] * x_axis[second]) / (arm @ arm)
        vector = np.diff(self.layer.points(targets), axis=0)
        loads = rigid_loads(net, x_axis, y_axis)
        return Constraints(_twice(nodes[:1]), targets[:1], net.pin, nodes[1:], vector, side[None], loads)


def _twice(nodes: IntArray) -> IntArray:
    return np.tile(nodes[:, None, None], (1, 2, 2))
