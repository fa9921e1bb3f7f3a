"""The ground of the boards: where on a surface a board may be."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...common.arrays import Array, BoolArray
from ...geometry.fit.surface_fit import SurfaceFit
from ...geometry.mesh.distance import closest, closest_on_triangles
from ...geometry.surface.bspline import BSplineSurface
from ...geometry.surface.footpoints import footpoints
from .overlap import TOUCH

# [m] Largest distance of the centre of a board, or of a cell of a trimmed sheet, from the mesh. A proposal counts on
# it. Larger: skin where the surface does not follow the mesh.
MAX_DISTANCE = 1e-3
# [m] Largest height of a corner of a board above the surface that needs no warning. Larger: large boards on smaller
# radii.
GAP_LIMIT = 3e-3
# [1] Largest distance of any other point of a board from the mesh, in sides. Larger: boards on smaller radii. Half:
# 48 instead of 55 boards on four links of the G1; double: 55.
MAX_GAP = 0.3
# [rad] Largest angle between a board, or such a cell, and the faces at its centre. Larger: skin on steps and grooves.
MAX_ANGLE = np.deg2rad(15.0)
# [1] Largest slope of the shortest line from a point to the mesh; beyond an edge of the mesh it is larger. Larger:
# boards protrude over edges where the surface is off the mesh (double: 67 instead of 55 boards on four links of the G1,
# with corners 4.6 instead of 3.8 mm from the mesh; half: 41).
MAX_SLOPE = 0.5


@dataclass(frozen=True)
class Zone:
    """A ball without boards, which also counts about the nearest point of the surface: a screw, a cable outlet."""

    point: tuple[float, float, float]  # its centre, on or near the mesh [m]
    radius: float  # [m]


@dataclass(frozen=True, eq=False)
class Ground:
    """A surface with its mesh and the zones without boards. All rules where a board may be are here."""

    surface: BSplineSurface
    fit: SurfaceFit | None  # None: a surface without a mesh
    excluded: Sequence[Zone]
    side: float  # of the boards [m]

    @cached_property
    def _zones(self) -> tuple[Array, Array, Array]:
        """Points of the zones, the points of the surface nearest to them, and radii."""
        centres = np.array([zone.point for zone in self.excluded]).reshape(-1, 3)
        uv = footpoints(self.surface, centres)[0] if len(centres) else np.zeros((0, 2))
        return centres, self.surface.points(uv), np.array([zone.radius for zone in self.excluded])

    def covers(self, uv: Array) -> BoolArray:
        """Return whether a part of a board may be over parameters (k, 2), shape (k,).

        It may where the mesh is near and continues below it, inside the boundary, outside of all zones.
        """
        return self.covers_at(self.surface.points(uv), self.surface.normals(uv))

    def covers_at(self, points: Array, normals: Array) -> BoolArray:
        """Return the same of points (k, 3) [m] on or above the surface, with the normals (k, 3) there."""
        free = np.ones(len(points), bool)
        if self.fit is not None and self.fit.lines.region is not None:
            free &= self.fit.lines.region(points)
        for point, centre, radius in zip(*self._zones):
            free &= np.minimum(*(np.linalg.norm(points - p, axis=1) for p in (point, centre))) >= radius
        free[free] = self.is_over_mesh(points[free], normals[free])  # the longest computation
        return free

    def is_over_mesh(self, points: Array, normals: Array) -> BoolArray:
        """Return which points (k, 3) [m] are above or below the mesh, and not beyond its edges."""
        if self.fit is None:
            return np.ones(len(points), bool)
        distance, _, foot = closest(self.fit.given_mesh, points)
        heights = np.abs(((points - foot) * normals).sum(axis=1))
        aside = np.sqrt(np.maximum(distance**2 - heights**2, 0))
        over: BoolArray = (distance <= MAX_GAP * self.side) & (aside <= TOUCH * self.side + MAX_SLOPE * heights)
        return over

    def carries(self, uv: Array) -> BoolArray:
        """Return whether boards may be centred at parameters (k, 2): on the mesh, parallel to its nearest faces."""
        if self.fit is None:
            return np.ones(len(uv), bool)
        points, normals = self.surface.points(uv), self.surface.normals(uv)
        distances, faces, _ = closest(self.fit.given_mesh, points)
        kept = self.fit.is_trusted(self.surface.wrap(uv)) & (distances <= MAX_DISTANCE)
        # Above an edge several faces are nearest.
        board, face = self.fit.given_mesh.around(faces)
        feet = closest_on_triangles(points[board], self.fit.given_mesh.triangles[face])
        nearest = np.linalg.norm(feet - points[board], axis=1) <= distances[board] + TOUCH * self.side
        cosines = self._winding * (self.fit.given_mesh.face_normals[face] * normals[board]).sum(axis=1)
        steep = cosines < np.cos(MAX_ANGLE)
        kept[board[nearest & steep]] = False
        return kept

    @cached_property
    def _winding(self) -> float:
        """One if most face normals that rays hit point outward, minus one if they point inward."""
        assert self.fit is not None
        samples = self.fit.samples
        hit = ~np.isnan(samples.residuals)
        outward = (samples.rays * self.fit.given_mesh.face_normals[samples.faces]).sum(axis=2)[hit]
        return -1.0 if outward.sum() < 0 else 1.0
