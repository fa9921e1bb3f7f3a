"""Feel contacts of a simulated robot: MuJoCo gives the readings of all skins and the forward kinematics.

    python examples/robot_mujoco.py ROBOT_WITH_SKIN.xml CALIBRATIONS [--presses N]

CALIBRATIONS is the folder with ``robot.json``. The model is made by ``skin-calib export CALIBRATIONS --to mjcf -o
ROBOT_WITH_SKIN.xml``. A sphere presses on random taxels. What the runtime computes is compared with the contact of the
simulator. It needs ``pip install mujoco``.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from skin_calib_addon.runtime import Body
from skin_calib_addon.runtime.poses import pose_from_mujoco

RADIUS, DEPTH = 0.004, 0.0003  # of the sphere, and of its press [m]
SPHERE_MASS = 0.5  # [kg]
PERIOD = 0.01  # of the control cycle [s]


@dataclass(frozen=True)
class Press:
    """What one press was, and what the runtime made of it."""

    link: str
    force: float  # of the simulator [N]
    felt: float  # by the runtime, on this link [N]
    elsewhere: float  # by the runtime, on other links [N]
    distance: float  # of the felt position from the simulator's contact [m]


class SimulatedRobot:
    """A simulated robot with the skins of its links, and a sphere that presses on them."""

    def __init__(self, model, calibrations):
        specification = mujoco.MjSpec.from_file(str(model))
        specification.option.gravity = [0, 0, 0]
        sphere = specification.worldbody.add_body(name="sphere")
        sphere.add_freejoint()
        sphere.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0], mass=SPHERE_MASS)
        self.model = specification.compile()
        self.data = mujoco.MjData(self.model)
        self.body = Body.load(calibrations)
        self.start = self.model.jnt_qposadr[self.model.body("sphere").jntadr[0]]
        mujoco.mj_forward(self.model, self.data)

    def place(self, link, taxel):
        """Move the sphere into a taxel, or far away for None, and compute contacts and sensors."""
        if taxel is None:
            self.data.qpos[self.start : self.start + 3] = 10.0
        else:
            site = self.data.site(f"{link}/{taxel}")
            self.data.qpos[self.start : self.start + 3] = site.xpos + (RADIUS - DEPTH) * site.xmat.reshape(3, 3)[:, 2]
        mujoco.mj_forward(self.model, self.data)

    def update(self, time):
        """Return the contacts of all links in the world."""
        readings, poses = {}, {}
        for link, skin in self.body.skins.items():
            forces = [self.data.sensor(f"{link}/{taxel}").data[0] for taxel in skin.ids]
            readings[link] = np.zeros(skin.reading_length)
            readings[link][skin.channels] = forces
            poses[link] = pose_from_mujoco(self.data.body(link).xpos, self.data.body(link).xmat)
        return self.body.update(readings, time, poses)

    def contact(self):
        """Return normal force [N] and position (3,) [m] of the contact of the sphere with the largest force."""
        sphere, best = self.model.body("sphere").id, (0.0, np.zeros(3))
        for k, contact in enumerate(self.data.contact):
            if sphere in self.model.geom_bodyid[contact.geom]:
                force = np.zeros(6)
                mujoco.mj_contactForce(self.model, self.data, k, force)
                best = max(best, (float(force[0]), contact.pos.copy()), key=lambda pair: pair[0])
        return best


def main(model, calibrations, presses=20, seed=0):
    """Print and return the presses."""
    robot, rng = SimulatedRobot(model, calibrations), np.random.default_rng(seed)
    links, found, time = list(robot.body.skins), [], 0.0
    for _ in range(presses):
        link = links[rng.integers(len(links))]
        for taxel in (None, robot.body.skins[link].ids[rng.integers(len(robot.body.skins[link].ids))]):
            robot.place(link, taxel)
            for _ in range(5):
                time += PERIOD
                state = robot.update(time)
        force, position = robot.contact()
        felt = {name: sum(contact.force for contact in frame.contacts) for name, frame in state.links.items()}
        nearest = [state.poses[link] @ (*contact.position, 1) for contact in state.links[link].contacts]
        distance = min((float(np.linalg.norm(place[:3] - position)) for place in nearest), default=np.inf)
        found.append(Press(link, force, felt[link], sum(felt.values()) - felt[link], distance))
        print(f"{link}: {force:.2f} N, felt {felt[link]:.2f} N at {distance * 1e3:.2f} mm from the contact")
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", type=Path)
    parser.add_argument("calibrations", type=Path)
    parser.add_argument("--presses", type=int, default=20)
    given = parser.parse_args()
    main(given.model, given.calibrations, given.presses)
