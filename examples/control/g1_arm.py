"""The right arm of a Unitree G1 yields and shrinks back by what its forearm feels (thesis 3.2 to 3.4).

    python examples/control/g1_arm.py [--urdf g1_29dof_rev_1_0.urdf] [--seeds 20]

The controller and three of the experiments are those of ``arm.py``: a contact that moves inward, an obstacle that comes
near, and something hot. ``skin-calib fit --propose`` covers the link of the elbow; its cells measure distances, too.
The pelvis is held.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from arm import BALL, JOINTS, PROBE_DAMPING, PROBE_MASS, Arm, Case, Result, Robot, draw
from arm import run as run_arm
from biped import TERRAIN_GROUP, mujoco, round_pads
from experiment import arguments, count, report, run_all, spread
from g1 import DAMPING, STIFFNESS, propose, skeleton, with_g1, with_proximity

from skin_calib_addon.calibration import load_calibration
from skin_calib_addon.calibration.exchange.mjcf import write_mjcf

LINK, HAND = "right_elbow_link", "right_wrist_yaw_link"
PREFIX = "g1/"  # of the names in the simulated model
HAND_AT = (0.1, 0.0, 0.0)  # in its link [m]
START = np.array((0.2, -0.3, 0.0, 0.4, 0.0, 0.0, 0.0))  # [rad]
ARM_STIFFNESS = 200.0  # of the servos of the arm, as in arm.py [N m/rad]
FRICTION = 0.7  # of skin and probes
ORDERS = ("hand only", "null space", "first")  # of the task that flees
VARIANTS = {"contacts": ("stiff", "yields"), "near": ORDERS, "heat": ORDERS}
RADIUS = {"contacts": 0.02, "near": BALL, "heat": BALL}  # of the probe [m]
NAMES = {
    "contacts": "a contact moves 6 cm inward",
    "near": "an obstacle comes 3 cm into the arm's place",
    "heat": "a burner of 180 °C comes near",
}
Array = np.ndarray


@dataclass(frozen=True)
class G1Case(Case):
    """One run."""

    urdf: Path
    folder: Path  # of the calibration


class G1Arm(Arm):
    """The right arm of the G1."""

    def load(self, case: G1Case) -> Robot:
        """Return the robot with the probe of a case."""
        calibration = load_calibration(case.folder / f"{LINK}.calibration.json")
        ids = [str(id) for patch in calibration.patches for id in patch.taxels.ids]
        calibration = with_proximity(calibration, ids)
        spec = self._skeleton(case.urdf)
        known = spec.compile()
        skin = mujoco.MjSpec.from_string(write_mjcf(calibration).decode())
        for sensor in list(skin.sensors):
            if sensor.type == mujoco.mjtSensor.mjSENS_TACTILE:
                skin.delete(sensor)
        round_pads(skin, calibration, FRICTION)
        for geom in skin.body(LINK).geoms:
            geom.contype, geom.conaffinity = 1, 2  # cells touch the probe, not each other
        spec.body(LINK).add_frame().attach_body(skin.body(LINK), f"{LINK}/", "")
        for joint in spec.joints:
            if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
                servo = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
                stiffness = ARM_STIFFNESS if joint.name in self._arm(known) else STIFFNESS
                servo.set_to_position(kp=stiffness, kv=stiffness * DAMPING / STIFFNESS)
        for joint in list(spec.body("pelvis").joints):
            spec.delete(joint)
        world = mujoco.MjSpec()  # with the probe first: its joint is then the first one, as in arm.py
        world.option = spec.option
        probe = world.worldbody.add_body(name="probe0", gravcomp=1)
        slide = {"type": mujoco.mjtJoint.mjJNT_SLIDE, "axis": [0, 0, 1], "damping": PROBE_DAMPING}
        probe.add_joint(name="probe0", **slide)
        shape = {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": [RADIUS[case.kind], 0, 0], "mass": PROBE_MASS}
        probe.add_geom(**shape, group=TERRAIN_GROUP, contype=2, conaffinity=1, condim=3, solref=[0.008, 1])
        world.worldbody.add_frame().attach_body(spec.body("pelvis"), PREFIX, "")
        return Robot(world.compile(), known, calibration, LINK, START, PREFIX)

    @staticmethod
    def _skeleton(urdf: Path) -> mujoco.MjSpec:
        spec = skeleton(urdf)
        spec.body(HAND).add_site(name="hand", pos=HAND_AT)
        return spec

    @staticmethod
    def _arm(model: mujoco.MjModel) -> set[str]:
        return {model.joint(k).name for k in range(model.njnt - JOINTS, model.njnt)}

    def places(self, kind: str, turn: Array) -> list[tuple[float, Array]]:
        """Return the distance of the probe from the elbow [m], and the direction (3,) from which it comes: outside."""
        return [(0.05, np.array((0.0, -1.0, turn[0])))]

    @property
    def axis(self) -> Array:
        """The direction (3,) from the elbow to the hand."""
        return self.data.body(PREFIX + LINK).xmat.reshape(3, 3)[:, 0]

    def surface(self, distance: float, direction: Array) -> tuple[Array, Array]:
        """Return the taxel on the side of a direction that is nearest to a distance from the elbow, and a normal."""
        places = self.data.site_xpos[self._sites]
        facing = self.data.site_xmat[self._sites].reshape(-1, 3, 3)[:, :, 2] @ direction
        along = (places - self.data.body(PREFIX + LINK).xpos) @ self.axis
        point = places[np.where(facing > 0.7, np.abs(along - distance), np.inf).argmin()]
        outward = direction - (direction @ self.axis) * self.axis
        return point, outward / np.linalg.norm(outward)

    def gap(self) -> float:
        """Return the distance between the probe and the nearest taxel [m]."""
        away = np.linalg.norm(self.data.site_xpos[self._sites] - self.probe(0), axis=1)
        return float(away.min() - RADIUS[self.case.kind])


def run(case: G1Case) -> Result:
    """Return what happens in a case."""
    return run_arm(case, kind=G1Arm)


def main() -> None:
    """Run all cases; print a table; draw."""
    given = with_g1(arguments(__doc__, has_animation=False), (LINK, HAND)).parse_args()
    folder = given.out / "g1_arm"
    propose(given.urdf, folder, (LINK,))
    kinds = [(kind, variant) for kind, variants in VARIANTS.items() for variant in variants]
    cases = [G1Case(*kind, seed, given.urdf, folder) for kind in kinds for seed in range(given.seeds)]
    found = run_all(run, cases, given)
    rows = []
    results = {kind: found[k * given.seeds : (k + 1) * given.seeds] for k, kind in enumerate(kinds)}
    for (kind, variant), runs in results.items():
        texts = (
            count(r["force"].max() > 0 for r in runs),
            spread([r["force"].max() for r in runs]),
            spread([1e3 * r["gap"].min() for r in runs]),
            spread([1e3 * r["hand"].max() for r in runs]),
            spread((r["heat"].max() for r in runs), 1) if kind == "heat" else "",
        )
        rows.append((f"{NAMES[kind]}: {variant}", *texts))
    heads = ("experiment", "contact", "peak force [N]", "smallest distance [mm]", "hand moves [mm]", "hottest [°C]")
    report(given, heads, rows)
    draw(results, given.out / "g1_arm.png", NAMES)


if __name__ == "__main__":
    main()
