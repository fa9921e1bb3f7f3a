"""The rigid motion that lays a cloud of points on a mesh, whatever frame the cloud comes in."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import eigh
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..common.arrays import Array, IntArray, freeze
from ..common.surface_errors import DistanceStatistics
from .mesh.triangle_mesh import TriangleMesh
from .surface.distance import MeshDistance, closest_on_triangles, split_faces

# A cloud this near on the mean lies where it should: taxels stand off a mesh by the thickness of a cover [m].
ON_MESH_DISTANCE = 3e-3
# One that no motion brings to less than this share of its mean distance does too, up to the thickest of skins [m].
MAX_REMAINING_RATIO, MAX_SKIN_THICKNESS = 0.5, 1e-2
# Shares of the cloud's size: a cloud further off than the first does not lie on the mesh; poses that move its points
# further apart than the second lie in two places.
MAX_MEAN_FRACTION, DISTINCT_FRACTION = 0.01, 0.1
# Another pose whose mean distance exceeds the best one's by no more than this factor fits as well as it does; nor do
# distances below this share of the cloud's size tell two poses apart.
RIVAL_RATIO, RESOLUTION_FRACTION = 1.5, 5e-4
MIN_CLOUD_SIZE = 1e-6  # size of a cloud that has none [m]

# Where the search starts: turned every way, with its middle in the middle of the mesh and at places spread over it.
START_ROTATIONS, START_POSITIONS = 300, 12
# Steps of the search, and the share of the starts that takes them.
DESCENT_ROUNDS = ((10, 1.0), (10, 0.3), (10, 0.1))
MIN_STARTS = 30
DESCENT_POINTS, RANKING_POINTS = (
    60,
    150,
)  # points of the cloud that the search looks at, and those that its best poses are told apart by
TRIMMED_FRACTION = 0.9  # share of the points that counts in a step: those nearest to the mesh
MOTION_COST = 1e-2  # how much a point's way costs, against its distance to the mesh
# How many different poses are refined on some points, those of how many places among them that are refined on all, and
# how many in all; poses that move the points apart by less than this share of the cloud's size are one.
CANDIDATES, RIVALS, FINALISTS, EQUAL_FRACTION = 16, 2, 8, 0.03
CANDIDATE_ITERATIONS, FINAL_ITERATIONS = 15, 60
# Distances below this share of the cloud's size count by their squares, longer ones by themselves: means of distances
# alone have a dip wherever a few points happen to lie on faces.
SOFT_WIDTH_FRACTION = 2.5e-3
POSE_TOLERANCE = 1e-7  # a step that moves no point by more than this share of the cloud's size is the last

SAMPLE_SPACING = 0.015  # of the points spread over the mesh, as a share of its size
GRID_CELLS = 48  # along each side of the grid that knows the nearest of them
GRID_HALF_SIDE = 0.62  # half a side of the grid, as a share of the mesh's size
CANDIDATE_FACES = 4  # faces whose exact distance is asked for


Verdict = Literal["right", "moved", "ambiguous", "lost"]


@dataclass(frozen=True, eq=False)
class RigidFit:
    """The motion ``rotation @ p + translation`` that lays a cloud best on a mesh, and whether to apply it.

    ``verdict`` is one of

    ``"right"``      the cloud lies near the mesh as it is, or no motion brings it much nearer
    ``"moved"``      this motion lays it on the mesh, and no other does
    ``"ambiguous"``  it lies on the mesh in other places as well: this is one of them
    ``"lost"``       no motion lays it on the mesh; this one comes nearest
    """

    rotation: Array  # (3, 3) proper
    translation: Array  # (3,) [m]
    before: DistanceStatistics  # from the points as given to the mesh [m]
    after: DistanceStatistics  # once they are moved
    verdict: Verdict
    slack: float  # how far the points may slide over the mesh before the distances tell [m]; at most the cloud's size
    rival: float  # mean distance in the best of the other places [m]; infinite where none was looked for or found

    def __post_init__(self):
        freeze(self, rotation=(3, 3), translation=(3,))

    def __call__(self, points: Array) -> Array:
        """Where points (k, 3) go [m]."""
        return points @ self.rotation.T + self.translation


def find_frame(mesh: TriangleMesh, points: Array) -> RigidFit:
    """Find the frame of a cloud of points that should lie on a mesh, from any start.

    Thousands of starts descend together to the mesh on a few points of the cloud; what they find is told apart and
    refined on all points, towards the least mean distance. A cloud whose mean distance is less than `NEAR` stays.

    Parameters
    ----------
    mesh : TriangleMesh
        Of the link, in the link frame.
    points : array, shape (n, 3)
        [m], in a frame of their own, or in the link frame.
    """
    points = np.asarray(points, float)
    exact, cloud = MeshDistance(mesh), Cloud.of(points)
    before = _statistics(exact, points)
    if before.mean <= ON_MESH_DISTANCE:
        return _right(before, _slack(mesh, exact, points))
    best, others = _search(SampledMesh(mesh), cloud)
    moved = cloud.at(best)
    after, slack = _statistics(exact, moved), _slack(mesh, exact, moved)
    rival = min((_statistics(exact, cloud.at(pose)).mean for pose in others), default=np.inf)
    if after.mean > MAX_REMAINING_RATIO * before.mean and before.mean <= MAX_SKIN_THICKNESS:
        return _right(before, slack, rival)
    unsure = (
        rival <= RIVAL_RATIO * after.mean + RESOLUTION_FRACTION * cloud.size or slack > DISTINCT_FRACTION * cloud.size
    )
    lost = after.mean > min(MAX_MEAN_FRACTION * cloud.size, MAX_REMAINING_RATIO * before.mean)
    verdict: Verdict = "lost" if lost else "ambiguous" if unsure else "moved"
    return RigidFit(best.rotation, best.position - best.rotation @ cloud.centre, before, after, verdict, slack, rival)


def _right(before: DistanceStatistics, slack: float, rival: float = np.inf) -> RigidFit:
    return RigidFit(np.eye(3), np.zeros(3), before, before, "right", slack, rival)


@dataclass(frozen=True, eq=False)
class Pose:
    """How a cloud lies: turned about its middle, which then lies at ``place``."""

    rotation: Array  # (3, 3) proper
    position: Array  # (3,) [m]


@dataclass(frozen=True, eq=False)
class Cloud:
    """Points about their middle."""

    points: Array  # (n, 3) [m]
    centre: Array  # (3,) [m]
    size: float  # diameter of the ball about the middle that holds them [m]; never zero

    @classmethod
    def of(cls, points: Array) -> "Cloud":
        """The cloud of points (n, 3) as they are given."""
        centre = points.mean(axis=0)
        arms = points - centre
        return cls(arms, centre, max(2 * float(np.linalg.norm(arms, axis=1).max()), MIN_CLOUD_SIZE))

    def at(self, pose: Pose) -> Array:
        """The points in a pose, shape (n, 3) [m]."""
        return self.points @ pose.rotation.T + pose.position


class SampledMesh:
    """Points spread over a mesh: the nearest of them at once, from a grid, and nearly exact distances, from a tree."""

    def __init__(self, mesh: TriangleMesh):
        self.mesh = mesh
        self.points, self.face, _ = split_faces(mesh, SAMPLE_SPACING * mesh.size)
        self.tree = cKDTree(self.points)
        self.centre = mesh.vertices.mean(axis=0)
        self.low = self.centre - GRID_HALF_SIDE * mesh.size
        self.cell = 2 * GRID_HALF_SIDE * mesh.size / GRID_CELLS
        owner = np.full(GRID_CELLS**3, -1)
        owner[self._cells(self.points)] = np.arange(len(self.points))
        i, j, k = distance_transform_edt(
            (owner < 0).reshape(GRID_CELLS, GRID_CELLS, GRID_CELLS), return_distances=False, return_indices=True
        )
        self.nearest = owner[((i * GRID_CELLS + j) * GRID_CELLS + k).ravel()]

    def _cells(self, points: Array) -> IntArray:
        i, j, k = np.moveaxis(np.clip((points - self.low) / self.cell, 0, GRID_CELLS - 1).astype(np.int64), -1, 0)
        return (i * GRID_CELLS + j) * GRID_CELLS + k

    def planes(self, points: Array) -> tuple[Array, Array]:
        """A point of the mesh near each point, and the normal of its face, shapes (..., 3)."""
        sample = self.nearest[self._cells(points)]
        return self.points[sample], self.mesh.face_normals[self.face[sample]]

    def __call__(self, points: Array) -> tuple[Array, IntArray]:
        """The nearest point of the mesh to each point (k, 3), shape (k, 3), and its face: the best of a few."""
        few = min(CANDIDATE_FACES, len(self.points))
        faces = self.face[self.tree.query(points, k=np.arange(1, few + 1))[1]]
        feet = closest_on_triangles(np.repeat(points, few, axis=0), self.mesh.triangles[faces.ravel()])
        feet = feet.reshape(len(points), few, 3)
        best = np.linalg.norm(feet - points[:, None], axis=2).argmin(axis=1)
        row = np.arange(len(points))
        return feet[row, best], faces[row, best]


def _search(samples: SampledMesh, cloud: Cloud) -> tuple[Pose, list[Pose]]:
    """The pose that lies nearest to the mesh, and the best ones of those that lie elsewhere."""
    few = cloud.points[farthest_points(cloud.points, DESCENT_POINTS)]
    positions = np.vstack((samples.centre, samples.points[farthest_points(samples.points, START_POSITIONS)]))
    rotations, positions = (
        np.repeat(even_rotations(START_ROTATIONS), len(positions), axis=0),
        np.tile(positions, (START_ROTATIONS, 1)),
    )
    starts, misfit = len(rotations), np.zeros(len(rotations))
    for steps, fraction in DESCENT_ROUNDS:
        kept = np.argsort(misfit, kind="stable")[: max(MIN_STARTS, int(fraction * starts))]
        rotations, positions, misfit = descend(samples, few, rotations[kept], positions[kept], steps)
    found = [Pose(rotations[i], positions[i]) for i in np.argsort(misfit, kind="stable")]
    some = cloud.points[farthest_points(cloud.points, RANKING_POINTS)]
    found = _different(found, some, EQUAL_FRACTION * cloud.size, CANDIDATES)
    found = _ranked(_refine(samples, some, pose, CANDIDATE_ITERATIONS, cloud.size) for pose in found)
    rivals = _different(found, some, DISTINCT_FRACTION * cloud.size, RIVALS)
    finalists = rivals + [pose for pose in found if pose not in rivals][: FINALISTS - len(rivals)]
    found = _ranked(_refine(samples, cloud.points, pose, FINAL_ITERATIONS, cloud.size) for pose in finalists)
    return found[0], [pose for pose in found if _between(some, pose, found[0]) > DISTINCT_FRACTION * cloud.size]


def _ranked(refined: Iterable[tuple[float, Pose]]) -> list[Pose]:
    return [pose for _, pose in sorted(refined, key=lambda pair: pair[0])]


def descend(
    samples: SampledMesh, points: Array, rotations: Array, positions: Array, steps: int
) -> tuple[Array, Array, Array]:
    """Many poses of a few points down to the planes of the faces near them, all at once.

    Returns
    -------
    turns : array, shape (b, 3, 3)
    places : array, shape (b, 3)
    misfit : array, shape (b,)
        Mean distance of the points that count, before the last step [m].
    """
    keep = max(int(np.ceil(TRIMMED_FRACTION * len(points))), 1)
    displacements = _displacements(points)
    cost = MOTION_COST * np.einsum("kci,kcj->ij", displacements, displacements) + _tiny(points) * np.eye(6)
    misfit = np.zeros(len(rotations))
    for _ in range(steps):
        there = np.matmul(points, rotations.transpose(0, 2, 1)) + positions[:, None]
        near, normals = samples.planes(there)
        gap, normals = np.matmul(near - there, rotations), np.matmul(normals, rotations)  # as the cloud sees them
        height = (gap * normals).sum(axis=2)
        tangential = np.sqrt(np.maximum((gap * gap).sum(axis=2) - height**2, 0))
        # A plane goes on beyond its face: further aside than the samples lie apart, a point is beside the mesh.
        distance = np.hypot(height, np.maximum(tangential - 1.5 * samples.cell, 0))
        counts = distance <= np.partition(distance, keep - 1, axis=1)[:, keep - 1, None]
        misfit = (distance * counts).sum(axis=1) / counts.sum(axis=1)
        slopes = np.concatenate((np.cross(points, normals), normals), axis=2) * counts[..., None]
        matrix = np.matmul(slopes.transpose(0, 2, 1), slopes) + cost
        step = np.linalg.solve(matrix, np.matmul(slopes.transpose(0, 2, 1), height[..., None]))[..., 0]
        positions = positions + np.matmul(rotations, step[:, 3:, None])[..., 0]
        rotations = np.matmul(rotations, Rotation.from_rotvec(step[:, :3]).as_matrix())
    return rotations, positions, misfit


def _refine(samples: SampledMesh, points: Array, pose: Pose, steps: int, size: float) -> tuple[float, Pose]:
    """Gauss-Newton steps on weighted squares; the best pose on the way, and how far off the points are there [m]."""
    displacements = _displacements(points)
    cost = 1e-6 * np.einsum("kci,kcj->ij", displacements, displacements) / len(points) + _tiny(points) * np.eye(6)
    least, best = np.inf, pose
    for _ in range(steps):
        there = points @ pose.rotation.T + pose.position
        feet, faces = samples(there)
        gap = (feet - there) @ pose.rotation
        distance = np.linalg.norm(gap, axis=1)
        soft = np.hypot(distance, SOFT_WIDTH_FRACTION * size)
        misfit = float(soft.mean()) - SOFT_WIDTH_FRACTION * size
        if misfit < least:
            least, best = misfit, pose
        heading = np.where(
            (distance > 1e-9 * size)[:, None],
            gap / np.maximum(distance, 1e-300)[:, None],
            samples.mesh.face_normals[faces] @ pose.rotation,
        )
        weight = 1 / soft
        weight /= weight.sum()
        slopes = np.column_stack((np.cross(points, heading), heading))
        matrix = (weight[:, None] * slopes).T @ slopes + cost
        step = np.linalg.solve(matrix, slopes.T @ (weight * distance))
        pose = Pose(
            pose.rotation @ Rotation.from_rotvec(step[:3]).as_matrix(), pose.position + pose.rotation @ step[3:]
        )
        if np.linalg.norm(displacements @ step, axis=1).max() < POSE_TOLERANCE * size:
            break
    u, _, v = np.linalg.svd(best.rotation)  # the products of many steps are a rotation but for their rounding
    return least, Pose(u @ v, best.position)


def _displacements(points: Array) -> Array:
    """How points about the middle move with small turns (three columns) and shifts (three more), shape (k, 3, 6)."""
    x, y, z = points.T
    displacements = np.zeros((len(points), 3, 6))
    displacements[:, 0, 1], displacements[:, 0, 2] = z, -y
    displacements[:, 1, 0], displacements[:, 1, 2] = -z, x
    displacements[:, 2, 0], displacements[:, 2, 1] = y, -x
    displacements[:, :, 3:] = np.eye(3)
    return displacements


def _tiny(points: Array) -> float:
    """What keeps a system solvable where points on one line leave a turn free."""
    return 1e-12 * max(float((points**2).sum(axis=1).max()), 1e-300)


def _slack(mesh: TriangleMesh, exact: MeshDistance, points: Array) -> float:
    """How far points (n, 3) may slide over a mesh before their distances tell [m]; at most their size.

    Of all small motions of root mean square one, one changes the distances least (Gelfand et al., 2003); it may go on
    until it changes them by as much as they are.
    """
    distance, face, _ = exact(points)
    cloud = Cloud.of(points)
    normals = mesh.face_normals[face]
    slopes = np.column_stack((np.cross(cloud.points, normals), normals))
    displacements = _displacements(cloud.points)
    lengths = np.einsum("kci,kcj->ij", displacements, displacements) + _tiny(cloud.points) * np.eye(6)
    change = max(float(eigh(slopes.T @ slopes, lengths, eigvals_only=True)[0]), 1e-12)
    noise = max(float(np.sqrt((distance**2).mean())), RESOLUTION_FRACTION * cloud.size)
    return min(noise / change**0.5, cloud.size)


def _statistics(exact: MeshDistance, points: Array) -> DistanceStatistics:
    return DistanceStatistics.of(exact(points)[0], np.ones(len(points)))


def _between(points: Array, a: Pose, b: Pose) -> float:
    """Mean distance between points in two poses [m]."""
    return float(np.linalg.norm(points @ (a.rotation - b.rotation).T + a.position - b.position, axis=1).mean())


def _different(poses: list[Pose], points: Array, far: float, most: int) -> list[Pose]:
    """The first poses that are each further than ``far`` from all those before [m]."""
    chosen: list[Pose] = []
    for pose in poses:
        if len(chosen) == most:
            break
        if all(_between(points, pose, other) > far for other in chosen):
            chosen.append(pose)
    return chosen


def farthest_points(points: Array, count: int) -> IntArray:
    """Indices of at most ``count`` points that lie far from each other, the outermost first."""
    distance = ((points - points.mean(axis=0)) ** 2).sum(axis=1)
    chosen = [int(distance.argmax())]
    distance = ((points - points[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
    return np.array(chosen)


def even_rotations(count: int) -> Array:
    """Rotations spread evenly over all (super-Fibonacci spirals, Alexa 2022), shape (count, 3, 3)."""
    i = np.arange(count) + 0.5
    inner, outer = np.sqrt(i / count), np.sqrt(1 - i / count)
    a, b = 2 * np.pi * i / np.sqrt(2), 2 * np.pi * i / 1.533751168755204288118041
    return Rotation.from_quat(
        np.column_stack((inner * np.sin(a), inner * np.cos(a), outer * np.sin(b), outer * np.cos(b)))
    ).as_matrix()
