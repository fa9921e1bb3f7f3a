"""Forward kinematics: the poses of all links of a robot."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..calibration.exchange.xml_text import rotations
from ..common.arrays import Array
from ..common.errors import CalibrationFormatError
from ..common.findings import did_you_mean, show
from .urdf import ONE_AXIS, Joint, Robot


def link_poses(robot: Robot, positions: Mapping[str, float] | None = None) -> dict[str, Array]:
    """Return the poses ``T_root_link`` (4, 4) of all links, by name.

    A joint that mimics another follows it. A floating or planar joint stays at zero.
    """
    positions = positions or {}
    for name in positions:
        joint = robot.joints.get(name)
        if joint is None:
            raise CalibrationFormatError(f"{robot.file} has no joint {show(name)}{did_you_mean(name, robot.joints)}")
        if joint.type not in ONE_AXIS or joint.mimic:
            why = f"follows {show(joint.mimic)}" if joint.mimic else f"is {joint.type}"
            raise CalibrationFormatError(f"the joint {show(name)} of {robot.file} {why}. Give it no position.")
    carried: dict[str, list[Joint]] = {}
    for joint in robot.joints.values():
        carried.setdefault(joint.parent, []).append(joint)
    poses = {robot.root: np.eye(4)}
    links = [robot.root]
    for link in links:  # grows by the links that it carries
        for joint in carried.get(link, ()):
            poses[joint.child] = poses[link] @ joint_pose(joint, _position(joint, robot, positions))
            links.append(joint.child)
    return poses


def carried(robot: Robot, link: str, positions: Mapping[str, Array]) -> tuple[Array, dict[str, Array]]:
    """Return the poses ``T_root_link`` (n, 4, 4) of one link, and the twists (n, 6) by which joints move it.

    A twist has the velocities of rotation and of the origin of the root [1, m] or [1/m, 1] per radian or metre of the
    joint. A joint that mimics another adds to the twist of that one.
    """
    joints = {joint.child: joint for joint in robot.joints.values()}
    path: list[Joint] = []
    while link in joints:
        path.insert(0, joints[link])
        link = path[0].parent
    count = max((len(values) for values in positions.values()), default=1)
    pose, twists = np.tile(np.eye(4), (count, 1, 1)), dict[str, Array]()
    for joint in path:
        frame = pose @ joint_pose(joint)
        pose = pose @ joint_pose(joint, _position(joint, robot, positions))
        if joint.type not in ONE_AXIS:
            continue
        axis = frame[:, :3, :3] @ np.array(joint.axis)
        turn = np.zeros_like(axis) if joint.type == "prismatic" else axis
        slide = axis if joint.type == "prismatic" else np.cross(frame[:, :3, 3], axis)
        master, factor = followed(joint, robot)
        twists[master] = twists.get(master, 0.0) + factor * np.concatenate((turn, slide), axis=1)
    return pose, twists


def joint_pose(joint: Joint, position: float | Array = 0.0) -> Array:
    """Return the pose (..., 4, 4) of the child of a joint in the frame of its parent, for positions (...)."""
    position = np.asarray(position, float)
    pose = np.zeros((*position.shape, 4, 4))
    pose[...] = np.eye(4)
    pose[..., :3, :3] = turned = rotations(np.array([joint.angles]))[0]
    pose[..., :3, 3] = joint.position
    axis = np.array(joint.axis)
    if joint.type == "prismatic":
        pose[..., :3, 3] += position[..., None] * (turned @ axis)
    elif joint.type in ONE_AXIS:
        pose[..., :3, :3] = turned @ rotation_about(axis, position)
    return pose


def followed(joint: Joint, robot: Robot) -> tuple[str, float]:
    """Return the joint that a joint follows, in the end, and the factor; itself and 1 if it follows none."""
    factor = 1.0
    while joint.mimic is not None:
        factor *= joint.multiplier
        joint = robot.joints[joint.mimic]
    return joint.name, factor


def rotation_about(axis: Array, angle: Array) -> Array:
    """Return rotations about a unit vector by Rodrigues' formula: I + sin(a) K + (1 - cos(a)) K K."""
    cross = np.cross(np.eye(3), axis)  # K, with K p = axis x p
    s, c = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.asarray(np.eye(3) + s * cross + (1 - c) * (cross @ cross))


def _position(joint: Joint, robot: Robot, positions: Mapping[str, Any]) -> Any:
    """Return the position of a joint: its own, or by the joint that it follows."""
    factor, offset = 1.0, 0.0
    while joint.mimic is not None:
        offset += factor * joint.offset
        factor *= joint.multiplier
        joint = robot.joints[joint.mimic]
    return factor * positions.get(joint.name, 0.0) + offset
