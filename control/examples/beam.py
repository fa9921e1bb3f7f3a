"""Walk sideways over a beam that is narrower than the sole (thesis 4.4.5.3): the skin against full contact.

    python control/examples/beam.py [--seeds 20] [--steps 50] [--width 0.08]

The robot starts on a platform and makes side steps of 8 cm. The middle of the beam is not below the middle of the
soles. The controller does not know this. With the skin it finds the part of the sole that carries it in each step anew.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from biped import PERIOD, Biped
from diagrams import ASSUMED, draw_walks
from experiment import arguments, film_both, positive, report, run_all, stands_and_steps, whole
from shapes import FORWARD
from walker import OTHER, Gait, Step, Walker, walk

STEP, WIDTH = 0.08, 0.18  # [m]
OFFSET = -0.035  # of the middle of the beam from that of the soles, ahead [m]
PLATFORM = 0.25  # half width of the platform where the robot starts [m]
HEIGHT = 0.1  # of the beam [m]
GAIT = Gait(single=0.9, double=0.3)
Array = np.ndarray


@dataclass(frozen=True)
class Case:
    """One walk."""

    feels: bool
    width: float  # of the beam [m]
    steps: int
    seed: int
    period: float = PERIOD  # of the control [s]


@dataclass(frozen=True)
class Result:
    """How it ended."""

    stands: bool
    steps: int  # that were made


def side_steps(count: int) -> list[Step]:
    """Return steps to the left: the left foot goes ahead, the right one follows."""
    steps, foot, y = [], "left", {"left": WIDTH / 2, "right": -WIDTH / 2}
    for _ in range(count):
        y[foot] += STEP
        steps.append(Step(foot, np.array((FORWARD, y[foot]))))
        foot = OTHER[foot]
    return steps


def terrain(width: float) -> str:
    """Return a platform, and a beam along y."""
    return f"""
      <geom class="terrain" type="plane" pos="0 0 {-HEIGHT}" size="20 20 .1" material="tiles" rgba="1 1 1 1"/>
      <geom class="terrain" type="box" pos="0 0 {-HEIGHT / 2}" size=".4 {PLATFORM} {HEIGHT / 2}"/>
      <geom class="terrain" type="box" pos="{FORWARD + OFFSET} 2 {-HEIGHT / 2}" size="{width / 2} 2 {HEIGHT / 2}"/>"""


def run(case: Case, each: Callable[[Biped, Walker], None] | None = None) -> Result:
    """Walk."""
    robot = Biped(terrain(case.width), case.seed, proximity=False, period=case.period)
    walker = Walker(robot, side_steps(case.steps), GAIT, feels=case.feels)
    stands = walk(robot, walker, 3 + 2 * case.steps, each=lambda robot: each(robot, walker) if each else None)
    return Result(stands, len(walker.log.landings))


def main() -> None:
    """Run all cases; print a table; draw."""
    parser = arguments(__doc__)
    parser.add_argument("--steps", type=whole, default=50, help="of a walk")
    parser.add_argument("--width", type=positive, default=0.08, help="of the beam [m]")
    given = parser.parse_args()
    kinds = {"the full sole": False, "what is felt": True}
    cases = {
        assumed: [Case(feels, given.width, given.steps, seed) for seed in range(given.seeds)]
        for assumed, feels in kinds.items()
    }
    results = run_all(run, cases, given)
    print(f"beam of {1e3 * given.width:.0f} mm under soles of 200 mm, {1e3 * OFFSET:.0f} mm from their middle")
    rows = [(assumed, *stands_and_steps(runs)) for assumed, runs in results.items()]
    report(given, ("assumed", "stands", f"steps of {given.steps}"), rows)
    films = [
        lambda each, feels=feels: run(Case(feels, given.width, min(given.steps, 8), 0), each) for feels in (False, True)
    ]
    draw_walks(dict(zip(ASSUMED, films)), given.out / "beam.png")
    if not given.no_animation:
        film_both(films, given.out / "beam.gif", azimuth=60)


if __name__ == "__main__":
    main()
