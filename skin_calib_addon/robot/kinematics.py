"""Forward kinematics: the poses of all links of a robot."""

from collections.abc import Mapping

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


def joint_pose(joint: Joint, position: float = 0.0) -> Array:
    """Return the pose (4, 4) of the child of a joint in the frame of its parent."""
    pose = np.eye(4)
    pose[:3, :3] = rotations(np.array([joint.angles]))[0]
    pose[:3, 3] = joint.position
    axis = np.array(joint.axis)
    if joint.type == "prismatic":
        pose[:3, 3] += pose[:3, :3] @ (position * axis)
    elif joint.type in ONE_AXIS:
        pose[:3, :3] = pose[:3, :3] @ _rotation(axis, position)
    return pose


def _rotation(axis: Array, angle: float) -> Array:
    """Return the rotation about a unit vector by Rodrigues' formula: I + sin(a) K + (1 - cos(a)) K K."""
    cross = np.cross(np.eye(3), axis)  # K, with K p = axis x p
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)


def _position(joint: Joint, robot: Robot, positions: Mapping[str, float]) -> float:
    """Return the position of a joint: its own, or by the joint that it follows."""
    factor, offset = 1.0, 0.0
    while joint.mimic is not None:
        offset += factor * joint.offset
        factor *= joint.multiplier
        joint = robot.joints[joint.mimic]
    return factor * positions.get(joint.name, 0.0) + offset
