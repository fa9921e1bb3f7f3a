"""The outside of a link as points: where they are, which of them can carry skin, and which already do."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from ..common.arrays import Array, BoolArray, IntArray
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..geometry.mesh.visibility import are_seen, sample_faces, visibility

# [m] distance of the points. Larger: faster; edges of free areas are less exact.
POINT_DISTANCE = 2.5e-3
# [m] gap between surfaces: boards protrude a little over a boundary. Larger: less is covered.
SURFACE_GAP = 3e-3


@dataclass(frozen=True, eq=False)
class LinkPoints:
    """Points of the faces of a link that can be seen from outside."""

    points: Array  # (k, 3) [m], link frame
    normals: Array  # (k, 3) unit, outward
    areas: Array  # (k,) that each stands for [m^2]
    free: BoolArray  # (k,) no other link covers it
    covered: BoolArray = field(repr=False)  # (k,) a proposed surface covers it; changes
    taken: BoolArray = field(repr=False)  # (k,) a proposed surface covers it, or is next to it; changes

    @classmethod
    def of(cls, mesh: TriangleMesh) -> "LinkPoints":
        """Return the points of a mesh that can be seen; all of them are free."""
        points, face, areas = sample_faces(mesh, POINT_DISTANCE)
        normals = mesh.face_normals[face] * visibility(mesh).sides[face][:, None]
        seen = are_seen(mesh, points, normals)
        count = int(seen.sum())
        return cls(points[seen], normals[seen], areas[seen], np.ones(count, bool), *np.zeros((2, count), bool))

    @property
    def wanted(self) -> BoolArray:
        """Return which points are free, and not covered by a surface or next to it, shape (k,)."""
        return self.free & ~self.taken

    def cover(self, points: BoolArray) -> None:
        """Mark points (k,) as covered by a surface."""
        self.covered[points] = True
        if points.any():
            gaps = cKDTree(self.points[points]).query(self.points, distance_upper_bound=SURFACE_GAP)[0]
            self.taken[np.isfinite(gaps)] = True

    @cached_property
    def tree(self) -> cKDTree:
        """Return a tree of the points."""
        return cKDTree(self.points)

    def nearest(self, points: Array) -> tuple[Array, IntArray]:
        """Return the distance to the nearest point and its index, for points (n, 3)."""
        distance, index = self.tree.query(points)
        return np.asarray(distance), np.asarray(index)
