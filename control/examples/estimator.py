"""Estimate where the robot is, from joints, inertial unit and skins alone."""

from dataclasses import dataclass, field

import mujoco
import numpy as np
from biped import FEET, START_HEIGHT, Senses, nominal
from shapes import ANKLE_HEIGHT, FORWARD

from skin_calib_addon.runtime import Body, BodyFrame, zero_moment_point
from skin_calib_addon.runtime.poses import pose_from_mujoco
from skin_calib_addon.runtime.wrench import about, turned
from skin_control.walking import GRAVITY

Array = np.ndarray
SOLE_CENTRE = np.array((FORWARD, 0.0, -ANKLE_HEIGHT))  # in the frame of a foot [m]


# Flags of a skin whose readings are not those of now: its contact is not known.
STALE = frozenset({"frozen", "byte_order"})
MIN_WEIGHT = 0.15  # part of the load that a foot carries before it is taken to stand where it is
MIN_LOAD = 5.0  # of a foot with a CoP by the force/torque sensor of its ankle [N]


@dataclass(frozen=True)
class Contact:
    """What the feet feel, by their skins or by the sensors in the ankles."""

    loads: dict[str, float | None]  # on each foot [N]; None if it is not known
    cops: dict[str, Array | None]  # (2,) of each foot from the centre of its sole, along its axes [m]
    zmp: Array | None  # (2,) of both feet in the world [m]
    moments: dict[str, float] = field(default_factory=dict)  # at the ankles, by their sensors alone [N m]


@dataclass(frozen=True)
class State:
    """The robot in the world, estimated."""

    time: float  # [s]
    com: Array  # (3,) [m]
    com_velocity: Array  # (3,) [m/s]
    com_in_pelvis: Array  # (3,) in the frame of the pelvis, which has no noise of the inertial unit [m]
    feet: dict[str, Array]  # pose (4, 4) of each foot
    soles: dict[str, Array]  # (3,) centre of each sole [m]
    frame: BodyFrame  # of the skins
    skin: Contact
    ankle: Contact
    felt: Contact  # the one of these two that is used


class Estimator:
    """Position of the pelvis from the feet that stand, each of which has an anchor in the world.

    Parameters
    ----------
    body : Body
        The skins.
    source : str
        ``"skin"`` or ``"ankle"``: what feels the contact.
    heeds : bool
        Whether the flags of the skins count. If not, missing readings are no load, and old ones are used.
    """

    def __init__(self, body: Body, source: str = "skin", heeds: bool = True):
        self.body, self.source, self.heeds, self.model = body, source, heeds, nominal()
        self.data = mujoco.MjData(self.model)
        self.mass = float(self.model.body_subtreemass[0])
        self.data.qpos[2] = START_HEIGHT
        self._feet = {foot: self.model.body(f"{foot}_foot").id for foot in FEET}
        self._weights = dict.fromkeys(FEET, 0.5)
        self.anchors: dict[str, Array] | None = None

    def update(self, senses: Senses) -> State:
        """Return the state after one cycle."""
        model, data = self.model, self.data
        data.qpos[:3] = 0
        mujoco.mju_mat2Quat(data.qpos[3:7], senses.rotation.ravel())
        data.qpos[7:] = senses.joints
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        if self.anchors is None:  # the robot stands on flat ground
            low = min(self._sole(foot)[2] for foot in FEET)
            self.anchors = {foot: self._sole(foot) - (0, 0, low) for foot in FEET}
        pelvis = sum(self._weights[foot] * (self.anchors[foot] - self._sole(foot)) for foot in FEET)
        data.qpos[:3] = pelvis
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        velocity = np.concatenate((np.zeros(3), senses.gyro, senses.velocities))
        jacobian = np.zeros((3, model.nv))
        for foot in FEET:
            mujoco.mj_jac(model, data, jacobian, None, self._sole(foot), self._feet[foot])
            velocity[:3] -= self._weights[foot] * jacobian[:, 3:] @ np.concatenate((senses.gyro, senses.velocities))
        mujoco.mj_jacSubtreeCom(model, data, jacobian, 0)
        poses = {f"{f}_foot": pose_from_mujoco(data.xpos[k], data.xmat[k]) for f, k in self._feet.items()}
        frame = self.body.update(senses.readings, senses.time, poses)
        skin, ankle = self._by_skin(frame), self._by_ankles(senses)
        felt = {"skin": skin, "ankle": ankle}[self.source]
        loads = felt.loads
        total = sum(load or 0.0 for load in loads.values())
        if total > 0.1 * self.mass * GRAVITY and None not in loads.values():
            self._weights = {foot: loads[foot] / total for foot in FEET}
        for foot in FEET:  # a foot that bounces or slides after its landing has no place yet
            if self._weights[foot] < MIN_WEIGHT:
                self.anchors[foot][:2] = self._sole(foot)[:2]
        return State(
            senses.time,
            data.subtree_com[0].copy(),
            jacobian @ velocity,
            senses.rotation.T @ (data.subtree_com[0] - pelvis),
            {foot: poses[f"{foot}_foot"] for foot in FEET},
            {foot: self._sole(foot) for foot in FEET},
            frame,
            skin,
            ankle,
            felt,
        )

    def land(self, foot: str, height: float | None = None) -> None:
        """Anchor a foot where it is now; at a height if one is given [m]."""
        self.anchors[foot] = self._sole(foot)
        if height is not None:
            self.anchors[foot][2] = height

    def gravity_torques(self, forces: dict[str, tuple[Array, Array]]) -> Array:
        """Return the torques (j,) of all joints that hold the robot at rest [N m].

        Parameters
        ----------
        forces : dict of (3,) and (3,) arrays
            For each foot the force on it [N] and its point in the world [m].
        """
        bias, jacobian = np.zeros(self.model.nv), np.zeros((3, self.model.nv))
        self.data.qvel[:] = 0
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_rne(self.model, self.data, 0, bias)
        for foot, (force, point) in forces.items():
            mujoco.mj_jac(self.model, self.data, jacobian, None, point, self._feet[foot])
            bias -= jacobian.T @ force
        return bias[6:]

    def _sole(self, foot: str) -> Array:
        k = self._feet[foot]
        return self.data.xpos[k] + self.data.xmat[k].reshape(3, 3) @ SOLE_CENTRE

    def _by_skin(self, frame: BodyFrame) -> Contact:
        loads: dict[str, float | None] = {}
        cops: dict[str, Array | None] = {}
        for foot in FEET:
            link = f"{foot}_foot"
            loads[foot], cops[foot] = None if self.heeds else 0.0, None
            if link not in frame.links or link in frame.lost or (self.heeds and frame.links[link].flags & STALE):
                continue
            sole = frame.links[link]
            loads[foot] = max(sole.load, 0.0) if sole.stands else 0.0
            if sole.cop is not None and sole.ground is not None:
                cops[foot] = (sole.ground.plane.spatial(sole.cop[None])[0] - SOLE_CENTRE)[:2]
        return Contact(loads, cops, None if None in loads.values() else frame.zmp)

    def _by_ankles(self, senses: Senses) -> Contact:
        """Return the contact by the force/torque sensors: what the ground applies, without the weight of the foot."""
        loads: dict[str, float | None] = {}
        cops: dict[str, Array | None] = {}
        moments: dict[str, float] = {}
        total = np.zeros(6)
        for foot, wrench in ground_wrenches(self.model, self.data, self._feet, senses.ankles).items():
            k = self._feet[foot]
            total += about(wrench, -self.data.xpos[k])
            loads[foot], cops[foot] = max(float(wrench[2]), 0.0), None
            moments[foot] = float(np.linalg.norm(wrench[3:]))
            if wrench[2] > MIN_LOAD:
                cops[foot] = zero_moment_point(about(turned(wrench, self.data.xmat[k].reshape(3, 3).T), SOLE_CENTRE))
        return Contact(loads, cops, zero_moment_point(total) if total[2] > MIN_LOAD else None, moments)


def ground_wrenches(
    model: mujoco.MjModel, data: mujoco.MjData, feet: dict[str, int], ankles: dict[str, Array]
) -> dict[str, Array]:
    """Return the wrench (6,) of the ground on each foot about its ankle, along the axes of the world [N, N m].

    Parameters
    ----------
    model, data : MjModel, MjData
        With the poses of the feet.
    feet : dict of int
        The bodies of the feet.
    ankles : dict of (6,) arrays
        Wrench of each foot on its leg about the ankle, in the frame of the foot: that of the ground less the weight of
        the foot [N, N m].
    """
    found = {}
    for foot, k in feet.items():
        weight = np.array((0, 0, model.body_mass[k] * GRAVITY, 0, 0, 0))
        measured = turned(ankles[foot], data.xmat[k].reshape(3, 3))
        found[foot] = measured + about(weight, data.xpos[k] - data.xipos[k])
    return found
