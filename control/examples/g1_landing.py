"""Land softly with a Unitree G1: impacts of its feet with and without proximity sensing in the soles (thesis 4.4.1).

    python control/examples/g1_landing.py [--urdf g1_29dof_rev_1_0.urdf] [--seeds 20] [--steps 4] [--speed 0.4]

The robot and its skin are those of ``g1.py``; the cells below the feet measure distances, too. The robot steps in
place: it shifts its weight to one foot, lifts the other one, and puts it down. In other runs an obstacle of 3 cm, of
which the controller does not know, slides below the first lifted foot. The path of a foot, its height, the virtual
springs, and what counts as an impact are those of ``landing.py``.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from biped import PERIOD
from experiment import arguments, count, film_both, positive, report, run_all, spread, whole
from g1 import FEET, G1, Balancer, Box, Senses, Terrain, propose, with_g1
from landing import HEIGHT, LIFTS, Impact, Judge, draw, ratio
from walker import Gait, Proximity, descent, quintic
from zmp_plan import ZmpPlan

from skin_control.walking import GRAVITY, com_velocity

LEAD, SHIFT, REST = 0.5, 1.5, 0.5  # before and while the ZMP moves to one foot, and until the other is lifted [s]
COMPLIANT = Proximity(lead=0.17)  # so that the foot does not land later than without
FLAT = 0.01  # difference of the heights of both feet, up to which the ground is taken as flat [m]
# Where the obstacle waits, and where it slides when the first foot is 1 cm higher than it [m].
ASIDE, BELOW = np.array((0.05, -1.0, HEIGHT / 2)), np.array((0.05, -0.12, HEIGHT / 2))
OBSTACLE = Box(tuple(ASIDE), (0.15, 0.06, HEIGHT / 2), "obstacle")
GROUND = {"flat": Terrain(), "obstacle": Terrain(boxes=(OBSTACLE,))}
OBSTACLE_STEPS = 2  # of a run over the obstacle, the first of which is onto it
PLACES = {"flat": ("flat ground",), "obstacle": ("on the obstacle", "floor next to the obstacle")}
OTHER = dict(zip(FEET, FEET[::-1]))
Array = np.ndarray


@dataclass(frozen=True)
class Case:
    """One run."""

    urdf: Path
    folder: Path  # of the calibrations
    ground: str
    proximity: bool
    steps: int
    speed: float  # of landing without proximity [m/s]
    seed: int
    period: float = PERIOD  # of the control [s]
    is_shown: bool = False  # with the meshes of the robot, for an animation


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
            landed = self.data.xpos[self.feet[self.swing_foot]].copy()
            if abs(landed[2] - self.ground) < FLAT:
                landed[2] = self.ground
            self.anchors[self.swing_foot] = landed
        self.swing_foot = foot
        self.stand_on((OTHER[foot],) if foot else FEET)
        if foot is None:
            feet = (OTHER[self.left[0]],) if self.left else FEET
            target = np.mean([self.anchors[foot][:2] + self.centres[foot][:2] for foot in feet], axis=0)
            points = (self.reference.zmp, self.reference.zmp, target)
            self.plan = ZmpPlan((0.0, LEAD, LEAD + SHIFT), points, self.omega)

    def _shift(self, since: float) -> None:
        self.reference = self.plan.at(since)
        move = com_velocity(self.goal, self.reference.dcm, self.omega) * self.period
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
                self.tilts[foot] = self.tilts[foot] + compliant.turning * self.period * virtual[3:5]
                speed = compliant.slowed(speed, virtual[2])
            anchor[2] -= speed * self.period
        self.anchors[foot] = anchor


def run(case: Case, each: Callable[[G1], None] | None = None) -> tuple[bool, list[Impact]]:
    """Return whether the robot still stands, and the impacts."""
    terrain = GROUND[case.ground]
    robot = G1(case.urdf, case.folder, case.seed, case.proximity, terrain, case.period, case.is_shown)
    gait = Gait(landing_speed=case.speed, lift=LIFTS[case.ground])
    stepper = Stepper(robot, case.urdf, case.steps, gait, COMPLIANT if case.proximity else None)
    judge = Judge(stepper, stepper.centres)
    while robot.stands and not stepper.is_done and robot.data.time < 5 * (case.steps + 1):
        targets, torques, *_ = stepper.cycle(robot.senses())
        if terrain.boxes and stepper.swing_foot and height(robot, stepper.swing_foot) > HEIGHT + 0.01:
            robot.data.mocap_pos[0] = BELOW
        robot.step(targets, torques)
        judge(robot)
        if each:
            each(robot)
    return robot.stands and stepper.is_done, judge.impacts


def height(robot: G1, foot: str) -> float:
    """Return the true height of the sole of a foot [m]."""
    return float(robot.data.body(foot).xpos[2] + robot.sole)


def by_place(results: dict[tuple[str, bool], list], sole: float) -> dict[tuple[str, bool], list[Impact]]:
    """Return the impacts of all runs by where the foot landed, and by whether it had proximity.

    Parameters
    ----------
    results : dict of lists
        Of :func:`run`, by ground and proximity.
    sole : float
        Height of the ankle above its sole [m].
    """
    places: dict[tuple[str, bool], list[Impact]] = {}
    for (ground, proximity), runs in results.items():
        for place in PLACES[ground]:
            is_high = place == "on the obstacle"
            landings = [i for _, impacts in runs for i in impacts if (i.place[2] - sole > HEIGHT / 2) == is_high]
            places[place, proximity] = landings
    return dict(sorted(places.items(), key=lambda item: list(sum(PLACES.values(), ())).index(item[0][0])))


def main() -> None:
    """Run all cases; print a table; draw."""
    parser = with_g1(arguments(__doc__))
    parser.add_argument("--steps", type=whole, default=4, help="on flat ground, in each run")
    parser.add_argument("--speed", type=positive, default=0.4, help="of landing without proximity [m/s]")
    given = parser.parse_args()
    folder = given.out / "g1"
    propose(given.urdf, folder)
    steps = {"flat": given.steps, "obstacle": OBSTACLE_STEPS}
    kinds = [(ground, proximity) for ground in GROUND for proximity in (False, True)]
    cases = {
        kind: [Case(given.urdf, folder, *kind, steps[kind[0]], given.speed, seed) for seed in range(given.seeds)]
        for kind in kinds
    }
    results = run_all(run, cases, given)
    robot = G1(given.urdf, folder, 0)
    impacts, rows = by_place(results, -robot.sole), []
    for (place, proximity), landings in impacts.items():
        ground = "flat" if place == "flat ground" else "obstacle"
        texts = (
            spread([getattr(i, kind) for i in landings], n) for kind, n in (("force", 0), ("speed", 2), ("time", 2))
        )
        stands = count(stands for stands, _ in results[ground, proximity])
        name = f"{place}, {'with' if proximity else 'without'}"
        compared = ratio(landings, impacts[place, False]) if proximity else ""
        rows.append((name, stands, str(len(landings)), *texts, compared))
    heads = ("place, proximity", "stands", "landings", "impact [N]", "speed [m/s]", "touch-down [s]")
    report(given, (*heads, "ratio of the means, of the largest"), rows)
    weight = float(robot.model.body_subtreemass[0] * GRAVITY)
    for place in ("flat ground", "on the obstacle"):
        forces = [impact.force for impact in impacts[place, False]]
        print(f"{place}, without: {np.mean(forces) / weight if forces else 0:.1f} times the weight of {weight:.0f} N")
    draw(impacts, weight, given.out / "g1_landing.png")
    if not given.no_animation:
        shown = replace(cases["flat", False][0], ground="obstacle", steps=OBSTACLE_STEPS, is_shown=True)
        films = [lambda each, near=near: run(replace(shown, proximity=near), each) for near in (False, True)]
        film_both(films, given.out / "g1_landing.gif", azimuth=120, distance=2.0)


if __name__ == "__main__":
    main()
