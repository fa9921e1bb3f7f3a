"""Find links of a robot that are mirror images of others, or equal to them, so that they can have the same work.

Neither files nor numbers of faces agree between left and right. The kinematics gives the plane of symmetry, and from it
the one reflection that can take a link to another; points of the meshes decide.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..common.arrays import Array, freeze
from ..geometry.mesh.distance import closest
from ..geometry.mesh.face_points import sample_faces
from ..geometry.mesh.triangle_mesh import TriangleMesh
from .kinematics import link_poses
from .urdf import Robot

# [m] mean distance of the points of a link from the faces of the mirrored one below which it is its twin. Larger: links
# that differ count as twins; smaller: links whose meshes were reduced to fewer faces do not.
MIRRORED_DISTANCE = 5e-4
# [m] the same without a reflection. Larger: parts of different lengths count as equal.
EQUAL_DISTANCE = 1e-4
# [1] points of a mesh that are compared. Larger: smaller differences are found, and it takes longer.
COMPARED_POINTS = 400
# [radius of gyration] differences of this radius and of the centroids above which meshes are not compared. It affects
# the time only.
SIZE_TOLERANCE = 0.1
# [m] distance of a link from the mirror image of another one up to which they are partners. Larger: robots whose zero
# pose is not symmetric still have a plane.
PARTNER_DISTANCE = 5e-3


@dataclass(frozen=True, eq=False)
class Twin:
    """The link that another one is like, and the motion or reflection between them."""

    link: str  # name of the former
    transform: Array  # (4, 4), takes points of the former's link frame to the frame of the twin

    def __post_init__(self):
        freeze(self, transform=(4, 4))

    @property
    def is_mirrored(self) -> bool:
        """Return whether the transform is a reflection."""
        return bool(np.linalg.det(self.transform[:3, :3]) < 0)

    @property
    def words(self) -> str:
        """Return how the twin is like the former, before its name."""
        return "the mirror image of" if self.is_mirrored else "equal to"

    def inverse(self, link: str) -> "Twin":
        """Return how the former is like the twin, which is a link of this name."""
        return Twin(link, np.linalg.inv(self.transform))


def find_twins(robot: Robot, meshes: Mapping[str, TriangleMesh]) -> dict[str, Twin]:
    """Return the links that are like an earlier link, and how.

    A link is like another one if their meshes agree after the reflection about the plane of symmetry of the robot in
    its zero pose: then their neighbours do so, too, as long as the joint ranges do. Without such a partner it is like
    an equal link, of which the mesh agrees in the link frame; its neighbours may differ.
    """
    poses = link_poses(robot)
    links = [link for link in robot.links if link in meshes]
    if not links:
        return {}
    reflection = symmetry(np.array([poses[link][:3, 3] for link in links]).reshape(-1, 3))
    samples = {link: _Sample(meshes[link]) for link in links}
    twins: dict[str, Twin] = {}
    for i, link in enumerate(links):
        across = np.linalg.inv(poses[link]) @ reflection
        mirrored = [(former, across @ poses[former], MIRRORED_DISTANCE) for former in links[:i]]
        equal = [(former, np.eye(4), EQUAL_DISTANCE) for former in links[:i]]
        for former, transform, limit in mirrored + equal:
            if samples[former].distance(samples[link], transform) < limit:
                twins[link] = Twin(former, transform)
                break
    return twins


def symmetry(positions: Array) -> Array:
    """Return the reflection (4, 4) across an axis of the root frame that maps links to links; across y without pairs.

    Of the three, through the root or the median of the links, this is the one that takes most links off the plane to
    another link.
    """
    best, most = np.diag((1.0, -1.0, 1.0, 1.0)), 0
    for axis in (1, 0, 2):
        for plane in (0.0, float(np.median(positions[:, axis]))):
            image = positions.copy()
            image[:, axis] = 2 * plane - image[:, axis]
            gaps = np.linalg.norm(image[:, None] - positions, axis=2).min(axis=1)
            is_off = np.abs(positions[:, axis] - plane) > PARTNER_DISTANCE
            partners = int((is_off & (gaps < PARTNER_DISTANCE)).sum())
            if partners > most:
                best, most = np.eye(4), partners
                best[axis, axis], best[axis, 3] = -1, 2 * plane
    return best


class _Sample:
    """Points of a mesh, its size, and distances from it."""

    def __init__(self, mesh: TriangleMesh):
        points, _, areas = sample_faces(mesh, float(np.sqrt(mesh.face_areas.sum() / COMPARED_POINTS)))
        area = areas.sum()
        # A copy, whose search tree ends with this sample: the trees of all links take hundreds of MB.
        self.mesh, self.middle = replace(mesh), areas @ points / area
        self.gyration = float(np.sqrt(areas @ np.square(points - self.middle).sum(axis=1) / area))
        # Evenly over the area: a mesh can have many points on small faces.
        steps = (np.arange(COMPARED_POINTS) + 0.5) / COMPARED_POINTS
        self.points = points[np.searchsorted(np.cumsum(areas) / area, steps).clip(max=len(points) - 1)]

    def distance(self, other: "_Sample", transform: Array) -> float:
        """Return the mean distance from another mesh after a transform of this one, the larger of both [m].

        It is infinite if the meshes are not near enough to compare them.
        """
        middle = transform[:3, :3] @ self.middle + transform[:3, 3]
        apart = float(np.linalg.norm(middle - other.middle))
        if max(apart, abs(self.gyration - other.gyration)) > SIZE_TOLERANCE * self.gyration:
            return np.inf
        back = np.linalg.inv(transform)
        there = self.points @ transform[:3, :3].T + transform[:3, 3]
        here = other.points @ back[:3, :3].T + back[:3, 3]
        return max(float(closest(other.mesh, there)[0].mean()), float(closest(self.mesh, here)[0].mean()))
