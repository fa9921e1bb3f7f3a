"""Make poses (4, 4) ``T_world_link`` from those of other libraries, and check them."""

from typing import Any

import numpy as np

from ..common.arrays import Array

# [1] Largest error of a rotation matrix: of a scalar product of two axes, or of the square of a length. Larger: forces
# are wrong by that fraction; smaller: poses in single precision are refused.
MAX_ROTATION_ERROR = 1e-4


def pose_from_se3(placement: Any) -> Array:
    """Return the pose of an ``SE3`` object of pinocchio, such as ``data.oMf[frame_id]``.

    Parameters
    ----------
    placement : object
        With ``rotation`` (3, 3) and ``translation`` (3,) [m] of the link in the world.
    """
    return _pose(placement.rotation, placement.translation)


def pose_from_mujoco(xpos: Any, xmat: Any) -> Array:
    """Return the pose of a body, site or geom of MuJoCo: ``data.xpos[k], data.xmat[k]``.

    Parameters
    ----------
    xpos : array, shape (3,)
        Position in the world [m].
    xmat : array, shape (9,) or (3, 3)
        Rotation from the body to the world, row by row.
    """
    return _pose(np.reshape(xmat, (3, 3)), xpos)


def pose_from_quaternion(position: Any, quaternion: Any, order: str) -> Array:
    """Return the pose of a position and a unit quaternion.

    Parameters
    ----------
    position : array, shape (3,)
        Of the link in the world [m].
    quaternion : array, shape (4,)
        Rotation from the link to the world; it is normalized.
    order : str
        ``"xyzw"`` (ROS, pinocchio, SciPy) or ``"wxyz"`` (MuJoCo, Eigen's constructor).

    Raises
    ------
    ValueError
        If the order is another one, or the quaternion is zero or not finite.
    """
    if order not in ("xyzw", "wxyz"):
        raise ValueError(f"the order of a quaternion must be 'xyzw' or 'wxyz', not {order!r}")
    q = np.array(quaternion, float)
    length = float(np.linalg.norm(q))
    if q.shape != (4,) or not np.isfinite(length) or length == 0:
        raise ValueError(f"a quaternion must be four finite numbers that are not all zero, not {quaternion}")
    x, y, z, w = q / length if order == "xyzw" else np.roll(q, -1) / length
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    return _pose(rotation, position)


def checked_pose(given: Any) -> tuple[Array | None, str | None]:
    """Return a pose (4, 4), or None with the flag of the problem.

    ``no_pose``: not a matrix of finite numbers. ``wrong_pose``: the matrix scales, mirrors, shears or projects, so that
    forces and lengths would be wrong.

    Parameters
    ----------
    given : array, shape (4, 4)
        ``T_world_link``.
    """
    try:
        pose = np.array(given, float)
    except (TypeError, ValueError):
        return None, "no_pose"
    if pose.shape != (4, 4) or not np.isfinite(pose).all():
        return None, "no_pose"
    rotation = pose[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        errors = np.abs(rotation @ rotation.T - np.eye(3)).max(), np.abs(pose[3] - (0, 0, 0, 1)).max()
    is_rigid = max(errors) <= MAX_ROTATION_ERROR and np.linalg.det(rotation) > 0
    return (pose, None) if is_rigid else (None, "wrong_pose")


def _pose(rotation: Any, position: Any) -> Array:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position
    return pose
