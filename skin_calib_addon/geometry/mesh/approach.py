"""How near the mesh of a tool comes to that of a link, or how deep it is inside.

The signed distance of a point changes by at most the length of a step. A triangle of the tool whose middle has the
distance d and whose corners are within r of it therefore has no point below d - r. Parts of the tool that cannot be the
nearest ones are dropped, others are divided.
"""

from typing import NamedTuple

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray, cross, norms, unit
from .distance import closest, dots
from .triangle_mesh import TriangleMesh, weld

RESOLUTION = 2e-4  # [m] radius of the smallest parts of the tool. Smaller: more accurate, more time.
COARSE_RESOLUTION = 2e-3  # [m] likewise, to see whether the poses are right.
# [m] Points of the tool that are this much farther than the nearest one touch, too. Larger: the point of touch is the
# mean of a larger part. Smaller: it depends on single faces of the meshes.
SAME_DISTANCE = 5e-5
MAX_PARTS = 100_000  # [1] of a tool. Larger: a flat tool on a flat link is divided further, which takes longer.
NEIGHBOURHOOD = 0.01  # [m] around a touch. Larger: more time. Smaller: the link ends inside a deep tool.
# [1] cosine of the angle from the normal of a face to the tool, above which the tool can touch it. Larger: the link
# ends at edges. Smaller: inner sides of walls count for tools that lean.
MIN_FACING = -0.5
# [1] relative distance from a side of a triangle within which a point is on it. Larger: faces have normals of edges.
ON_SIDE = 1e-9


class Approach(NamedTuple):
    """Where a tool is nearest to a link, or deepest in it, in the frame of the link."""

    distance: float  # from the link [m]; negative inside
    point: Array  # (3,) mean of the nearest points of the tool [m]
    spread: float  # root mean square distance of these from their mean [m]
    is_at_rim: bool  # whether the link ends there, so that inside and outside are not known
    centroid: Array | None  # (3,) of the part of the tool's surface that is inside the link [m]; None: there is none


class SignedDistance:
    """Distance from a mesh, negative behind its faces; positive next to the rim of a hole, where it has no inside.

    The sign is that of the angle to the normal of the nearest face, edge or corner (Baerentzen and Aanaes, Signed
    distance computation using the angle weighted pseudonormal, 2005).
    """

    def __init__(self, mesh: TriangleMesh):
        self.mesh, corners, normals = mesh, mesh.faces, mesh.face_normals
        self._bounds = mesh.triangles.min(axis=1), mesh.triangles.max(axis=1)
        sides = np.sort(np.stack((corners, np.roll(corners, -1, axis=1)), axis=2), axis=2).reshape(-1, 2)
        _, edge, faces_at = np.unique(
            sides[:, 0] * len(mesh.vertices) + sides[:, 1], return_inverse=True, return_counts=True
        )
        sums = _sums(edge, np.repeat(normals, 3, axis=0), len(faces_at))
        self._of_sides = sums[edge].reshape(-1, 3, 3)
        self._rims = (faces_at[edge] == 1).reshape(-1, 3)
        arms = unit(np.roll(mesh.triangles, -1, axis=1) - mesh.triangles)
        cosines = -(arms * np.roll(arms, 1, axis=1)).sum(axis=2)
        angles = np.arccos(np.clip(cosines, -1, 1))
        of_corners = _sums(corners.ravel(), (angles[..., None] * normals[:, None]).reshape(-1, 3), len(mesh.vertices))
        self._of_corners = of_corners[corners]
        at_rim = np.zeros(len(mesh.vertices), bool)
        at_rim[sides[self._rims.ravel()]] = True
        self._rim_corners = at_rim[corners]

    def facing(self, point: Array, direction: Array) -> "SignedDistance | None":
        """Return the distance from the faces around a point that face a direction; None if all of them or none do.

        A thin wall has an inner side, from which points in the wall can be nearer.
        """
        mesh = self.mesh
        low, high = self._bounds
        is_near = ((low < point + NEIGHBOURHOOD) & (high > point - NEIGHBOURHOOD)).all(axis=1)
        near = np.flatnonzero(is_near)
        chosen = mesh.face_normals[near] @ unit(direction) > MIN_FACING
        if chosen.all() or not chosen.any():
            return None
        return SignedDistance(weld(mesh.vertices, mesh.faces[near[chosen]]))

    def __call__(self, points: Array) -> tuple[Array, BoolArray]:
        """Return the distances (k,) of points (k, 3) [m], and whether the nearest point is on the rim of a hole."""
        distance, face, nearest = closest(self.mesh, points)
        a, b, c = np.moveaxis(self.mesh.triangles[face], 1, 0)
        normal = cross(b - a, c - a)
        square = np.maximum(dots(normal, normal), np.finfo(float).tiny)
        # Barycentric coordinates, of the corners a, b, c; that of a corner is zero on the opposite side.
        weights = np.stack(
            [dots(cross(q - p, nearest - p), normal) / square for p, q in ((b, c), (c, a), (a, b))], axis=1
        )
        is_zero = weights < ON_SIDE
        count = is_zero.sum(axis=1)
        side = (is_zero.argmax(axis=1) + 1) % 3  # side k is from corner k to the next one
        corner = weights.argmax(axis=1)
        normals = np.where((count == 1)[:, None], self._of_sides[face, side], self.mesh.face_normals[face])
        normals = np.where((count > 1)[:, None], self._of_corners[face, corner], normals)
        at_rim = np.where(count == 1, self._rims[face, side], (count > 1) & self._rim_corners[face, corner])
        is_inside = (dots(points - nearest, normals) < 0) & ~at_rim
        return np.where(is_inside, -distance, distance), at_rim


def _sums(rows: IntArray, vectors: Array, count: int) -> Array:
    """Return the sum of the vectors (k, 3) of each row, shape (count, 3)."""
    return np.stack([np.bincount(rows, column, count) for column in vectors.T], axis=1)


class Tool:
    """The triangles of a tool, in clusters, so that most of them need no distance."""

    def __init__(self, mesh: TriangleMesh):
        self.triangles = mesh.triangles
        self.middle = np.average(mesh.triangles.mean(axis=1), axis=0, weights=mesh.face_areas)
        self.clusters = _clusters(self.triangles.mean(axis=1), np.arange(len(mesh.faces)), len(mesh.faces) ** 0.5)

    def distance(self, link: SignedDistance, rotation: Array, position: Array) -> float:
        """Return the distance of `approach` to some millimetres, which is quick where the tool is anywhere [m]."""
        return self._approach(link, rotation, position, COARSE_RESOLUTION).distance

    def approach(self, link: SignedDistance, rotation: Array, position: Array) -> Approach:
        """Return how near the tool comes to the link, at its pose in the frame of the link."""
        found = self._approach(link, rotation, position)
        if found.distance < 0:
            local = link.facing(found.point, rotation @ self.middle + position - found.point)
            found = found if local is None else self._approach(local, rotation, position)
        return found

    def _approach(
        self, link: SignedDistance, rotation: Array, position: Array, resolution: float = RESOLUTION
    ) -> Approach:
        triangles = self.triangles @ rotation.T + position
        middles = triangles.mean(axis=1)
        first = np.array([cluster[0] for cluster in self.clusters])
        radii = np.array([_radius(triangles[c].reshape(-1, 3), middles[c[0]]) for c in self.clusters])
        distances, _ = link(middles[first])
        best = float(distances.min())
        near = distances - radii <= max(best + SAME_DISTANCE, 0.0)
        parts = triangles[np.concatenate([c for c, is_near in zip(self.clusters, near) if is_near])]
        found = []
        while len(parts):
            middles = parts.mean(axis=1)
            distances, at_rim = link(middles)
            best = min(best, float(distances.min()))
            radii = norms((parts - middles[:, None]).reshape(-1, 3)).reshape(-1, 3).max(axis=1)
            low = distances - radii
            can_touch, is_open = low <= best + SAME_DISTANCE, (low <= 0) & (distances + radii > 0)
            divided = (radii > resolution) & (can_touch | is_open)
            if divided.sum() > MAX_PARTS:
                divided[:] = False
            kept = ~divided & (can_touch | (distances < 0))
            found.append((parts[kept], middles[kept], distances[kept], at_rim[kept], can_touch[kept]))
            parts = _quarters(parts[divided])
        parts, middles, distances, at_rim, can_touch = map(np.concatenate, zip(*found))
        areas = norms(cross(parts[:, 1] - parts[:, 0], parts[:, 2] - parts[:, 0])) / 2
        inside = distances < 0
        centroid = np.average(middles[inside], axis=0, weights=areas[inside]) if inside.any() else None
        # The lowest point of a part is its middle, or one of its corners: a sharp tip ends in one.
        points = np.concatenate((middles[can_touch, None], parts[can_touch]), axis=1)
        heights = np.column_stack((distances[can_touch], link(points[:, 1:].reshape(-1, 3))[0].reshape(-1, 3)))
        lowest = heights.argmin(axis=1)[:, None]
        heights = np.take_along_axis(heights, lowest, axis=1)[:, 0]
        touching = heights <= heights.min() + SAME_DISTANCE
        points = np.take_along_axis(points, lowest[..., None], axis=1)[touching, 0]
        areas = areas[can_touch][touching]
        point = np.average(points, axis=0, weights=areas)
        spread = np.sqrt(np.average(((points - point) ** 2).sum(axis=1), weights=areas))
        return Approach(float(heights.min()), point, float(spread), bool(at_rim[can_touch][touching].any()), centroid)


def _radius(points: Array, middle: Array) -> float:
    return float(norms(points - middle).max())


def _quarters(triangles: Array) -> Array:
    """Return the four triangles between the corners and the middles of the sides of each one."""
    middles = (triangles + np.roll(triangles, -1, axis=1)) / 2
    of_corners = [np.stack((triangles[:, k], middles[:, k], middles[:, k - 1]), axis=1) for k in range(3)]
    return np.concatenate((*of_corners, middles))


def _clusters(middles: Array, rows: IntArray, size: float) -> list[IntArray]:
    """Return rows in clusters of at most some size, the row nearest to the middle of a cluster first."""
    points = middles[rows]
    if len(rows) <= max(size, 1):
        order = np.argsort(norms(points - points.mean(axis=0)), kind="stable")
        return [rows[order]]
    order = np.argsort(points[:, np.ptp(points, axis=0).argmax()], kind="stable")
    half = len(rows) // 2
    return [*_clusters(middles, rows[order[:half]], size), *_clusters(middles, rows[order[half:]], size)]
