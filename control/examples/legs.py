"""Solve the inverse kinematics of the legs in closed form."""

import numpy as np
from biped import FEET, HIP_DROP, HIP_WIDTH, SHANK, SIDE, THIGH

Array = np.ndarray
MAX_EXTENSION = (
    0.9995  # of a leg, relative to its length. Larger: the knee moves faster when the leg is nearly straight.
)


def rotation(axis: int, angle: float) -> Array:
    """Return the rotation (3, 3) about a coordinate axis by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    turn, (a, b) = np.eye(3), ((1, 2), (2, 0), (0, 1))[axis]
    turn[a, a], turn[a, b], turn[b, a], turn[b, b] = c, -s, s, c
    return turn


def leg_angles(side: str, position: Array, turn: Array) -> Array:
    r"""Return the six angles of a leg: yaw, roll and pitch of the hip, knee, pitch and roll of the ankle [rad].

    The axes of the hip intersect, those of the ankle too, so that

    .. math::
        R = R_z(q_1) R_x(q_2) R_y(q_3 + q_4 + q_5) R_x(q_6)

    A foot out of range is brought nearer along its line to the hip.

    Parameters
    ----------
    side : str
        ``left`` or ``right``.
    position : array, shape (3,)
        Of the ankle in the frame of the pelvis [m].
    turn : array, shape (3, 3)
        :math:`R`, of the foot in the frame of the pelvis.
    """
    hip = turn.T @ (np.array((0.0, SIDE[side] * HIP_WIDTH, -HIP_DROP)) - position)  # seen from the foot
    length = np.linalg.norm(hip)
    longest = MAX_EXTENSION * (THIGH + SHANK)
    if length > longest:
        hip, length = hip * longest / length, longest
    knee = np.pi - np.arccos((THIGH**2 + SHANK**2 - length**2) / (2 * THIGH * SHANK))
    lean = np.arcsin(THIGH * np.sin(knee) / length)  # of the shank from the line to the hip
    ankle_roll = np.arctan2(hip[1], hip[2])
    ankle_pitch = -np.arctan2(hip[0], np.hypot(hip[1], hip[2])) - lean
    rest = turn @ rotation(0, -ankle_roll) @ rotation(1, -knee - ankle_pitch)
    yaw = np.arctan2(-rest[0, 1], rest[1, 1])
    roll = np.arctan2(rest[2, 1], np.hypot(rest[0, 1], rest[1, 1]))
    pitch = np.arctan2(-rest[2, 0], rest[2, 2])
    return np.array((yaw, roll, pitch, knee, ankle_pitch, ankle_roll))


def joint_angles(pelvis: Array, pelvis_turn: Array, feet: dict[str, tuple[Array, Array]]) -> Array:
    """Return the angles (12,) of both legs for a position and rotation of the pelvis and of each foot in the world."""
    return np.concatenate(
        [leg_angles(s, pelvis_turn.T @ (feet[s][0] - pelvis), pelvis_turn.T @ feet[s][1]) for s in FEET]
    )
