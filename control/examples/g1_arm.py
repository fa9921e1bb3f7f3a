"""The right arm of a Unitree G1 yields and shrinks back by what its skin feels (thesis 3.2 to 3.4).

    python control/examples/g1_arm.py [--urdf g1_29dof_rev_1_0.urdf] [--seeds 20]

The controller and the experiments are those of ``arm.py``: a contact that moves inward, a small and a large probe with
the same force, their pain, an obstacle that comes near, and something hot. In another one contacts of the upper arm and
of the elbow move inward at the same time. ``skin-calib fit --propose`` covers both links; the cells of the elbow
measure distances, too. The pelvis is held.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from arm import (
    JOINTS,
    PROBE_DAMPING,
    PROBE_MASS,
    PROBES,
    RADIUS,
    SEVEN,
    SMALL,
    Arm,
    Case,
    Result,
    Robot,
    balls_of,
    draw,
    film,
    numbers,
)
from arm import TITLES as ARM_TITLES
from arm import VARIANTS as ARM_VARIANTS
from arm import run as run_arm
from biped import COUNTS, FULL_SCALE, TERRAIN_GROUP, mujoco, round_pads
from experiment import OUT, arguments, report, run_all
from g1 import BOX_COLOUR, DAMPING, STIFFNESS, URDF, propose, skeleton, with_g1, with_proximity

from skin_calib_addon.calibration import Response, load_calibration
from skin_calib_addon.calibration.exchange.mjcf import write_mjcf

LINK, UPPER, HAND = "right_elbow_link", "right_shoulder_yaw_link", "right_wrist_yaw_link"
COVERED = (LINK, UPPER)
PREFIX = "g1/"  # of the names in the simulated model
HAND_AT = (0.1, 0.0, 0.0)  # in its link [m]
START = np.array((0.2, -0.3, 0.0, 0.4, 0.0, 0.0, 0.0))  # [rad]
ARM_STIFFNESS = 200.0  # of the servos of the arm, as in arm.py [N m/rad]
FRICTION = 0.7  # of skin and probes
SPACING = 0.014  # of the balls of the large probe, that of the boards [m]
AREA = 3.3e-4  # xi, of which arm.py has 2.5 cells; here these are two [m^2]
VARIANTS = ARM_VARIANTS | {"links": ("stiff", "one link", "yields")}
TITLES = ARM_TITLES | {
    "contacts": "a contact moves 6 cm inward",
    "links": "contacts of elbow and upper arm, each moves 6 cm inward",
}
Array = np.ndarray


@dataclass(frozen=True)
class G1Case(Case):
    """One run."""

    urdf: Path = URDF
    folder: Path = OUT / "g1_arm"  # of the calibrations
    is_shown: bool = False  # with the meshes of the robot, for an animation


class G1Arm(Arm):
    """The right arm of the G1."""

    azimuth = 150.0  # of an animation [degree]

    def load(self, case: G1Case) -> Robot:
        """Return the robot with the probe of a case."""
        loaded = (load_calibration(case.folder / f"{link}.calibration.json") for link in COVERED)
        # A proposal knows no response: its readings would be forces [N]. Those of the simulated arm are counts.
        first, *others = (replace(one, response=Response((0.0, FULL_SCALE / COUNTS))) for one in loaded)
        ids = [str(id) for patch in first.patches for id in patch.taxels.ids]
        # The skin of the upper arm is there only if it is touched: its sensors take time.
        calibrations = (with_proximity(first, ids), *(others if case.kind == "links" else ()))
        spec, known = self._skeleton(case.urdf, case.is_shown), self._skeleton(case.urdf).compile()
        for calibration in calibrations:
            link = calibration.link
            skin = mujoco.MjSpec.from_string(write_mjcf(calibration).decode())
            for sensor in list(skin.sensors):
                if sensor.type == mujoco.mjtSensor.mjSENS_TACTILE:
                    skin.delete(sensor)
            round_pads(skin, calibration, FRICTION)
            for geom in skin.body(link).geoms:
                geom.contype, geom.conaffinity = 1, 2  # cells touch the probe, not each other
            for geom in spec.body(link).geoms:
                geom.rgba[3] = 0.3  # the pads below the taxels are in the mesh
            spec.body(link).add_frame().attach_body(skin.body(link), f"{link}/", "")
        for joint in spec.joints:
            if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
                servo = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
                stiffness = ARM_STIFFNESS if joint.name in self._arm(known) else STIFFNESS
                servo.set_to_position(kp=stiffness, kv=stiffness * DAMPING / STIFFNESS)
        for joint in list(spec.body("pelvis").joints):
            spec.delete(joint)
        world = mujoco.MjSpec()  # with the probe first: its joint is then the first one, as in arm.py
        world.option = spec.option
        balls = balls_of(case)
        slide = {"type": mujoco.mjtJoint.mjJNT_SLIDE, "axis": [0, 0, 1], "damping": PROBE_DAMPING / balls}
        size = [RADIUS.get(case.kind, SMALL), 0, 0]
        shape = {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": size, "mass": PROBE_MASS / balls, "rgba": BOX_COLOUR}
        touch = {"group": TERRAIN_GROUP, "contype": 2, "conaffinity": 1, "condim": 3, "solref": [0.008, 1]}
        for k in range({**PROBES, "contacts": 1}.get(case.kind, balls)):
            probe = world.worldbody.add_body(name=f"probe{k}", gravcomp=1)
            probe.add_joint(name=f"probe{k}", **slide)
            probe.add_geom(**shape, **touch)
        world.worldbody.add_frame().attach_body(spec.body("pelvis"), PREFIX, "")
        return Robot(world.compile(), known, calibrations, START, PREFIX, AREA)

    @staticmethod
    def _skeleton(urdf: Path, is_shown: bool = False) -> mujoco.MjSpec:
        spec = skeleton(urdf, is_shown)
        spec.body(HAND).add_site(name="hand", pos=HAND_AT)
        return spec

    @staticmethod
    def _arm(model: mujoco.MjModel) -> set[str]:
        return {model.joint(k).name for k in range(model.njnt - JOINTS, model.njnt)}

    def places(self, turn: Array, jitter: Array) -> list[tuple[Array, Array]]:
        """As those of :class:`arm.Arm`; the probes come from outside, the second one to the upper arm."""
        directions = (np.array((0.0, -1.0, by)) for by in turn)
        return [self.surface(*place) for place in zip((0.05, 0.1) + jitter, directions, self.skins)]

    @property
    def cushion(self) -> Array:
        """Places (7, 3) of the balls of a large probe; z inward [m]."""
        return np.column_stack((SPACING * SEVEN, np.zeros(len(SEVEN))))

    @property
    def axis(self) -> Array:
        """The direction (3,) from the elbow to the hand."""
        return self.data.body(PREFIX + LINK).xmat.reshape(3, 3)[:, 0]

    def surface(self, distance: float, direction: Array, link: str = LINK) -> tuple[Array, Array]:
        """Return the taxel on the side of a direction that is nearest to a distance along its link, and a vector.

        Parameters
        ----------
        distance : float
            From the joint of the link, along the forearm or down the upper arm [m].
        direction : array, shape (3,)
            From which a probe comes.
        link : str
            The link.
        """
        body = self.data.body(PREFIX + link)
        sites = [self.model.site(f"{PREFIX}{link}/{id}").id for id in self.skins[link].ids]
        places, facing = self.data.site_xpos[sites], self.data.site_xmat[sites].reshape(-1, 3, 3)[:, :, 2] @ direction
        along = (places - body.xpos) @ (self.axis if link == LINK else -body.xmat.reshape(3, 3)[:, 2])
        point = places[np.where(facing > 0.7, np.abs(along - distance), np.inf).argmin()]
        outward = direction - (direction @ self.axis) * self.axis
        return point, outward / np.linalg.norm(outward)

    def gap(self) -> float:
        """Return the distance between the probe and the nearest taxel [m]."""
        away = np.linalg.norm(self.data.site_xpos[self._sites] - self.probe(0), axis=1)
        return float(away.min() - RADIUS.get(self.case.kind, SMALL))

    @property
    def centre(self) -> Array:
        """Where an animation looks (3,) [m]."""
        return self.data.body(PREFIX + LINK).xpos


def run(case: G1Case, each: Callable[[Arm], None] | None = None) -> Result:
    """Return what happens in a case."""
    return run_arm(case, each, kind=G1Arm)


def main() -> None:
    """Run all cases; print a table; draw."""
    given = with_g1(arguments(__doc__), (*COVERED, HAND)).parse_args()
    folder = given.out / "g1_arm"
    propose(given.urdf, folder, COVERED)
    kinds = [(kind, variant) for kind, variants in VARIANTS.items() for variant in variants]
    seeds = range(given.seeds)
    cases = {kind: [G1Case(*kind, seed, urdf=given.urdf, folder=folder) for seed in seeds] for kind in kinds}
    results = run_all(run, cases, given)
    rows = [(TITLES[kind], variant, numbers(kind, runs)) for (kind, variant), runs in results.items()]
    report(given, ("experiment", "controller", "result"), rows)
    draw(results, given.out / "g1_arm.png", TITLES)
    if not given.no_animation:
        shown = [
            G1Case("heat", variant, 0, urdf=given.urdf, folder=folder, is_shown=True)
            for variant in ("hand only", "first")
        ]
        film([lambda each, case=case: run(case, each) for case in shown], given.out / "g1_arm.gif")


if __name__ == "__main__":
    main()
