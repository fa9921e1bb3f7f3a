"""Press taxels of a robot in MuJoCo: which sensors report each press.

    python benchmarks/presses.py FOLDER [--presses 200] [--seed 0]

FOLDER has the calibrations and ``robot.json``. A sphere touches the skin of the whole robot in its zero pose, without
gravity, 0.3 mm deep along the normal. There are two measures:

1. At the centre of a taxel: right if the sensor of this taxel reports the press, and no other sensor of the robot.
2. At a random point of its cell: right if its sensor reports the press, and all others that do are neighbours of it.
   The edge of a cell is also that of its neighbours, and the sphere touches what it overlaps.
"""

import argparse
import contextlib
import io
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from skin_calib_addon.calibration.robot_set import load_links  # noqa: E402
from skin_calib_addon.cli import main as skin_calib  # noqa: E402

RADIUS = 0.004  # [m] of the sphere
DEPTH = 0.0003  # [m] of the press


@dataclass(frozen=True)
class Presses:
    """Numbers of presses."""

    count: int
    alone: int  # at the centre: only the pressed taxel reports
    wrong: tuple[str, ...]  # at the centre: the others
    at_random: int  # at a random point: it reports, and so do none but its neighbours
    strongest: int  # of these: it, or a neighbour, reports most
    links: int


class PressedRobot:
    """A model of a robot with its skins, and a sphere."""

    def __init__(self, folder: Path):
        with tempfile.TemporaryDirectory() as temporary:
            model = Path(temporary) / "robot.xml"
            with contextlib.redirect_stdout(io.StringIO()):
                code = skin_calib(["export", str(folder), "--to", "mjcf", "-o", str(model)])
            if code and not model.exists():  # it is there if only presses of some links are not felt
                sys.exit(code)
            spec = mujoco.MjSpec.from_file(str(model))
            spec.option.gravity = [0, 0, 0]
            spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_LIMIT  # the zero pose may be beyond a limit
            sphere = spec.worldbody.add_body(name="sphere")
            sphere.add_freejoint()
            sphere.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0], mass=0.1)
            self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.start = self.model.jnt_qposadr[self.model.body("sphere").jntadr[0]]
        self.names, self.links, self.neighbours, self.corners = [], [], [], []
        for link, calibration in load_links(folder)[0].items():
            for patch in calibration.patches:
                taxels = patch.taxels
                first, rows = len(self.names), {name: k for k, name in enumerate(taxels.ids)}
                self.names += [f"{link}/{name}" for name in taxels.ids]
                self.links += [link] * len(taxels.ids)  # names and ids can have slashes
                self.neighbours += [{first + rows[n] for n in row if n in rows} for row in taxels.neighbours]
                self.corners += list(taxels.corners_link - taxels.positions_link[:, None])
        self.sensors = np.array([self.model.sensor(name).adr[0] for name in self.names])
        mujoco.mj_forward(self.model, self.data)
        self.places = np.array([self.data.site(name).xpos for name in self.names])
        self.normals = np.array([self.data.site(name).xmat.reshape(3, 3)[:, 2] for name in self.names])
        bodies = [self.model.body(link).id for link in self.links]
        self.turns = self.data.xmat[bodies].reshape(-1, 3, 3)  # of the links

    def press(self, row, place):
        """Return the forces (n,) of all touch sensors for a press at a point of a taxel [N]."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self.start : self.start + 3] = place + (RADIUS - DEPTH) * self.normals[row]
        mujoco.mj_forward(self.model, self.data)
        return self.data.sensordata[self.sensors].copy()

    def point_of(self, row, rng):
        """Return a random point of a cell, in its plane."""
        ring = self.corners[row] @ self.turns[row].T
        k, (a, b) = rng.integers(len(ring)), rng.random(2)
        if a + b > 1:
            a, b = 1 - a, 1 - b
        return self.places[row] + a * ring[k] + b * ring[(k + 1) % len(ring)]


def measure(folder: Path, count: int = 200, seed: int = 0) -> Presses:
    """Press random taxels of the whole robot."""
    robot, rng = PressedRobot(folder), np.random.default_rng(seed)
    rows = rng.permutation(len(robot.names))[:count].tolist()
    wrong, at_random, strongest = [], 0, 0
    for row in rows:
        found = np.flatnonzero(robot.press(row, robot.places[row]) > 0).tolist()
        if found != [row]:
            wrong.append(f"{robot.names[row]} ({', '.join(robot.names[k] for k in found) or 'none'})")
        forces = robot.press(row, robot.point_of(row, rng))
        at_random += forces[row] > 0 and set(np.flatnonzero(forces > 0).tolist()) <= {row} | robot.neighbours[row]
        strongest += int(forces.argmax()) in {row} | robot.neighbours[row]
    links = len({robot.links[row] for row in rows})
    return Presses(len(rows), len(rows) - len(wrong), tuple(wrong), int(at_random), int(strongest), links)


def words(found: Presses) -> str:
    """Return the result in words."""
    text = (
        f"{found.count} presses on {found.links} links: at centres {found.alone} right; at random points "
        f"{found.at_random} right, the largest force at the taxel or a neighbour in {found.strongest}"
    )
    return "\n".join((text, *(f"    wrong: {line}" for line in found.wrong[:10])))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--presses", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    print(words(measure(given.folder, given.presses, given.seed)))
