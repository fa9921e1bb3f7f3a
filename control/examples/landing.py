"""Land softly: the impacts of the feet with and without proximity sensing in the soles (thesis 4.4.1).

    python control/examples/landing.py [--seeds 50] [--steps 3] [--speed 0.4]

The robot walks on flat ground, and over an obstacle of 3 cm under the whole sole of its third step, of which it does
not know. An impact is the largest true force between sole and ground in the first 40 ms of the contact, sampled at
1 kHz. The reference plans to meet the ground with the given speed. With proximity the same plan begins to descend
earlier, and virtual springs slow it down. The obstacle is met before the plan ends. There the foot is lifted higher, so
that it is about as fast when it meets the obstacle. Landings on the obstacle and on the floor are judged apart.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from biped import FEET, FLAT, PERIOD, Biped, mujoco
from estimator import SOLE_CENTRE
from experiment import arguments, count, film_both, positive, report, run_all, spread, whole
from shapes import HALF_SIZE
from walker import Gait, Proximity, Walker, forward_steps, walk

STEP, WIDTH = 0.15, 0.18  # [m]
OBSTACLE_AT, OBSTACLE_HALF = np.array((3 * STEP, -WIDTH / 2)), np.array((0.15, 0.07))  # below the third step [m]
HEIGHT = 0.03  # of the obstacle [m]
OBSTACLE = (
    f'<geom class="terrain" type="box" size="{OBSTACLE_HALF[0]} {OBSTACLE_HALF[1]} {HEIGHT / 2}" '
    f'pos="{OBSTACLE_AT[0]} {OBSTACLE_AT[1]} {HEIGHT / 2}"/>'
)
OBSTACLE_STEPS = 4  # of a run over the obstacle: the fifth would meet a part of it
# Height to which a foot is lifted. From 5 cm it meets the obstacle with 0.2 m/s, from 10 cm with 0.34 m/s.
LIFTS = {"flat": 0.05, "obstacle": 0.1}  # [m]
IMPACT_TIME = 0.04  # in which an impact is sought [s]
GROUND = {
    "flat": FLAT,
    "obstacle": FLAT + OBSTACLE,
    "box": '<geom class="terrain" type="box" size="5 5 .1" pos="0 0 -.1"/>',  # a floor like the obstacle
}
# Impacts of the thesis with proximity relative to those without, of the H1 and the HRP-2Kai.
THESIS = {
    "flat ground": ("22 % (109 of 486 N), 42 %", "17 % (58 of 340 N), 46 %"),
    "on the obstacle": ("largest: 34 % (370 of 1100 N)", ""),
}
Array = np.ndarray


@dataclass(frozen=True)
class Case:
    """One run."""

    ground: str
    proximity: bool
    steps: int
    speed: float  # of landing without proximity [m/s]
    seed: int
    period: float = PERIOD  # of the control [s]
    compliance: Proximity = Proximity()  # of a foot with proximity
    lift: float | None = None  # height to which a foot is lifted; that of LIFTS if it is None [m]


@dataclass(frozen=True)
class Impact:
    """How a foot met the ground, true values."""

    force: float  # largest [N]
    speed: float  # with which the centre of the sole moved down in the cycle before [m/s]
    time: float  # since the begin of the single support [s]
    place: Array  # (3,) of the ankle [m]

    @property
    def is_on_obstacle(self) -> bool:
        """Whether the sole is above a part of the obstacle, if there is one."""
        return bool((np.abs(self._from_obstacle) < OBSTACLE_HALF + HALF_SIZE).all())

    @property
    def is_whole(self) -> bool:
        """Whether the obstacle is below the whole sole."""
        return bool((np.abs(self._from_obstacle) <= OBSTACLE_HALF - HALF_SIZE).all())

    @property
    def _from_obstacle(self) -> Array:
        return self.place[:2] + SOLE_CENTRE[:2] - OBSTACLE_AT


class Judge:
    """Finds the impacts in the simulator.

    Parameters
    ----------
    walker : Walker
        Its phases say which foot swings.
    centres : dict of (3,) arrays
        The centre of each sole in the frame of its foot [m].
    """

    def __init__(self, walker: Walker, centres: dict[str, Array]):
        self.walker, self.centres, self.impacts = walker, centres, []
        self.foot: str | None = None  # that swings, or has landed just now
        self.landed: float | None = None
        self.swinging: str | None = None
        self.speed = 0.0

    def __call__(self, robot: Biped) -> None:
        """Look at the last cycle."""
        now, walker = robot.data.time, self.walker
        if walker.swing_foot != self.swinging:
            self.swinging, self.began = walker.swing_foot, now
        if not self.foot and self.swinging and now - self.began > 0.3 * walker.gait.single:
            self.foot, self.lifted = self.swinging, self.began
            robot.peaks[self.foot] = 0.0
        if self.foot and self.landed is None and robot.peaks[self.foot] > 0:
            self.landed = now
            self.impact_speed, self.place = self.speed, robot.data.body(robot.foot_bodies[self.foot]).xpos.copy()
        elif self.foot and self.landed is not None and now - self.landed >= IMPACT_TIME:
            since = self.landed - self.lifted
            self.impacts.append(Impact(robot.peaks.pop(self.foot), self.impact_speed, since, self.place))
            self.foot = self.landed = None
        if self.foot:
            self.speed = sinking(robot, robot.foot_bodies[self.foot], self.centres[self.foot])


def sinking(robot: Biped, body: str, point: Array) -> float:
    """Return how fast a point (3,) of a body moves down [m/s]."""
    velocity, turn = np.zeros(6), robot.data.body(body).xmat.reshape(3, 3)
    mujoco.mj_objectVelocity(robot.model, robot.data, mujoco.mjtObj.mjOBJ_XBODY, robot.model.body(body).id, velocity, 0)
    return -float(velocity[5] + np.cross(velocity[:3], turn @ point)[2])


def run(
    case: Case, each: Callable[[Biped], None] | None = None, judging: Callable[..., Judge] = Judge
) -> tuple[bool, list[Impact]]:
    """Return whether the robot still stands, and the impacts."""
    robot = Biped(GROUND[case.ground], seed=case.seed, proximity=case.proximity, period=case.period)
    gait = Gait(landing_speed=case.speed, lift=case.lift or LIFTS[case.ground])
    steps = forward_steps(case.steps, STEP, WIDTH)
    walker = Walker(robot, steps, gait, proximity=case.compliance if case.proximity else None)
    judge = judging(walker, dict.fromkeys(FEET, SOLE_CENTRE))

    def look(robot: Biped) -> None:
        judge(robot)
        if each:
            each(robot)

    stands = walk(robot, walker, 3 + 1.5 * case.steps, each=look)
    return stands, judge.impacts


def by_place(results: dict[tuple[str, bool], list]) -> dict[tuple[str, bool], list[Impact]]:
    """Return the impacts of all runs by where the foot landed, and by whether it had proximity."""
    places = {}
    for place in ("flat ground", "floor next to the obstacle", "on the obstacle"):
        ground = "flat" if place == "flat ground" else "obstacle"
        for proximity in (False, True):
            found = [impact for _, impacts in results[ground, proximity] for impact in impacts]
            if ground == "obstacle":
                found = [impact for impact in found if impact.is_on_obstacle == (place == "on the obstacle")]
            places[place, proximity] = found
    return places


def draw(impacts: dict[tuple[str, bool], list[Impact]], weight: float, path) -> None:
    """Draw minimum, mean and maximum of the impacts, as figures 52 and 54 of the thesis."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    places = list(dict.fromkeys(place for place, _ in impacts))
    size = (4 * len(places), 3.4)
    figure, axes = plt.subplots(1, len(places), figsize=size, sharey=True, squeeze=False, layout="constrained")
    for ax, place in zip(axes[0], places):
        for x, (proximity, colour) in enumerate(((False, "#c44e52"), (True, "#4c72b0"))):
            forces = np.array([impact.force for impact in impacts[place, proximity]])
            if not len(forces):
                continue
            ax.bar(x, np.ptp(forces), bottom=forces.min(), width=0.5, color=colour, alpha=0.5)
            ax.plot((x - 0.25, x + 0.25), (forces.mean(),) * 2, color=colour, lw=2)
            ax.annotate(
                f"mean {forces.mean():.0f} N", (x, forces.max()), (0, 4), textcoords="offset points", ha="center"
            )
        ax.axhline(weight, color="grey", lw=0.8, ls="--")
        ax.text(0.5, weight, "weight", va="bottom", ha="center", color="grey", fontsize=8)
        ax.set_xticks((0, 1), ("without proximity", "with proximity"))
        ax.set_title(f"{place}, {len(impacts[place, True])} landings")
    axes[0, 0].set_ylabel("impact [N]")
    axes[0, 0].set_ylim(0, 1.15 * max((impact.force for found in impacts.values() for impact in found), default=1.0))
    figure.savefig(path, dpi=110)


def ratio(soft: list[Impact], hard: list[Impact]) -> str:
    """Return the ratios of the means and of the largest impacts, as text."""
    on, off = (np.array([impact.force for impact in impacts]) for impacts in (soft, hard))
    return f"{100 * on.mean() / off.mean():.0f} %, {100 * on.max() / off.max():.0f} %" if len(on) and len(off) else ""


def main() -> None:
    """Run all cases; print a table; draw."""
    parser = arguments(__doc__, seeds=50)  # a run has one landing on the obstacle
    parser.add_argument("--steps", type=whole, default=3, help="on flat ground, in each run")
    parser.add_argument("--speed", type=positive, default=0.4, help="of landing without proximity [m/s]")
    given = parser.parse_args()
    steps = {"flat": given.steps, "obstacle": OBSTACLE_STEPS}
    kinds = [(ground, proximity) for ground in LIFTS for proximity in (False, True)]
    cases = {kind: [Case(*kind, steps[kind[0]], given.speed, seed) for seed in range(given.seeds)] for kind in kinds}
    results = run_all(run, cases, given)
    weight = float(Biped().model.body_subtreemass[0] * 9.81)
    impacts, rows = by_place(results), []
    for (place, proximity), landings in impacts.items():
        ground = "flat" if place == "flat ground" else "obstacle"
        compared = (ratio(landings, impacts[place, False]), *THESIS.get(place, ("", ""))) if proximity else [""] * 3
        rows.append(
            (
                f"{place}, {'with' if proximity else 'without'}",
                count(stands for stands, _ in results[ground, proximity]),
                str(len(landings)),
                spread(impact.force for impact in landings),
                *(spread((getattr(impact, name) for impact in landings), 2) for name in ("speed", "time")),
                *compared,
            )
        )
    heads = ("place, proximity", "robot stands", "landings", "impact [N]", "speed [m/s]", "touch-down [s]")
    report(given, (*heads, "ratio of the means, of the largest", "H1", "HRP-2Kai"), rows)
    for place in ("flat ground", "on the obstacle"):
        forces = [impact.force for impact in impacts[place, False]]
        print(f"{place}, without: {np.mean(forces) / weight if forces else 0:.1f} times the weight of {weight:.0f} N")
    landings = [impact for near in (False, True) for impact in impacts["on the obstacle", near]]
    print(f"on a part of the obstacle only: {sum(not i.is_whole for i in landings)} of {len(landings)} landings")
    draw(impacts, weight, given.out / "landing.png")
    if not given.no_animation:
        films = [
            lambda each, near=near: run(Case("obstacle", near, OBSTACLE_STEPS, given.speed, 0), each)
            for near in (False, True)
        ]
        film_both(films, given.out / "landing.gif", azimuth=100)


if __name__ == "__main__":
    main()
