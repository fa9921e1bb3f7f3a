"""The rigid motion that registers a cloud of points to a mesh, from any initial frame."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import eigh
from scipy.ndimage import distance_transform_edt
from scipy.spatial.transform import Rotation

from ..common.arrays import Array, IntArray, freeze
from ..common.surface_errors import DistanceStatistics
from .mesh.distance import closest
from .mesh.face_points import sample_faces
from .mesh.triangle_mesh import TriangleMesh
from .surface.bspline import MIN_LENGTH

# [m] mean distance below which a cloud is on the mesh: the thickness of a cover separates taxels from the mesh. Larger:
# wrong frames of less than this distance are not found.
ON_MESH_DISTANCE = 3e-3
# [1] ratio of the mean distances after and before a motion. If no motion gets below it, a cloud is on the mesh too, up
# to ``MAX_SKIN_THICKNESS``. Larger: motions with less effect are proposed.
MAX_REMAINING_RATIO = 0.5
MAX_SKIN_THICKNESS = 1e-2  # [m] of the thickest skin. Larger: thicker skins stay, wrong frames are missed
# [m] mean distance above which a cloud is not on the mesh. The taxels of four parts of an iCub have 0.03 to 0.46 mm on
# their own meshes, and 1.6 mm or more on the meshes of other parts. Larger: worse poses are accepted.
MAX_MEAN_DISTANCE = 1e-3
# [fraction of the cloud size] mean distance between the points of two poses above which the poses differ.
# Larger: fewer ambiguous results.
DISTINCT_FRACTION = 0.1
# [1] ratio of the mean distances of another pose and the best pose below which both fit. Larger: more ambiguous
# results.
RIVAL_RATIO = 1.5
# [fraction of the cloud size] mean distances that differ by less are equal. Larger: more ambiguous results.
RESOLUTION_FRACTION = 5e-4

START_ROTATIONS = 300  # [1] even rotations of the initial poses. Larger: a safer search, more time
# [1] positions over the mesh of the centre of the cloud in these poses, besides its own. Larger: safer, more time.
START_POSITIONS = 12
# (iterations, fraction of the initial poses that takes them). More: a safer search, more time.
DESCENT_ROUNDS = ((10, 1.0), (10, 0.3), (10, 0.1))
DESCENT_POINTS = 60  # [1] points of the cloud that the descent uses. Larger: a safer search, more time
RANKING_POINTS = 150  # [1] points of the cloud that rank and distinguish the best poses. Larger: safer, more time
# [fraction of the points] with the least distances or deviations that count. Smaller: more outliers are ignored.
TRIMMED_FRACTION = 0.9
# [1] weight of the squared motion of a point relative to its squared distance. Larger: shorter steps.
MOTION_COST = 1e-2
# [1] weight of the squared motion in the final refinement. Larger: shorter steps, slower convergence.
FINAL_MOTION_COST = 1e-6
CANDIDATES = 16  # [1] different poses that are refined on all points. Larger: a safer search, more time
# [fraction of the cloud size] mean distance between the points of two poses below which they are equal. Larger: fewer
# candidates.
EQUAL_FRACTION = 0.03
MAX_STEPS = 60  # [1] of the refinement of a pose. Larger: no effect after convergence
# [fraction of the cloud size] Shorter distances count by their squares, longer ones linearly. Mean distances alone have
# a local minimum wherever a few points are on faces. Larger: outliers have more weight.
SOFT_WIDTH_FRACTION = 2.5e-3
# [fraction of the cloud size] movement of all points below which the steps have converged. Larger: less accurate.
POSE_TOLERANCE = 1e-6

SAMPLE_SPACING = (
    0.015  # [fraction of the mesh size] between the sample points of the mesh. Smaller: more accurate descent
)
GRID_CELLS = 48  # [1] cells per side of the grid of nearest samples. Larger: more accurate descent, more memory
GRID_HALF_SIDE = 0.62  # [fraction of the mesh size] half a side of this grid. Larger: larger cells


# Nearby motions.
# [1] ratio of the residuals after and before a nearby motion below which the frame is wrong. True frames of real skins
# have 0.85 to 0.98, frames that are wrong by 3 degrees and 4 mm at most 0.41. Larger: false alarms.
NEARBY_RATIO = 0.6
NEARBY_GAIN = 1e-4  # [m] least decrease of the residual of a wrong frame. Larger: misses wrong frames on flat links
# [m, rad] largest nearby motion. Larger: proposes motions that are no small corrections.
NEARBY_LIMIT = (0.02, 0.3)

Verdict = Literal["right", "moved", "ambiguous", "lost"]


@dataclass(frozen=True, eq=False)
class RigidFit:
    """The motion ``rotation @ p + translation`` that registers a cloud best to a mesh, and whether to apply it.

    ``verdict`` is one of

    ``"right"``      the cloud is near the mesh as it is, or no motion reduces its distance much
    ``"moved"``      this motion brings it onto the mesh, and no other motion does
    ``"ambiguous"``  the cloud fits the mesh in other poses as well; this is one of them
    ``"lost"``       no motion brings it onto the mesh; this one has the least distance
    """

    rotation: Array  # (3, 3) proper
    translation: Array  # (3,) [m]
    before: DistanceStatistics  # from the points as given to the mesh [m]
    after: DistanceStatistics  # after the motion
    verdict: Verdict
    slack: float  # distance that the points can slide before their distances show it [m]; at most the cloud size
    rival: float  # mean distance in the best different pose [m]; infinite without such a pose
    nearby: "NearbyFit | None" = None  # the best small motion of the points as given; None unless they are "right"

    def __post_init__(self):
        freeze(self, rotation=(3, 3), translation=(3,))

    def __call__(self, points: Array) -> Array:
        """Return the points (k, 3) after the motion [m]."""
        return points @ self.rotation.T + self.translation


@dataclass(frozen=True, eq=False)
class NearbyFit:
    """The small motion ``rotation @ p + translation`` that fits a cloud best to a mesh, at any height above it.

    A residual is the root mean square of the heights of the points above the mesh about their median. It does not
    depend on the thickness of the skin.
    """

    rotation: Array  # (3, 3) proper
    translation: Array  # (3,) [m]
    before: float  # residual of the points as given [m]
    after: float  # residual after the motion [m]
    angle: float  # of the motion [rad]
    shift: float  # of the centre of the cloud [m]

    def __post_init__(self):
        freeze(self, rotation=(3, 3), translation=(3,))

    @property
    def is_better(self) -> bool:
        """Whether the points fit clearly better after the motion, so that their frame is wrong."""
        return self.after < NEARBY_RATIO * self.before and self.before - self.after > NEARBY_GAIN


def fit_nearby(mesh: TriangleMesh, points: Array) -> NearbyFit:
    r"""Find the small motion that makes the heights of a cloud above a mesh as even as possible.

    .. math::

        \min_{R, t, h} \sum_i w_i \left( d(R \mathbf{p}_i + t) - h \right)^2 \quad [m^2]

    with the signed distances d to the mesh [m], positive outside, the thickness h of the skin [m] and robust weights w.
    """
    cloud = Cloud.of(points)
    some = cloud.points[farthest_points(cloud.points, RANKING_POINTS)]
    start = Pose(np.eye(3), cloud.centre)
    # The cost is only for motions that no height shows, such as along a cylinder.
    _, best = _least_squares(mesh, some, start, cloud.size, _tiny(some) * np.eye(6), nearby=True)
    before, after = (_residual(_heights(mesh, cloud.at(p))[0]) for p in (start, best))
    if after >= before:
        best, after = start, before
    translation = best.position - best.rotation @ cloud.centre
    shift = float(np.linalg.norm(best.position - cloud.centre))
    return NearbyFit(best.rotation, translation, before, after, _angle(best), shift)


def _least_squares(
    mesh: TriangleMesh, points: Array, pose: "Pose", size: float, cost: Array, nearby: bool = False
) -> tuple[float, "Pose"]:
    """Minimize the mean soft distance by reweighted Gauss-Newton steps; return it [m] and its pose.

    A nearby pose minimizes the residual of the heights about their median instead, because the thickness of the skin is
    unknown, and its steps end at ``NEARBY_LIMIT``.
    """
    displacements, start = _displacements(points), pose.position
    least, best = np.inf, pose
    for _ in range(MAX_STEPS):
        height, heading = _heights(mesh, points @ pose.rotation.T + pose.position)
        off = height - np.median(height) if nearby else height
        soft = np.hypot(off, SOFT_WIDTH_FRACTION * size)
        misfit = _residual(height) if nearby else float(soft.mean()) - SOFT_WIDTH_FRACTION * size
        if misfit < least:
            least, best = misfit, pose
        heading = heading @ pose.rotation
        weight = 1 / soft
        weight /= weight.sum()
        slopes = np.column_stack((np.cross(points, heading), heading))
        if nearby:
            slopes -= weight @ slopes  # the thickness is eliminated
        step = -np.linalg.solve((weight[:, None] * slopes).T @ slopes + cost, slopes.T @ (weight * off))
        turn = Rotation.from_rotvec(step[:3]).as_matrix()
        pose = Pose(pose.rotation @ turn, pose.position + pose.rotation @ step[3:])
        if nearby and (np.linalg.norm(pose.position - start) >= NEARBY_LIMIT[0] or _angle(pose) >= NEARBY_LIMIT[1]):
            break
        if np.linalg.norm(displacements @ step, axis=1).max() < POSE_TOLERANCE * size:
            break
    u, _, v = np.linalg.svd(best.rotation)  # remove the rounding of many products from the rotation
    return least, Pose(u @ v, best.position)


def _heights(mesh: TriangleMesh, points: Array) -> tuple[Array, Array]:
    """Return the heights of points above a mesh, shape (n,) [m], and their gradients, shape (n, 3)."""
    distance, face, feet = closest(mesh, points)
    normals, gap = mesh.face_normals[face], points - feet
    sign = np.where((gap * normals).sum(axis=1) < 0, -1.0, 1.0)
    near = distance < 1e-9 * mesh.size  # the direction to the foot is rounding
    heading = np.where(near[:, None], normals, (sign / np.maximum(distance, np.finfo(float).tiny))[:, None] * gap)
    return sign * distance, heading


def _residual(height: Array) -> float:
    off = np.sort(np.abs(height - np.median(height)))
    return float(np.sqrt((off[: max(int(np.ceil(TRIMMED_FRACTION * len(off))), 1)] ** 2).mean()))


def _angle(pose: "Pose") -> float:
    return float(Rotation.from_matrix(pose.rotation).magnitude())


def find_frame(mesh: TriangleMesh, points: Array) -> RigidFit:
    r"""Find the frame of a cloud of points that should be on a mesh, from any initial frame.

    The result minimizes the mean distance to the mesh over rotations :math:`R` and translations :math:`t`:

    .. math::

        \min_{R, t} \frac{1}{n} \sum_{i=1}^{n} d(R\, \mathbf{p}_i + t) \quad [\text{m}]

    Thousands of initial poses descend together on a few points of the cloud. The best different poses are refined on
    all points. A cloud whose mean distance is at most `ON_MESH_DISTANCE` stays.
    """
    points = np.asarray(points, float)
    cloud = Cloud.of(points)
    before = _statistics(mesh, points)
    if before.mean <= ON_MESH_DISTANCE:
        return _right(before, _slack(mesh, points), nearby=fit_nearby(mesh, points))
    best, others = _search(SampledMesh(mesh), cloud)
    moved = cloud.at(best)
    after, slack = _statistics(mesh, moved), _slack(mesh, moved)
    rival = min((_statistics(mesh, cloud.at(pose)).mean for pose in others), default=np.inf)
    verdict = verdict_of(before.mean, after.mean, rival, slack, cloud.size)
    if verdict == "right":
        return _right(before, slack, rival, fit_nearby(mesh, points))
    return RigidFit(best.rotation, best.position - best.rotation @ cloud.centre, before, after, verdict, slack, rival)


def verdict_of(before: float, after: float, rival: float, slack: float, size: float) -> Verdict:
    """Return what to do with a cloud whose best pose is known."""
    if after > MAX_REMAINING_RATIO * before and before <= MAX_SKIN_THICKNESS:
        return "right"
    if after > min(MAX_MEAN_DISTANCE, MAX_REMAINING_RATIO * before):
        return "lost"
    has_rival = rival <= RIVAL_RATIO * after + RESOLUTION_FRACTION * size
    return "ambiguous" if has_rival or slack > DISTINCT_FRACTION * size else "moved"


def _right(
    before: DistanceStatistics, slack: float, rival: float = np.inf, nearby: NearbyFit | None = None
) -> RigidFit:
    return RigidFit(np.eye(3), np.zeros(3), before, before, "right", slack, rival, nearby)


@dataclass(frozen=True, eq=False)
class Pose:
    """The pose of a cloud: it is rotated about its centre, which is then at ``position``."""

    rotation: Array  # (3, 3) proper
    position: Array  # (3,) [m]


@dataclass(frozen=True, eq=False)
class Cloud:
    """Points relative to their centre."""

    points: Array  # (n, 3) [m]
    centre: Array  # (3,) [m]
    size: float  # diameter of the ball about the centre that contains them [m]; never zero

    @classmethod
    def of(cls, points: Array) -> "Cloud":
        """Return the cloud of points (n, 3)."""
        centre = points.mean(axis=0)
        arms = points - centre
        return cls(arms, centre, max(2 * float(np.linalg.norm(arms, axis=1).max()), MIN_LENGTH))

    def at(self, pose: Pose) -> Array:
        """Return the points in a pose, shape (n, 3) [m]."""
        return self.points @ pose.rotation.T + pose.position


class SampledMesh:
    """Sample points of a mesh, and a grid of the nearest one: for the many poses that start a search."""

    def __init__(self, mesh: TriangleMesh):
        self.mesh = mesh
        self.points, self.face, _ = sample_faces(mesh, SAMPLE_SPACING * mesh.size)
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
        """Return a point of the mesh near each point, and the normal of its face, shapes (..., 3)."""
        sample = self.nearest[self._cells(points)]
        return self.points[sample], self.mesh.face_normals[self.face[sample]]


def _search(samples: SampledMesh, cloud: Cloud) -> tuple[Pose, list[Pose]]:
    """Return the pose with the least distance to the mesh, and the best different poses."""
    few = cloud.points[farthest_points(cloud.points, DESCENT_POINTS)]
    positions = np.vstack((samples.centre, samples.points[farthest_points(samples.points, START_POSITIONS)]))
    rotations, positions = (
        np.repeat(even_rotations(START_ROTATIONS), len(positions), axis=0),
        np.tile(positions, (START_ROTATIONS, 1)),
    )
    starts, misfit = len(rotations), np.zeros(len(rotations))
    for steps, fraction in DESCENT_ROUNDS:
        kept = np.argsort(misfit, kind="stable")[: int(fraction * starts)]
        rotations, positions, misfit = descend(samples, few, rotations[kept], positions[kept], steps)
    found = [Pose(rotations[i], positions[i]) for i in np.argsort(misfit, kind="stable")]
    some = cloud.points[farthest_points(cloud.points, RANKING_POINTS)]
    found = _different(found, some, EQUAL_FRACTION * cloud.size, CANDIDATES)
    refined = [_refine(samples.mesh, cloud, pose) for pose in found]
    found = [pose for _, pose in sorted(refined, key=lambda pair: pair[0])]
    return found[0], [pose for pose in found if _between(some, pose, found[0]) > DISTINCT_FRACTION * cloud.size]


def descend(
    samples: SampledMesh, points: Array, rotations: Array, positions: Array, steps: int
) -> tuple[Array, Array, Array]:
    r"""Move many poses of a few points to the planes of the nearest faces, all at once.

    Each iteration solves, for the rotation vector and the translation :math:`\xi` in the frame of the cloud,

    .. math::

        \left( \sum_i g_i g_i^{T} + C \right) \xi = \sum_i g_i h_i, \qquad
        g_i = \begin{pmatrix} \mathbf{p}_i \times \mathbf{n}_i \\ \mathbf{n}_i \end{pmatrix}

    with the heights :math:`h_i` [m] of the planes over the points, their normals :math:`\mathbf{n}_i`, and the cost
    :math:`C` of the motion.
    """
    keep = max(int(np.ceil(TRIMMED_FRACTION * len(points))), 1)
    displacements = _displacements(points)
    cost = MOTION_COST * np.einsum("kci,kcj->ij", displacements, displacements) + _tiny(points) * np.eye(6)
    misfit = np.zeros(len(rotations))
    for _ in range(steps):
        there = np.matmul(points, rotations.transpose(0, 2, 1)) + positions[:, None]
        near, normals = samples.planes(there)
        gap, normals = np.matmul(near - there, rotations), np.matmul(normals, rotations)  # in the frame of the cloud
        height = (gap * normals).sum(axis=2)
        tangential = np.sqrt(np.maximum((gap * gap).sum(axis=2) - height**2, 0))
        # The plane extends beyond its face. A point with a larger tangential distance than the samples is off the mesh.
        distance = np.hypot(height, np.maximum(tangential - 1.5 * samples.cell, 0))
        counts = distance <= np.partition(distance, keep - 1, axis=1)[:, keep - 1, None]
        misfit = (distance * counts).sum(axis=1) / counts.sum(axis=1)
        slopes = np.concatenate((np.cross(points, normals), normals), axis=2) * counts[..., None]
        matrix = np.matmul(slopes.transpose(0, 2, 1), slopes) + cost
        step = np.linalg.solve(matrix, np.matmul(slopes.transpose(0, 2, 1), height[..., None]))[..., 0]
        positions = positions + np.matmul(rotations, step[:, 3:, None])[..., 0]
        rotations = np.matmul(rotations, Rotation.from_rotvec(step[:, :3]).as_matrix())
    return rotations, positions, misfit


def _refine(mesh: TriangleMesh, cloud: Cloud, pose: Pose) -> tuple[float, Pose]:
    """Minimize the mean soft distance of a cloud; return it [m] and its pose."""
    displacements, tiny = _displacements(cloud.points), _tiny(cloud.points) * np.eye(6)
    moved = np.einsum("kci,kcj->ij", displacements, displacements) / len(cloud.points)
    return _least_squares(mesh, cloud.points, pose, cloud.size, FINAL_MOTION_COST * moved + tiny)


def _displacements(points: Array) -> Array:
    """Return the displacements of points for small rotations (3 columns) and translations (3), shape (k, 3, 6)."""
    x, y, z = points.T
    displacements = np.zeros((len(points), 3, 6))
    displacements[:, 0, 1], displacements[:, 0, 2] = z, -y
    displacements[:, 1, 0], displacements[:, 1, 2] = -z, x
    displacements[:, 2, 0], displacements[:, 2, 1] = y, -x
    displacements[:, :, 3:] = np.eye(3)
    return displacements


def _tiny(points: Array) -> float:
    """Return a regularization that keeps the system solvable if all points are on one line."""
    return 1e-12 * float((points**2).sum(axis=1).max()) + float(np.finfo(float).tiny)


def _slack(mesh: TriangleMesh, points: Array) -> float:
    r"""Return the distance that points (n, 3) can slide over a mesh before their distances show it [m].

    Of all small motions with a root mean square of one, one changes the distances least (Gelfand et al., 2003). With
    the least eigenvalue :math:`\lambda` of this change and the root mean square :math:`\sigma` [m] of the distances,
    the result is :math:`\sigma / \sqrt{\lambda}`, and at most the size of the cloud.
    """
    distance, face, _ = closest(mesh, points)
    cloud = Cloud.of(points)
    normals = mesh.face_normals[face]
    slopes = np.column_stack((np.cross(cloud.points, normals), normals))
    displacements = _displacements(cloud.points)
    lengths = np.einsum("kci,kcj->ij", displacements, displacements) + _tiny(cloud.points) * np.eye(6)
    change = max(float(eigh(slopes.T @ slopes, lengths, eigvals_only=True)[0]), 1e-12)
    noise = max(float(np.sqrt((distance**2).mean())), RESOLUTION_FRACTION * cloud.size)
    return min(noise / change**0.5, cloud.size)


def _statistics(mesh: TriangleMesh, points: Array) -> DistanceStatistics:
    return DistanceStatistics.of(closest(mesh, points)[0], np.ones(len(points)))


def _between(points: Array, a: Pose, b: Pose) -> float:
    """Return the mean distance between points in two poses [m]."""
    return float(np.linalg.norm(points @ (a.rotation - b.rotation).T + a.position - b.position, axis=1).mean())


def _different(poses: list[Pose], points: Array, far: float, most: int) -> list[Pose]:
    """Return the first poses whose points are all further than ``far`` [m] from those of the poses before."""
    chosen: list[Pose] = []
    for pose in poses:
        if len(chosen) == most:
            break
        if all(_between(points, pose, other) > far for other in chosen):
            chosen.append(pose)
    return chosen


def farthest_points(points: Array, count: int) -> IntArray:
    """Return the indices of at most ``count`` points far from each other: farthest-point sampling."""
    distance = ((points - points.mean(axis=0)) ** 2).sum(axis=1)
    chosen = [int(distance.argmax())]
    distance = ((points - points[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
    return np.array(chosen)


def even_rotations(count: int) -> Array:
    """Return even rotations (super-Fibonacci spirals, Alexa 2022), shape (count, 3, 3)."""
    i = np.arange(count) + 0.5
    inner, outer = np.sqrt(i / count), np.sqrt(1 - i / count)
    a, b = 2 * np.pi * i / np.sqrt(2), 2 * np.pi * i / 1.533751168755204288118041
    return Rotation.from_quat(
        np.column_stack((inner * np.sin(a), inner * np.cos(a), outer * np.sin(b), outer * np.cos(b)))
    ).as_matrix()
