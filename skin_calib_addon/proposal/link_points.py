"""The open outside of a link as points: where they are, which of them can carry skin, and which already do."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from ..common.arrays import Array, BoolArray, IntArray
from ..geometry.components import components
from ..geometry.mesh.cover import single_faces
from ..geometry.mesh.face_points import sample_faces
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..geometry.mesh.visibility import MIN_OPEN, MIN_OPENNESS, openness_at, visibility

# [m] distance of the points. Larger: faster; edges of free areas are less exact.
POINT_DISTANCE = 2.5e-3
# [m] gap between surfaces: boards protrude a little over a boundary. Larger: less is covered (half: 944, double: 934
# instead of 943 cm^2 on four links of the G1).
SURFACE_GAP = 3e-3


@dataclass(frozen=True, eq=False)
class LinkPoints:
    """Points of the faces of a link that are in the open."""

    points: Array  # (k, 3) [m], link frame
    normals: Array  # (k, 3) unit, outward
    areas: Array  # (k,) that each stands for [m^2]
    seen: float  # area that can be seen from outside, in the open or not [m^2]
    free: BoolArray  # (k,) no other link covers it
    covered: BoolArray = field(repr=False)  # (k,) a proposed surface covers it; changes
    taken: BoolArray = field(repr=False)  # (k,) a proposed surface covers it, or is next to it; changes
    seen_points: Array = field(repr=False)  # (n, 3) of all faces that can be seen, in the open or not [m]

    @classmethod
    def of(cls, mesh: TriangleMesh) -> "LinkPoints":
        """Return the points of a mesh that are in the open; all of them are free."""
        mesh = single_faces(mesh)
        points, face, areas = sample_faces(mesh, POINT_DISTANCE)
        visible = visibility(mesh)
        normals = mesh.face_normals[face] * visible.sides[face][:, None]
        openness = openness_at(mesh, points, normals)
        seen = float(areas[openness > MIN_OPENNESS].sum())
        kept = openness > MIN_OPEN
        count = int(kept.sum())
        free, covered, taken = np.ones(count, bool), *np.zeros((2, count), bool)
        every = points[visible.seen[face]]
        return cls(points[kept], normals[kept], areas[kept], seen, free, covered, taken, every)

    @property
    def wanted(self) -> BoolArray:
        """Return which points are free, and not covered by a surface or next to it, shape (k,)."""
        return self.free & ~self.taken

    def cover(self, points: BoolArray) -> None:
        """Mark points (k,) as covered by a surface."""
        self.covered[points] = True
        self.taken[self._next_to(points)] = True

    @contextmanager
    def only(self, points: BoolArray) -> Iterator[None]:
        """Want no other points than given ones (k,) in the meantime."""
        taken = self.taken.copy()
        self.taken[~points] = True
        yield
        self.taken[:] = taken
        self.cover(self.covered)

    def _next_to(self, points: BoolArray) -> BoolArray:
        """Return which points are next to, or among, given ones, shapes (k,)."""
        if not points.any():
            return points
        gaps = cKDTree(self.tree.data[points]).query(self.tree.data, distance_upper_bound=SURFACE_GAP)[0]
        near: BoolArray = np.isfinite(gaps)
        return near

    def largest_bare_piece(self, covered: BoolArray) -> IntArray:
        """Return the points (n,) of the largest connected piece of the free area that is not covered or next to it."""
        bare = np.flatnonzero(self.free & ~self._next_to(covered))
        if not len(bare):
            return bare
        # Fine meshes have many points on small faces: cells of a raster are connected, and not points.
        cells, of_point = np.unique(np.rint(self.tree.data[bare] / POINT_DISTANCE), axis=0, return_inverse=True)
        piece = components(len(cells), *cKDTree(cells).query_pairs(2, output_type="ndarray").T)[of_point.ravel()]
        return bare[piece == np.bincount(piece, self.areas[bare]).argmax()]

    @cached_property
    def tree(self) -> cKDTree:
        """Return a tree of the points with their normals."""
        return cKDTree(with_normals(self.points, self.normals))

    def nearest(self, points: Array, normals: Array) -> IntArray:
        """Return the index (n,) of the nearest point on the same side of the link, of points and normals (n, 3)."""
        return np.asarray(self.tree.query(with_normals(points, normals))[1])

    def are_near(self, chosen: BoolArray, points: Array, normals: Array) -> BoolArray:
        """Return which points (n, 3) are near to a chosen point on their side of the link."""
        index = self.tree.query(with_normals(points, normals), distance_upper_bound=2 * POINT_DISTANCE)[1]
        return np.append(chosen, False)[index]  # the index of none is the number of points


def with_normals(points: Array, normals: Array) -> Array:
    """Return points with normals as points (k, 6) [m], so that both sides of a thin wall are far from each other."""
    return np.hstack((points, POINT_DISTANCE * normals))
