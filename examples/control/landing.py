"""Land softly: the impacts of the feet with and without proximity sensing in the soles (thesis 4.4.1).

    python examples/control/landing.py [--seeds 20] [--steps 3] [--speed 0.4]

The robot walks on flat ground, and over an obstacle of 3 cm under its third step. An impact is the largest true force
between sole and ground in the first 40 ms of the contact, sampled at 1 kHz. The reference plans to meet the ground with
the given speed. With proximity the same plan begins to descend earlier, and virtual springs slow it down.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from biped import FLAT, Biped
from experiment import arguments, count, film_both, report, run_all, spread
from walker import Gait, Proximity, Walker, forward_steps, walk

OBSTACLE = '<geom class="terrain" type="box" size=".15 .07 .015" pos=".45 -.09 .015"/>'  # [m]
OBSTACLE_STEPS = 5  # of a run over the obstacle, which is under the third
STEP, WIDTH = 0.15, 0.18  # [m]
IMPACT_TIME = 0.04  # in which an impact is sought [s]
GROUND = {"flat": FLAT, "obstacle": FLAT + OBSTACLE}
# Impacts of the thesis with proximity relative to those without, of the H1 and the HRP-2Kai.
THESIS = {
    "flat": ("22 % (109 of 486 N), 42 %", "17 % (58 of 340 N), 46 %"),
    "obstacle": ("largest: 34 % (370 of 1100 N)", ""),
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


@dataclass(frozen=True)
class Impact:
    """How a foot met the ground, true values."""

    force: float  # largest [N]
    speed: float  # of the foot [m/s]
    time: float  # since the begin of the single support [s]


class Judge:
    """Finds the impacts in the simulator.

    Parameters
    ----------
    walker : Walker
        Its phases say which foot swings.
    """

    def __init__(self, walker: Walker):
        self.walker, self.impacts = walker, []
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
            self.impact_speed = self.speed
        elif self.foot and self.landed is not None and now - self.landed >= IMPACT_TIME:
            self.impacts.append(Impact(robot.peaks.pop(self.foot), self.impact_speed, self.landed - self.lifted))
            self.foot = self.landed = None
        if self.foot:
            self.speed = -float(robot.data.body(robot.foot_bodies[self.foot]).cvel[5])


def run(case: Case, each: Callable[[Biped], None] | None = None) -> tuple[bool, list[Impact]]:
    """Return whether the robot still stands, and the impacts."""
    robot = Biped(GROUND[case.ground], seed=case.seed, proximity=case.proximity)
    gait = Gait(landing_speed=case.speed)
    steps = forward_steps(case.steps, STEP, WIDTH)
    walker = Walker(robot, steps, gait, proximity=Proximity() if case.proximity else None)
    judge = Judge(walker)

    def look(robot: Biped) -> None:
        judge(robot)
        if each:
            each(robot)

    stands = walk(robot, walker, 3 + 1.5 * case.steps, each=look)
    return stands, judge.impacts


def draw(results: dict, weight: float, path) -> None:
    """Draw minimum, mean and maximum of the impacts, as figures 52 and 54 of the thesis."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(8, 3.4), sharey=True, layout="constrained")
    for ax, ground in zip(axes, GROUND):
        for x, (proximity, colour) in enumerate(((False, "#c44e52"), (True, "#4c72b0"))):
            forces = np.array([i.force for stands, impacts in results[ground, proximity] for i in impacts])
            ax.bar(x, np.ptp(forces), bottom=forces.min(), width=0.5, color=colour, alpha=0.5)
            ax.plot((x - 0.25, x + 0.25), (forces.mean(),) * 2, color=colour, lw=2)
            ax.annotate(
                f"mean {forces.mean():.0f} N", (x, forces.max()), (0, 4), textcoords="offset points", ha="center"
            )
        ax.axhline(weight, color="grey", lw=0.8, ls="--")
        ax.text(0.5, weight, "weight", va="bottom", ha="center", color="grey", fontsize=8)
        ax.set_xticks((0, 1), ("without proximity", "with proximity"))
        ax.set_title({"flat": "flat ground", "obstacle": "obstacle of 3 cm"}[ground])
        ax.margins(y=0.12)
    axes[0].set_ylabel("impact [N]")
    axes[0].set_ylim(bottom=0)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Run all cases; print a table; draw."""
    parser = arguments(__doc__)
    parser.add_argument("--steps", type=int, default=3, help="on flat ground, in each run")
    parser.add_argument("--speed", type=float, default=0.4, help="of landing without proximity [m/s]")
    given = parser.parse_args()
    steps = {"flat": given.steps, "obstacle": OBSTACLE_STEPS}
    kinds = [(ground, proximity) for ground in GROUND for proximity in (False, True)]
    cases = [Case(*kind, steps[kind[0]], given.speed, seed) for kind in kinds for seed in range(given.seeds)]
    found = run_all(run, cases, given)
    results = {kind: found[k * given.seeds : (k + 1) * given.seeds] for k, kind in enumerate(kinds)}
    weight = float(Biped().model.body_subtreemass[0] * 9.81)
    forces = {kind: np.array([i.force for _, f in runs for i in f]) for kind, runs in results.items()}
    rows = []
    for (ground, proximity), runs in results.items():
        hard, soft = forces[ground, False], forces[ground, True]
        ratios = (f"{100 * soft.mean() / hard.mean():.0f} %, {100 * soft.max() / hard.max():.0f} %", *THESIS[ground])
        rows.append(
            (
                f"{ground}, {'with' if proximity else 'without'}",
                count(stands for stands, _ in runs),
                spread(forces[ground, proximity]),
                *(spread([getattr(i, name) for _, f in runs for i in f], 2) for name in ("speed", "time")),
                *(ratios if proximity else [""] * 3),
            )
        )
    ratio = "ratio of the means, of the largest"
    heads = ("ground, proximity", "stands", "impact [N]", "speed [m/s]", "touch-down [s]")
    report(given, (*heads, ratio, "H1", "HRP-2Kai"), rows)
    print(f"flat, without: {forces['flat', False].mean() / weight:.1f} times the weight of {weight:.0f} N")
    draw(results, weight, given.out / "landing.png")
    if not given.no_animation:
        films = [
            lambda each, near=near: run(Case("obstacle", near, OBSTACLE_STEPS, given.speed, 0), each)
            for near in (False, True)
        ]
        film_both(films, given.out / "landing.gif", azimuth=100, distance=1.9)


if __name__ == "__main__":
    main()
