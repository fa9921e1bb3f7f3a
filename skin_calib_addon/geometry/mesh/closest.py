"""Nearest points of a triangle mesh."""

from functools import cached_property
from itertools import chain
from weakref import WeakKeyDictionary

import numpy as np
from scipy.spatial import cKDTree

from ...common.arrays import Array, BoolArray, IntArray, cross, norms
from .triangle_mesh import TriangleMesh

# [1] most parts of one side of a face. Larger: denser samples on long faces, more memory.
MAX_PARTS = 64
# [1] pairs of points and parts of faces that are compared at a time. Larger: more memory.
BLOCK_PAIRS = 500_000
# [1] points near the mesh of which one counts its pairs for all. Larger: faster, blocks of more uneven sizes.
COUNTED = 16
# [radius of the largest part] search radius from which on a point is far from the mesh. It affects time and memory.
FAR = 4.0
# [1] height to length of a triangle below which only its sides are used, because its normal is only rounding.
FLAT_TRIANGLE_RATIO = 1e-8
# [1] faces from which on distances are measured to the faces near the points only. It affects the time only.
MANY_FACES = 30_000
# [1] fraction of the faces that count as short. It affects the time only.
SHORT_FRACTION = 0.99
# [1] cells along the longest side of the box around a mesh, to find faces near points. It affects the time only.
CELLS_PER_SIDE = 96


def split_faces(mesh: TriangleMesh, size: float) -> tuple[Array, IntArray, IntArray]:
    """Split long faces into congruent triangles with sides of at most ``size``, and return their centres."""
    corners = mesh.triangles
    parts = np.clip(np.ceil(mesh.longest_sides / size).astype(int), 1, MAX_PARTS)
    centres, face = [], []
    for k in np.unique(parts):
        chosen = np.flatnonzero(parts == k)
        i, j = (x.ravel() for x in np.meshgrid(np.arange(k), np.arange(k), indexing="ij"))
        up, down = i + j < k, i + j < k - 1  # triangles oriented like the face, and rotated by half a turn
        a = np.r_[i[up] + 1 / 3, i[down] + 2 / 3] / k
        b = np.r_[j[up] + 1 / 3, j[down] + 2 / 3] / k
        centres.append(np.einsum("sb,fbc->fsc", np.column_stack((1 - a - b, a, b)), corners[chosen]).reshape(-1, 3))
        face.append(np.repeat(chosen, len(a)))
    return np.concatenate(centres), np.concatenate(face), parts


def small_parts(mesh: TriangleMesh, size: float) -> tuple[Array, IntArray]:
    """Halve the longest sides of faces until none is longer than ``size``, or than a fraction of the face's."""
    corners, face, done = mesh.triangles, np.arange(len(mesh.faces)), []
    limit = np.maximum(size, mesh.longest_sides / MAX_PARTS)
    while len(corners):
        sides = norms(corners - np.roll(corners, -1, axis=1))
        is_long = sides.max(axis=1) > limit[face]
        done.append((corners[~is_long], face[~is_long]))
        corners, face, longest = corners[is_long], face[is_long], sides[is_long].argmax(axis=1)
        a, b, c = (corners[np.arange(len(corners)), (longest + k) % 3] for k in range(3))
        middle = (a + b) / 2
        corners = np.concatenate((np.stack((a, middle, c), axis=1), np.stack((middle, b, c), axis=1)))
        face = np.tile(face, 2)
    return np.concatenate([k for k, _ in done]), np.concatenate([k for _, k in done])


class MeshDistance:
    """The exact distance from points to a mesh.

    A search tree of small parts of the faces gives the candidates. The distances to their faces decide.
    """

    def __init__(self, mesh: TriangleMesh, coarseness: float = 1.0):
        self.triangles = mesh.triangles
        size = max(float(np.median(mesh.longest_sides)), 0.02 * mesh.size)
        corners, self.face = small_parts(mesh, coarseness * size)
        self.centres = (corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3
        # Largest distance of a point of each part from its centre. One corner after the other takes less memory.
        self.radii = np.zeros(len(corners))
        for k in range(3):
            np.maximum(self.radii, norms(corners[:, k] - self.centres), out=self.radii)
        self.radius = float(self.radii.max())
        self.tree = cKDTree(self.centres)

    def __call__(self, points: Array) -> tuple[Array, IntArray, Array]:
        """Return the distance [m], the nearest face and the nearest point of each point; shapes (k,), (k,), (k, 3)."""
        face = self.face[np.asarray(self.tree.query(points)[1])]
        nearest = closest_on_triangles(points, self.triangles[face])
        distance = norms(nearest - points)
        # The distance to a part is at least the distance to its centre minus the radius.
        limits = distance + self.radius
        # About the number of parts near each point. A point far from the mesh can be near many more than others.
        step = COUNTED if limits.max(initial=0.0) < FAR * self.radius else 1
        counts = self.tree.query_ball_point(points[::step], limits[::step], return_length=True)
        ends = np.cumsum(np.repeat(counts, step)[: len(points)])
        for block in np.split(np.arange(len(points)), np.flatnonzero(np.diff(ends // BLOCK_PAIRS)) + 1):
            near = self.tree.query_ball_point(points[block], limits[block], return_sorted=False)
            row = np.repeat(block, [len(parts) for parts in near])
            part = np.fromiter(chain.from_iterable(near), np.int64, len(row))
            kept = norms(points[row] - self.centres[part]) - self.radii[part] < distance[row]
            # A long face has many of the parts: each pair of point and face once.
            pairs = np.unique(row[kept] * len(self.triangles) + self.face[part[kept]])
            row, candidate = pairs // len(self.triangles), pairs % len(self.triangles)
            foot = closest_on_triangles(points[row], self.triangles[candidate])
            d = norms(foot - points[row])
            order = np.lexsort((d, row))  # the nearest candidate of each point comes first
            first = order[np.append(True, row[order][1:] != row[order][:-1])] if len(order) else order
            first = first[d[first] < distance[row[first]]]
            distance[row[first]], face[row[first]], nearest[row[first]] = d[first], candidate[first], foot[first]
        return distance, face, nearest


_known: WeakKeyDictionary[TriangleMesh, MeshDistance] = WeakKeyDictionary()


def distance_to(mesh: TriangleMesh) -> MeshDistance:
    """Return the distance from a mesh; its search tree is built once for each mesh."""
    found = _known.get(mesh)
    if found is None:
        found = _known[mesh] = MeshDistance(mesh)
    return found


class NearMesh:
    """The exact distance from points to a mesh, where upper bounds of the distances are known.

    Of a mesh with many faces, only those within the bound of some point are compared, long ones, and given ones.
    """

    def __init__(self, mesh: TriangleMesh, hit: IntArray):
        self.mesh, self.hit = mesh, hit
        self.low = mesh.vertices.min(axis=0)
        self.cell = float((mesh.vertices.max(axis=0) - self.low).max()) / CELLS_PER_SIDE

    def __call__(self, points: Array, bounds: Array) -> Array:
        """Return the distances of points (k, 3) with upper bounds (k,) from the mesh, shape (k,) [m]."""
        if len(self.mesh.faces) > MANY_FACES and np.isfinite(bounds).all():
            return MeshDistance(self._near(points, bounds))(points)[0]
        return distance_to(self.mesh)(points)[0]

    @cached_property
    def _cells(self) -> IntArray:
        """Return the cell of each vertex, shape (v, 3)."""
        return np.asarray((self.mesh.vertices - self.low) / self.cell, np.int32)

    @cached_property
    def _long(self) -> float:
        """Return the length of the sides from which on a face is compared in any case [m]."""
        return float(np.quantile(self.mesh.longest_sides, SHORT_FRACTION))

    @cached_property
    def _always(self) -> BoolArray:
        """Return the faces that are given or long, shape (f,)."""
        always = self.mesh.longest_sides > self._long
        always[self.hit] = True
        return always

    def _near(self, points: Array, bounds: Array) -> TriangleMesh:
        """Return the long and the given faces, and those that are within the bound of some point."""
        shape = self._cells.max(axis=0) + 1
        # Each point of a short face has a corner within the radius of the circle around an equilateral triangle.
        most = bounds[:, None] + self._long / np.sqrt(3)
        first, last = (np.floor((points + k * most - self.low) / self.cell).astype(int) for k in (-1, 1))
        marked = np.zeros(shape, bool)
        for (i, j, k), (x, y, z) in zip(np.maximum(first, 0), last + 1):
            marked[i:x, j:y, k:z] = True
        near = marked.reshape(-1)[(self._cells[:, 0] * shape[1] + self._cells[:, 1]) * shape[2] + self._cells[:, 2]]
        a, b, c = self.mesh.corners
        used, corners = np.unique(self.mesh.faces[near[a] | near[b] | near[c] | self._always], return_inverse=True)
        return TriangleMesh(self.mesh.vertices[used], corners.reshape(-1, 3))


def closest_on_triangles(points: Array, triangles: Array) -> Array:
    """Return the nearest point of each triangle to each point (Ericson, Real-Time Collision Detection, 5.1.5)."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    ab, ac, ap = b - a, c - a, points - a
    normal = cross(ab, ac)
    square = dots(normal, normal)
    flat = square <= (FLAT_TRIANGLE_RATIO * np.maximum(dots(ab, ab), dots(ac, ac))) ** 2
    square = np.where(flat, 1.0, square)
    v = dots(cross(ap, ac), normal) / square
    w = dots(cross(ab, ap), normal) / square
    best = a + v[:, None] * ab + w[:, None] * ac
    outside = (v < 0) | (w < 0) | (v + w > 1) | flat
    if outside.any():
        p = points[outside]
        best_edge = np.full(len(p), np.inf)
        for start, stop in ((a, b), (b, c), (c, a)):
            s, e = start[outside], stop[outside] - start[outside]
            t = np.clip(dots(p - s, e) / np.maximum(dots(e, e), 1e-300), 0, 1)
            q = s + t[:, None] * e
            d = dots(p - q, p - q)
            better = d < best_edge
            best_edge = np.where(better, d, best_edge)
            if start is a:
                edge = q
            else:
                edge[better] = q[better]
        best[outside] = edge
    return best


def dots(a: Array, b: Array) -> Array:
    """Return the dot products of vectors a and b, shapes (k, 3), as an array (k,)."""
    return np.einsum("kc,kc->k", a, b)
