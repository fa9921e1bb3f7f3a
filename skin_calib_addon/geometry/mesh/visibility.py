"""What of a mesh can be seen from outside, by depth buffers from directions all around it.

A buffer has for each square pixel the foremost point of the mesh. A point of a face is visible unless this foremost
point lies above the plane of its face. The winding of the faces is not used: both sides are looked at.
"""

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray

from ...common.arrays import Array, BoolArray, IntArray, freeze, unit
from .face_points import sample_faces
from .triangle_mesh import TriangleMesh

# [1] directions in which the buffers look, half of them; each buffer is looked at from both ends. More: narrower
# openings let something be seen, and it takes longer.
AXES = 30
# [m] distance of the points on the faces. Larger: faster; narrow gaps and thin walls are less exact.
FACE_POINT_DISTANCE = 1.3e-3
# [fraction of the size of the mesh] the same for small meshes.
SMALL_POINT_DISTANCE = 0.01
# [1] points of a mesh at which the distance of the points increases. Larger: large meshes are more exact and take
# longer. Each face has one point in any case.
MAX_POINTS = 300_000
# [distance of the points] side of a pixel; a square with this side contains a point of a grid. Smaller: what is behind
# between the points can be seen; larger: more is hidden next to edges.
PIXEL_SIDE = 1.42
# [m] height above the plane of a face up to which other faces do not hide it. Larger: faces behind narrow gaps are
# visible; smaller: concave faces hide themselves.
HIDING_HEIGHT = 1e-4
# [1] cosine of the angle between the normal and a direction below which this direction sees nothing. Smaller: walls are
# looked at so flatly that a pixel is longer than they are thick.
MIN_VIEW_COSINE = 0.2
# [1] openness above which a point is visible. Larger: the bottoms of holes and slots become hidden; smaller: single
# directions that see through between two points decide.
MIN_OPENNESS = 0.02
# [1] openness (cosine-weighted fraction of the directions that see a point) above which a place is in the open. Larger:
# less of slots and hollows gets skin.
MIN_OPEN = 0.2
# [1] fraction of the area of a visible face that is visible. Larger: more gaps; smaller: more hidden area is kept.
MIN_SEEN_FRACTION = 0.5
# [1] openness of the side of the winding, relative to the other side, below which the other one is outside. Larger: the
# sides of sheets without thickness change from face to face; smaller: faces wound inward stay so.
OTHER_SIDE_RATIO = 0.5


@dataclass(frozen=True, eq=False)
class Visibility:
    """What of each face can be seen from outside."""

    fractions: Array  # (f,) visible fraction of the area, of the outer side
    sides: IntArray  # (f,) 1 if the normal by the winding points outward, otherwise -1

    def __post_init__(self):
        freeze(self, fractions=(None,), sides=(None,))

    @property
    def seen(self) -> BoolArray:
        """Return the faces that are mostly visible, shape (f,)."""
        return self.fractions > MIN_SEEN_FRACTION


@lru_cache(maxsize=1)  # in the window, the author changes cuts of one mesh
def visibility(mesh: TriangleMesh) -> Visibility:
    """Return what of each face can be seen from outside, and which of its sides is outside."""
    points, face, areas = sample_faces(mesh, point_distance(mesh))
    open_sides = depth_buffers(mesh).openness(points, mesh.face_normals[face])
    with_winding, against = (np.bincount(face, areas * side, len(mesh.faces)) for side in open_sides)
    inward = with_winding < OTHER_SIDE_RATIO * against
    visible = np.where(inward[face], open_sides[1], open_sides[0]) > MIN_OPENNESS
    total = np.bincount(face, areas, len(mesh.faces))
    fractions = np.bincount(face, areas * visible, len(mesh.faces)) / np.where(total, total, 1)
    return Visibility(fractions, np.where(inward, -1, 1))


def are_seen(mesh: TriangleMesh, points: Array, normals: Array) -> BoolArray:
    """Return which points (k, 3) on or above a mesh can be seen from outside.

    A point below a face is hidden by it. Move points of a surface that approximates the mesh outward before.
    """
    return openness_at(mesh, points, normals) > MIN_OPENNESS


def openness_at(mesh: TriangleMesh, points: Array, normals: Array) -> Array:
    """Return how open the space above points (k, 3) on or above a mesh is, (k,): 0 is hidden, 1 is free."""
    return depth_buffers(mesh).openness(np.asarray(points, float), np.asarray(normals, float))[0]


@dataclass(frozen=True, eq=False)
class DepthBuffers:
    """The foremost of the points that hide others, for each pixel of buffers in directions all around them."""

    hiding: Array  # (3, n) coordinates of the points from ``middle`` [m]
    middle: Array  # (3, 1) [m]
    radius: float  # half of the width of the buffers [m]
    pixel: float  # side of a pixel [m]
    width: int  # [pixels]
    fronts: NDArray[np.int32]  # (AXES, 2, width * width) number of the foremost point from both ends; -1: none

    @classmethod
    def of(cls, points: Array, distance: float) -> "DepthBuffers":
        """Fill the buffers."""
        middle, pixel = points.mean(axis=0)[:, None], PIXEL_SIDE * distance
        # Coordinates one after the other: faster, and rounded in the same manner on all machines.
        hiding = np.subtract(points.T, middle, order="C")
        radius = pixel + float(np.sqrt(_dot(hiding, hiding).max()))  # so that the pixels at the border are empty
        width, number = int(2 * radius / pixel) + 1, np.arange(len(points))
        buffers = cls(hiding, middle, radius, pixel, width, np.empty((AXES, 2, width * width), np.int32))
        for (right, up, viewer), fronts in zip(view_frames(), buffers.fronts):
            # Depth and number of a point in one integer: the least and the largest of a pixel are its ends.
            key = (((_dot(hiding, viewer) + radius) * (2**31 / (2 * radius))).astype(np.int64) << 32) | number
            at = buffers._pixels(right, up, hiding)
            highest, lowest = np.full(width * width, -1, np.int64), np.full(width * width, 2**63 - 1)
            np.maximum.at(highest, at, key)
            np.minimum.at(lowest, at, key)
            fronts[0] = np.where(highest < 0, -1, highest & (2**32 - 1))
            fronts[1] = np.where(lowest == 2**63 - 1, -1, lowest & (2**32 - 1))
        return buffers

    def openness(self, points: Array, normals: Array, least: Array | float = HIDING_HEIGHT) -> Array:
        r"""Return how open the space above points is, on the side of their normals and on the other side.

        ``least`` is the height [m] above the plane of a face from which on each point of the mesh hides it.

        This is :math:`\frac{4}{m} \sum_i \cos\alpha_i` over the directions that see the point, of m directions, with
        the angle :math:`\alpha_i` to the normal: 1 for a free point, 0 for a hidden one (ambient occlusion; Zhukov et
        al., An ambient light illumination model, 1998).
        """
        points, normals = np.subtract(points.T, self.middle, order="C"), np.ascontiguousarray(normals.T)
        heights, sums = _dot(points, normals), np.zeros((2, points.shape[1]))
        least = np.broadcast_to(least, self.hiding.shape[1])
        for (right, up, viewer), fronts in zip(view_frames(), self.fronts):
            here, cosines = self._pixels(right, up, points), _dot(normals, viewer)
            for front, sign in zip(fronts, (1, -1)):
                found, facing = front[here], sign * cosines
                above = sum(h.take(found) * n for h, n in zip(self.hiding, normals)) - heights
                is_free = (found < 0) | (above * np.sign(facing) < least.take(found))
                facing *= (np.abs(facing) > MIN_VIEW_COSINE) & is_free
                sums[0] += np.maximum(facing, 0)
                sums[1] -= np.minimum(facing, 0)
        return 2 / AXES * sums

    def _pixels(self, right: Array, up: Array, positions: Array) -> IntArray:
        """Return the pixel of positions (3, k) from the middle, shape (k,)."""
        column, row = (
            np.clip((_dot(positions, axis) + self.radius) / self.pixel, 0, self.width - 1).astype(np.int64)
            for axis in (right, up)
        )
        return column * self.width + row


@lru_cache(maxsize=1)  # one link after the other
def depth_buffers(mesh: TriangleMesh) -> DepthBuffers:
    """Return the depth buffers of points on the faces of a mesh [m], all shells, closed or not."""
    distance = point_distance(mesh)
    return DepthBuffers.of(sample_faces(mesh, distance)[0], distance)


def _dot(a: Array, b: Array) -> Array:
    """Return the dot products of vectors whose coordinates are rows."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@cache
def view_frames() -> Array:
    """Return the directions of the buffers as rotations, shape (AXES, 3, 3): right, up and towards the viewer.

    They are evenly spread over half of the sphere (golden spiral; González, Measurement of areas on a sphere using
    Fibonacci and latitude-longitude lattices, 2010).
    """
    i = np.arange(AXES)
    z, angle = 1 - (i + 0.5) / AXES, np.pi * (1 + np.sqrt(5)) * i
    r = np.sqrt(1 - z**2)
    axes = np.column_stack((r * np.cos(angle), r * np.sin(angle), z))
    right = unit(np.cross(axes, np.eye(3)[np.argmin(np.abs(axes), axis=1)]))
    return np.stack((right, np.cross(axes, right), axes), axis=1)


def point_distance(mesh: TriangleMesh) -> float:
    """Return the distance of points on the faces, with which their number is limited [m]."""
    area, length = float(mesh.face_areas.sum()), float(mesh.longest_sides.sum())
    # The number of points is at most about area / distance^2 + length / distance, plus one for each face.
    wanted = min(FACE_POINT_DISTANCE, SMALL_POINT_DISTANCE * mesh.size)
    return max(wanted, (length + np.sqrt(length**2 + 4 * MAX_POINTS * area)) / (2 * MAX_POINTS))
