"""Turn the contacts of all skins of a robot into joint torques, with the forward kinematics of pinocchio.

    python examples/robot_pinocchio.py ROBOT.urdf CALIBRATIONS [--cycles N]

CALIBRATIONS is the folder with ``robot.json``, which ``skin-calib fit ROBOT.urdf -o CALIBRATIONS`` writes. The readings
here are those of presses on one link after the other, while all joints move. On a robot, take your own readings and
joint positions. It needs ``pip install pin``.
"""

import argparse
from pathlib import Path

import numpy as np
import pinocchio

from skin_calib_addon.runtime import Body
from skin_calib_addon.runtime.poses import pose_from_se3

PERIOD = 0.01  # of the control cycle [s]


class SkinnedRobot:
    """A model of pinocchio with the skins of its links."""

    def __init__(self, urdf, calibrations):
        self.model = pinocchio.buildModelFromUrdf(str(urdf))
        self.data = self.model.createData()
        self.body = Body.load(calibrations)
        self.frames = {link: self.model.getFrameId(link) for link in self.body.skins}

    def update(self, positions, readings, time):
        """Return the contacts of all links, in the world, at joint positions (nq,)."""
        pinocchio.computeJointJacobians(self.model, self.data, positions)
        pinocchio.updateFramePlacements(self.model, self.data)
        poses = {link: pose_from_se3(self.data.oMf[frame]) for link, frame in self.frames.items()}
        return self.body.update(readings, time, poses)

    def torques(self, state):
        """Return the joint torques (nv,) [N m] of all contacts; those that hold the robot still are their negative."""
        total = np.zeros(self.model.nv)
        for link, frame in state.links.items():
            jacobian = pinocchio.getFrameJacobian(self.model, self.data, self.frames[link], pinocchio.LOCAL)
            total += jacobian.T @ frame.wrench  # both about the origin of the link, along its axes
        return total


def main(urdf, calibrations, cycles=100):
    """Print what each press does; return the last state, its joint positions and its torques."""
    robot = SkinnedRobot(urdf, calibrations)
    links = list(robot.body.skins)
    for cycle in range(cycles):
        time = cycle * PERIOD
        positions = pinocchio.neutral(robot.model)
        if robot.model.nq == robot.model.nv:  # all joints have one number
            positions = 0.2 * np.sin(2 * np.pi * time + np.arange(robot.model.nq))
        readings = {link: np.zeros(skin.reading_length) for link, skin in robot.body.skins.items()}
        pressed = links[cycle // 10 % len(links)]
        readings[pressed][robot.body.skins[pressed].channels[0]] = 5 * min(cycle % 10, 4) / 4
        state = robot.update(positions, readings, time)
        torques = robot.torques(state)
        if cycle % 10 == 9:
            contacts = state.links[pressed].contacts
            force = sum(contact.force for contact in contacts)
            print(f"{time:.2f} s: {pressed} feels {force:.2f} N, largest joint torque {np.abs(torques).max():.3f} N m")
    return state, positions, torques


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("urdf", type=Path)
    parser.add_argument("calibrations", type=Path)
    parser.add_argument("--cycles", type=int, default=100)
    given = parser.parse_args()
    main(given.urdf, given.calibrations, given.cycles)
