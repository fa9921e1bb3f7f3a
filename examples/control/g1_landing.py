"""Land softly with a Unitree G1: impacts of its feet with and without proximity sensing in the soles (thesis 4.4.1).

    python examples/control/g1_landing.py [--urdf g1_29dof_rev_1_0.urdf] [--seeds 20] [--steps 4] [--speed 0.4]

The robot and its skin are those of ``g1.py``; the cells below the feet measure distances, too. The robot steps in
place: it shifts its weight to one foot, lifts the other one by 5 cm, and puts it down. The path of a foot, the virtual
springs, and what counts as an impact are those of ``landing.py``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from biped import PERIOD
from experiment import arguments, count, positive, report, run_all, spread, whole
from g1 import FEET, G1, Balancer, Senses, propose, with_g1
from landing import Impact, Judge, draw
from walker import Gait, Proximity, descent, quintic
from zmp_plan import ZmpPlan

from skin_calib_addon.runtime.balance.walking import GRAVITY, com_velocity

LEAD, SHIFT, REST = 0.5, 1.5, 0.5  # before and while the ZMP moves to one foot, and until the other is lifted [s]
COMPLIANT = Proximity(lead=0.17)  # so that the foot does not land later than without
OTHER = dict(zip(FEET, FEET[::-1]))
Array = np.ndarray


@dataclass(frozen=True)
class Case:
    """One run."""

    urdf: Path
    folder: Path  # of the calibrations
    proximity: bool
    steps: int
    speed: float  # of landing without proximity [m/s]
    seed: int


class Stepper(Balancer):
    """Keeps the balance, and steps in place.

    Parameters
    ----------
    robot : G1
    urdf : path
        As for :class:`Balancer`.
    steps : int
        With the right foot first.
    gait : Gait
    compliant : Proximity, optional
        Whether and how the soles slow down before they land.
    """

    def __init__(self, robot: G1, urdf: Path, steps: int, gait: Gait, compliant: Proximity | None):
        super().__init__(robot, urdf, "skin")
        self.gait, self.compliant = gait, compliant
        self.left = [FEET[(k + 1) % 2] for k in range(steps)]  # feet that are still to step
        self.swing_foot: str | None = None
        self.is_done = False  # all steps are made, and the weight is on both feet
        self.ground = float(self.anchors[FEET[0]][2])  # height of a foot that stands [m]
        self.centres = {foot: np.array((*sole.centroid, robot.sole)) for foot, sole in self.soles.items()}
        self._begin(0.0, None)

    def cycle(self, senses: Senses) -> tuple[Array, Array, Array, Array]:
        """As that of :class:`Balancer`, after a part of a step."""
        since = senses.time - self.began
        if self.swing_foot:
            self._swing(self.swing_foot, since)
        else:
            self._shift(since)
            if since > LEAD + SHIFT + REST:
                if self.left:
                    self._begin(senses.time, self.left.pop(0))
                else:
                    self.is_done = True
        commands = super().cycle(senses)
        if self.swing_foot and since > 0.3 * self.gait.single:
            sole = self.frame.links.get(self.swing_foot)
            if sole is not None and sole.load > self.gait.contact:
                self._begin(senses.time, None)
        return commands

    def _begin(self, time: float, foot: str | None) -> None:
        """Begin to swing a foot; to shift the weight if there is none."""
        self.began = time
        if foot is None and self.swing_foot:
            self.anchors[self.swing_foot] = np.array((*self.data.xpos[self.feet[self.swing_foot]][:2], self.ground))
        self.swing_foot = foot
        self.stand_on((OTHER[foot],) if foot else FEET)
        if foot is None:
            feet = (OTHER[self.left[0]],) if self.left else FEET
            target = np.mean([self.anchors[foot][:2] + self.centres[foot][:2] for foot in feet], axis=0)
            points = (self.reference.zmp, self.reference.zmp, target)
            self.plan = ZmpPlan((0.0, LEAD, LEAD + SHIFT), points, self.omega)

    def _shift(self, since: float) -> None:
        self.reference = self.plan.at(since)
        move = com_velocity(self.goal, self.reference.dcm, self.omega) * PERIOD
        self.com, self.goal = self.com + move, self.goal + move

    def _swing(self, foot: str, since: float) -> None:
        gait, compliant = self.gait, self.compliant
        arrival = gait.arrival * gait.single - (compliant.lead if compliant else 0.0)
        half, anchor = 0.45 * arrival, self.anchors[foot].copy()
        if since < half:
            anchor[2] = self.ground + gait.lift * quintic(since / half)
        else:
            speed = descent(since - half, arrival - half, gait.lift, gait.landing_speed)
            if compliant and foot in self.frame.links:
                virtual = compliant.wrench(self.body.skins[foot], self.frame.links[foot], self.centres[foot])
                self.tilts[foot] = self.tilts[foot] + compliant.turning * PERIOD * virtual[3:5]
                speed = compliant.slowed(speed, virtual[2])
            anchor[2] -= speed * PERIOD
        self.anchors[foot] = anchor


def run(case: Case, each: Callable[[G1], None] | None = None) -> tuple[bool, list[Impact]]:
    """Return whether the robot still stands, and the impacts."""
    robot = G1(case.urdf, case.folder, case.seed, case.proximity)
    gait = Gait(landing_speed=case.speed)
    stepper = Stepper(robot, case.urdf, case.steps, gait, COMPLIANT if case.proximity else None)
    judge = Judge(stepper, stepper.centres)
    while robot.stands and not stepper.is_done and robot.data.time < 5 * (case.steps + 1):
        targets, torques, *_ = stepper.cycle(robot.senses())
        robot.step(targets, torques)
        judge(robot)
        if each:
            each(robot)
    return robot.stands and stepper.is_done, judge.impacts


def main() -> None:
    """Run all cases; print a table; draw."""
    parser = with_g1(arguments(__doc__, has_animation=False))
    parser.add_argument("--steps", type=whole, default=4, help="in each run")
    parser.add_argument("--speed", type=positive, default=0.4, help="of landing without proximity [m/s]")
    given = parser.parse_args()
    folder = given.out / "g1"
    propose(given.urdf, folder)
    kinds, seeds = (False, True), range(given.seeds)
    cases = [Case(given.urdf, folder, kind, given.steps, given.speed, seed) for kind in kinds for seed in seeds]
    found = run_all(run, cases, given)
    hard, soft = (found[k * given.seeds : (k + 1) * given.seeds] for k in range(2))
    rows, drawn = [], {}
    for name, runs in (("without", hard), ("with", soft)):
        drawn["flat ground", name == "with"] = impacts = [impact for _, impacts in runs for impact in impacts]
        texts = (
            spread([getattr(i, kind) for i in impacts], n) for kind, n in (("force", 0), ("speed", 2), ("time", 2))
        )
        rows.append((name, count(stands for stands, _ in runs), str(len(impacts)), *texts))
    report(given, ("proximity", "stands", "landings", "impact [N]", "speed [m/s]", "touch-down [s]"), rows)
    off, on = (np.array([i.force for _, impacts in runs for i in impacts]) for runs in (hard, soft))
    weight = float(G1(given.urdf, folder, 0).model.body_subtreemass[0] * GRAVITY)
    print(
        f"with proximity the mean is {on.mean() / off.mean():.0%}, the largest {on.max() / off.max():.0%} of that "
        f"without; without, the mean is {off.mean() / weight:.1f} times the weight of {weight:.0f} N"
    )
    draw(drawn, weight, given.out / "g1_landing.png")


if __name__ == "__main__":
    main()
