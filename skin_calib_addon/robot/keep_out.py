"""Find what of a link is covered or touched by other links, somewhere in the ranges of the joints between them.

A ball in front of each point must stay free: it touches the point, and its diameter is the clearance. So faces that
look away from another link stay free, however near it is. Each other link is a field of distances, through which the
balls of a link move in steps as long as their distance. All links together also cover what they hide from far away in
each of some poses.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray
from ..common.errors import UnknownLink
from ..common.findings import did_you_mean, show
from ..geometry.components import components
from ..geometry.mesh.distance_field import DistanceField
from ..geometry.mesh.face_points import sample_faces
from ..geometry.mesh.triangle_mesh import TriangleMesh, stacked
from ..geometry.mesh.visibility import HIDING_HEIGHT, MIN_OPEN, DepthBuffers, point_distance
from .kinematics import joint_pose, link_poses
from .link_mesh import shapes_of
from .urdf import ONE_AXIS, Joint, Robot

# [m] height above a face that other links leave free: a skin 5 to 7 mm thick, with its cover, and 3 to 5 mm of play.
# Larger: less is free.
CLEARANCE = 10e-3
# [1] moving joints between two links up to which they keep each other free. Larger: links that meet only in rare
# postures count, and it takes longer.
MAX_JOINTS = 2
# [radius of a ball] side of the cells. Larger: faster; distances are less exact by about a fifth of the side.
CELL_SIDE = 0.5

# [m] travel of a prismatic joint to either side; some files write 1e16 for "no limit". Larger: less exact.
MAX_TRAVEL = 1e3

# [1] poses of the robot, spread over the ranges of its joints, in one of which a place must be in the open. More: what
# is open in rare postures only counts as free, and it takes longer.
POSES = 9
# [m] travel of a prismatic joint in these poses. Larger: what is far away has coarse buffers.
MAX_VIEW_TRAVEL = 1.0
# [pixels] width of the buffers, about. Larger: large robots are more exact, and take more memory (60 buffers for each
# pose).
MAX_VIEW_WIDTH = 250
# [pixels of the buffers] height from which on a link hides a part of itself in a pose. Smaller: what it hides counts
# twice, and coarsely.
OWN_HEIGHT = 2.0
HIDDEN = "what hides it in every pose"  # hides a part of a link from most directions

Leg = tuple[Joint, bool]  # a joint on the path from one link to another, and whether the path leads to its child


class KeepOut:
    """What of each link of a robot others cover or touch in the joint ranges; their fields are computed once.

    Other links are those with at most two moving joints between; what is further away counts in the zero pose. Joints
    without limits turn fully; prismatic ones without limits stay at zero. Links behind a floating or planar joint do
    not count. A point is also covered if all links together hide it from most directions, in the zero pose and in
    others. Boxes, cylinders, spheres and capsules cover their own link, too.
    """

    def __init__(self, robot: Robot, meshes: Mapping[str, TriangleMesh], clearance: float = CLEARANCE):
        self.robot, self.meshes, self.radius = robot, meshes, clearance / 2
        self.shapes = shapes_of(robot)
        self.fields: dict[TriangleMesh, DistanceField] = {}

    def __call__(self, link: str, points: Array, normals: Array) -> BoolArray:
        """Return which points (k, 3) are covered or touched by another link, or hidden in every pose."""
        is_covered: BoolArray = self.coverers(link, points, normals) != ""
        return is_covered

    def coverers(self, link: str, points: Array, normals: Array) -> Array:
        """Return what covers each point: a link, nearest joints first, ``HIDDEN``, or an empty text."""
        if link not in self.robot.links:
            raise UnknownLink(f"{self.robot.file} has no link {show(link)}{did_you_mean(link, self.robot.links)}")
        points, normals = np.asarray(points, float), np.asarray(normals, float)
        balls = points + self.radius * normals
        found = np.full(len(balls), "", object)
        for other, mesh, path in self._around(link):
            if mesh is not self.meshes.get(link):
                free = np.flatnonzero(found == "")
                found[free[_Motion(path, self._field(mesh), self.radius).is_met(balls[free])]] = other
        found[found == ""] = self._met_at_home(link, balls[found == ""])
        hidden, links = np.flatnonzero(found == ""), list(self.robot.links)
        can_hide = np.array([self._groups[other] == self._groups[link] for other in links])
        for view in self.views:
            is_open = view.openness(link, links.index(link), can_hide, points[hidden], normals[hidden]) > MIN_OPEN
            hidden = hidden[~is_open]
        found[hidden] = HIDDEN
        return found

    @cached_property
    def _groups(self) -> dict[str, int]:
        """Return a number for each link, the same for those whose poses are known relative to each other."""
        number = {link: k for k, link in enumerate(self.robot.links)}
        joints = [joint for joint in self.robot.joints.values() if joint.type in (*ONE_AXIS, "fixed")]
        ends = np.array([(number[joint.parent], number[joint.child]) for joint in joints], np.int64).reshape(-1, 2)
        return dict(zip(number, components(len(number), ends[:, 0], ends[:, 1]).tolist()))

    @cached_property
    def views(self) -> tuple["_View", ...]:
        """Return what is in front of what in each pose."""
        parts = [(link, mesh) for kind in (self.meshes, self.shapes) for link, mesh in kind.items()]
        if not parts:
            return ()
        distance = point_distance(TriangleMesh(*stacked([(mesh.vertices, mesh.faces) for _, mesh in parts])))
        points = [(link, sample_faces(mesh, distance)[0]) for link, mesh in parts]
        number = {link: k for k, link in enumerate(self.robot.links)}
        links = np.repeat([number[link] for link, _ in points], [len(p) for _, p in points])  # the same for all poses
        return tuple(_View.of(points, links, poses, distance) for poses in spread_poses(self.robot, POSES))

    def _around(self, link: str) -> Iterator[tuple[str, TriangleMesh, tuple[Leg, ...]]]:
        """Yield the meshes and shapes of a link and of those around it: name, mesh, and path to its frame."""
        for other, path in ((link, ()), *paths_from(self.robot, link)):
            yield from ((other, parts[other], path) for parts in (self.meshes, self.shapes) if other in parts)

    def _met_at_home(self, link: str, balls: Array) -> Array:
        """Return which link with more joints between meets each ball (k, 3) in the zero pose, or an empty text."""
        found, home = np.full(len(balls), "", object), next(spread_poses(self.robot, 1))
        around = {link, *(other for other, _ in paths_from(self.robot, link))}
        for other, mesh in ((o, m) for parts in (self.meshes, self.shapes) for o, m in parts.items()):
            if other not in around and self._groups[other] == self._groups[link]:
                pose = np.linalg.inv(home[other]) @ home[link]
                found[self._field(mesh)(balls @ pose[:3, :3].T + pose[:3, 3]) < self.radius] = other
        return found

    def _field(self, mesh: TriangleMesh) -> DistanceField:
        if mesh not in self.fields:
            self.fields[mesh] = DistanceField(mesh, CELL_SIDE * self.radius)
        return self.fields[mesh]


def spread_poses(robot: Robot, count: int) -> Iterator[dict[str, Array]]:
    """Yield the poses of all links: as near to zero as the ranges of the joints allow, then random, always the same."""
    turns = {j.name: t for j in robot.joints.values() if j.type in ONE_AXIS and not j.mimic and (t := _turn(j, 1))}
    farthest = {name: MAX_VIEW_TRAVEL if turn.slides else np.inf for name, turn in turns.items()}
    ranges = {k: np.clip((turn.low, turn.high), -farthest[k], farthest[k]).tolist() for k, turn in turns.items()}
    rng = np.random.default_rng(0)
    yield link_poses(robot, {name: float(np.clip(0, *ends)) for name, ends in ranges.items()})
    for _ in range(count - 1):
        yield link_poses(robot, {name: rng.uniform(*ends) for name, ends in ranges.items()})


@dataclass(frozen=True, eq=False)
class _View:
    """What of a robot is in front of what in one pose."""

    poses: Mapping[str, Array]
    buffers: DepthBuffers
    links: IntArray  # numbers of the links of the points of the buffers

    @classmethod
    def of(
        cls, points: Sequence[tuple[str, Array]], links: IntArray, poses: Mapping[str, Array], distance: float
    ) -> "_View":
        """Fill the buffers with the points (k, 3) of all links in their frames [m]."""
        moved = [p @ poses[link][:3, :3].T + poses[link][:3, 3] for link, p in points]
        every = np.concatenate(moved)
        widest = float(np.linalg.norm(np.ptp(every, axis=0)))
        return cls(poses, DepthBuffers.of(every, max(distance, widest / MAX_VIEW_WIDTH)), links)

    def openness(self, link: str, number: int, can_hide: BoolArray, points: Array, normals: Array) -> Array:
        """Return how open the space above points (k, 3) of a link is, shape (k,): 0 is hidden, 1 is free.

        ``number`` is that of the link, ``can_hide`` (links,) is false for links that count as absent.
        """
        pose = self.poses[link]
        height = np.where(can_hide, HIDING_HEIGHT, np.inf)
        height[number] = OWN_HEIGHT * self.buffers.pixel
        least = height[self.links]
        return self.buffers.openness(points @ pose[:3, :3].T + pose[:3, 3], normals @ pose[:3, :3].T, least)[0]


def paths_from(robot: Robot, link: str) -> Iterator[tuple[str, tuple[Leg, ...]]]:
    """Return the links around a link and the joints between, at most two of which move."""
    open_: list[tuple[str, tuple[Leg, ...]]] = [(link, ())]
    for current, path in open_:  # grows
        if path:
            yield current, path
        for joint in robot.joints.values():
            known = path and joint == path[-1][0]
            moving = sum(leg[0].type != "fixed" for leg in path) + (joint.type != "fixed")
            if known or moving > MAX_JOINTS or joint.type not in (*ONE_AXIS, "fixed"):
                continue
            if joint.parent == current:
                open_.append((joint.child, (*path, (joint, True))))
            elif joint.child == current:
                open_.append((joint.parent, (*path, (joint, False))))


@dataclass(frozen=True)
class _Turn:
    """A motion about or along an axis through the origin."""

    axis: Array
    slides: bool
    low: float
    high: float

    def __call__(self, points: Array, position: Array | float) -> Array:
        """Return points (k, 3) moved to one position, or to one for each."""
        q = np.reshape(position, (-1, 1))
        if self.slides:
            return points + q * self.axis
        across = points @ self.product  # formula of Rodrigues
        return points + np.sin(q) * across + (1 - np.cos(q)) * (across @ self.product)

    def arms(self, points: Array) -> Array:
        """Return the lengths of the paths of points (k, 3) per unit of the position, shape (k,)."""
        return np.ones(len(points)) if self.slides else np.linalg.norm(points @ self.product, axis=1)

    @cached_property
    def product(self) -> Array:
        """Return the matrix that gives the cross products of the axis and points: axis x p = p @ matrix."""
        return np.cross(self.axis, np.eye(3))


class _Motion:
    """The motion of points of a link in the frame of another one: constant poses, with turns between them."""

    def __init__(self, path: tuple[Leg, ...], field: DistanceField, radius: float):
        self.field, self.radius = field, radius
        self.poses, self.turns = [np.eye(4)], []
        for joint, to_child in path:
            if to_child:
                self.poses[-1] = _step(joint, to_child) @ self.poses[-1]
            turn = _turn(joint, -1 if to_child else 1)
            if turn:
                self.turns.append(turn)
                self.poses.append(np.eye(4))
            if not to_child:
                self.poses[-1] = _step(joint, to_child) @ self.poses[-1]
        # A ball around all that the other link and the turns after each pose can occupy.
        self.balls = [(field.centre, field.radius + radius)]
        for turn, pose in zip(self.turns[::-1], self.poses[:0:-1]):
            centre, extent = self.balls[0]
            centre = np.linalg.inv(pose)[:3] @ (*centre, 1)
            if turn.slides:
                pivot, more = centre - (turn.low + turn.high) / 2 * turn.axis, (turn.high - turn.low) / 2
            else:
                pivot = centre @ turn.axis * turn.axis
                more = float(np.linalg.norm(centre - pivot))
            self.balls.insert(0, (pivot, extent + more))

    def is_met(self, points: Array, turn: int = 0) -> BoolArray:
        """Return which balls around points (k, 3), in the frame before a turn, meet the other link."""
        points = points @ self.poses[turn][:3, :3].T + self.poses[turn][:3, 3]
        centre, extent = self.balls[turn]
        met = np.zeros(len(points), bool)
        near = np.flatnonzero(np.linalg.norm(points - centre, axis=1) < extent)
        if len(near) == 0:
            return met
        met[near] = self._advanced(points[near], turn) if turn < len(self.turns) else self._gaps(points[near]) < 0
        return met

    def _gaps(self, points: Array) -> Array:
        """Return the distances of balls around points (k, 3) from the other link, in its frame, shape (k,) [m]."""
        return self.field(points) - self.radius

    def _advanced(self, points: Array, turn: int) -> BoolArray:
        """Return which balls meet the other link during a turn and those after it.

        During the last turn, each ball moves by its distance from the link. Before, it moves by its diameter, or as far
        as it is from all that can meet it.
        """
        move, pose, (centre, extent) = self.turns[turn], self.poses[turn + 1], self.balls[turn + 1]
        is_last = turn == len(self.turns) - 1
        centre = (centre - pose[:3, 3]) @ pose[:3, :3]  # in the frame of the turn
        met, position = np.zeros(len(points), bool), np.full(len(points), move.low, float)
        arms, open_ = np.maximum(move.arms(points), 1e-9), np.arange(len(points))
        while len(open_):
            moved = move(points[open_], position[open_])
            if is_last:
                gap, least = self._gaps(moved @ pose[:3, :3].T + pose[:3, 3]), self.radius
                met[open_] = gap < 0
            else:
                gap, least = np.linalg.norm(moved - centre, axis=1) - extent, 2 * self.radius
                met[open_] = self.is_met(moved, turn + 1)
            ahead = ~met[open_] & (position[open_] < move.high)
            step = np.maximum(gap, least)[ahead] / arms[open_[ahead]]
            open_ = open_[ahead]
            position[open_] = np.minimum(position[open_] + step, move.high)
        return met


def _step(joint: Joint, to_child: bool) -> Array:
    """Return the pose (4, 4) of one link of a joint at zero in the frame of the other one, which comes next."""
    pose = joint_pose(joint)
    return np.linalg.inv(pose) if to_child else pose


def _turn(joint: Joint, sign: int) -> _Turn | None:
    """Return the motion of a joint, or its reverse; None if it does not move."""
    if joint.type == "fixed" or (joint.type == "prismatic" and joint.limits is None):
        return None
    low, high = sorted(sign * limit for limit in joint.limits or (-np.pi, np.pi))
    if joint.type == "prismatic":
        low, high = np.clip((low, high), -MAX_TRAVEL, MAX_TRAVEL).tolist()
    else:
        high = min(high, low + 2 * np.pi)  # more than a turn adds nothing
    return _Turn(np.array(joint.axis), joint.type == "prismatic", low, high)
