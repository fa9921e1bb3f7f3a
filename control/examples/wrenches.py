"""Distribute the wrench over both feet, with the cone of the felt polygon or of the full sole (thesis 4.4.4).

    python control/examples/wrenches.py [--seeds 20]

The robot stands with its left foot on the ground and with the rear half of its right foot on a block. The desired ZMP
moves ahead slowly. The rest of the right sole is in the air, and a quadratic program distributes the wrench. Both feet
together can bear this ZMP, but not if the program uses the part of the right sole that is in the air.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from biped import PERIOD, Biped
from diagrams import draw_walks
from estimator import State
from experiment import arguments, count, film_both, report, run_all, spread
from shapes import FORWARD
from walker import Walker
from zmp_plan import ZmpPlan

from skin_calib_addon.runtime import zero_moment_point

# By which the desired ZMP moves ahead of the middle of the soles [m]. The full left sole and the rear half of the right
# one bear at most 40 mm with the same load on both, less the margin of the controller. Smaller: the sole tips less.
AHEAD = 0.036
START, MOVE = 1.0, 1.5  # begin and duration of the motion of the ZMP [s]
# End of a run [s]. A robot that tips needs several seconds until it falls: if its right sole is still tilted at the
# first time, the run goes on until it falls or the sole is flat, up to the second time.
END, LATEST = 10.0, 20.0
DEPTH = 0.06  # of the ground ahead of the block [m]
TIPPED = np.radians(3.0)  # tilt of a sole from which on it has tipped [rad]
GROUND = f"""
<geom class="terrain" type="plane" pos="0 0 {-DEPTH}" size="10 10 .1" material="tiles" rgba="1 1 1 1"/>
<geom class="terrain" type="box" pos="0 .2 {-DEPTH / 2}" size=".4 .2 {DEPTH / 2}"/>
<geom class="terrain" type="box" pos="{FORWARD - 0.2} -.2 {-DEPTH / 2}" size=".2 .2 {DEPTH / 2}"/>"""
Array = np.ndarray


@dataclass(frozen=True)
class Case:
    """One run."""

    cone: str  # "felt" or "full"
    seed: int
    period: float = PERIOD  # of the control [s]


@dataclass(frozen=True)
class Result:
    """How it ended."""

    stands: bool
    fell: float  # when it fell; not a number if it stands [s]
    tilt: float  # largest of the right sole [rad], true value
    demanded: float  # largest CoP that the program demands of the right sole, ahead of its middle [m]
    off: float  # mean distance of the ZMP from the desired one after the motion; not a number if it fell [m]


class Shift(Walker):
    """Stands, and moves the desired ZMP."""

    def _plan(self, state: State) -> None:
        if not hasattr(self, "plan"):
            middle = np.mean([anchor[:2] for anchor in self.estimator.anchors.values()], axis=0)
            points = (state.com[:2], middle, middle + (AHEAD, 0.0))
            self.plan, self.planned = ZmpPlan((0.0, START, START + MOVE), points, self.omega), self.clock


def run(case: Case, each: Callable[[Biped, Walker], None] | None = None) -> Result:
    """Shift the weight."""
    robot = Biped(GROUND, case.seed, proximity=False, period=case.period)
    walker = Shift(robot, [], cone=case.cone)
    now, tilt, demanded, off = 0.0, 0.0, -np.inf, []
    while robot.data.time < (END if now < TIPPED else LATEST) and not robot.fallen:
        robot.step(*walker.cycle(robot.senses()))
        if each:
            each(robot, walker)
        if robot.data.time < START:
            continue
        now = float(np.arccos(min(robot.data.body("right_foot").xmat[8], 1.0)))
        tilt = max(tilt, now)
        if "right" in walker.wrenches:
            demanded = max(demanded, float(zero_moment_point(walker.wrenches["right"])[0]))
        if robot.data.time > START + MOVE:
            row = walker.log.rows[-1]
            off.append(float(np.linalg.norm(row["zmp"] - walker.plan.points[-1])))
    if robot.fallen:
        return Result(False, float(robot.data.time), tilt, demanded, np.nan)
    return Result(True, np.nan, tilt, demanded, float(np.mean(off)))


def main() -> None:
    """Run all cases; print a table; draw."""
    given = arguments(__doc__).parse_args()
    cones = ("full", "felt")
    results = run_all(run, {cone: [Case(cone, seed) for seed in range(given.seeds)] for cone in cones}, given)
    rows = []
    for cone, runs in results.items():
        rows.append(
            (
                {"full": "the full sole", "felt": "the felt polygon"}[cone],
                count(r.stands for r in runs),
                spread([r.fell for r in runs], 1),
                count(r.tilt > TIPPED for r in runs),
                spread([np.degrees(r.tilt) for r in runs], 1),
                spread([1e3 * r.demanded for r in runs]),
                spread([1e3 * r.off for r in runs], 1),
            )
        )
    heads = (
        "cone of",
        "robot stands",
        "falls after [s]",
        "right sole tips",
        "its largest tilt [degree]",
        "CoP demanded of it, ahead of its middle [mm]",
        "ZMP off by, if it stands [mm]",
    )
    report(given, heads, rows)
    films = [lambda each, cone=cone: run(Case(cone, 0), each) for cone in cones]
    draw_walks(dict(zip(("cone of the full sole", "cone of the felt polygon"), films)), given.out / "wrenches.png")
    if not given.no_animation:
        film_both(films, given.out / "wrenches.gif", azimuth=-60, distance=1.6)


if __name__ == "__main__":
    main()
