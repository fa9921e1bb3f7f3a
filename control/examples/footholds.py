"""Walk over partial footholds: what the sole feels against the assumption of full contact (thesis 4.4.5).

    python control/examples/footholds.py [--seeds 20]

The third of five steps has a foothold of half the sole or of 30 %. All around it is a pit. The controller does not
know this. With the skin, cells that stay silent although they should carry load are void; the
ZMP is then planned and limited in the rest of the sole.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from biped import FLAT, PERIOD, Biped
from diagrams import ASSUMED, draw_walks
from experiment import arguments, film_both, report, run_all, spread, stands_and_steps
from foothold import Foothold, full_sole
from shapes import HALF_SIZE
from walker import Gait, Walker, forward_steps, walk

STEP, WIDTH, STEPS = 0.15, 0.18, 5  # [m, m, 1]
PARTIAL = 2  # index of the step onto the partial foothold, of the right foot
MARGIN = 0.03  # by which ground is larger than the soles that are to stand on it [m]
DEPTH = 0.06  # of the pit [m]
GAIT = Gait()
Array = np.ndarray
# Part of the sole with ground below, along and across from its centre, in half sizes of the sole.
SCENES = {
    "rear half": ((-1.0, 0.0), (-1.0, 1.0)),
    "front half": ((0.0, 1.0), (-1.0, 1.0)),
    "inner half": ((-1.0, 1.0), (0.0, 1.0)),
    "outer half": ((-1.0, 1.0), (-1.0, 0.0)),
    "30 %": ((-1.0, -0.14), (-0.7, 0.7)),  # behind, in the middle
}


@dataclass(frozen=True)
class Case:
    """One walk."""

    scene: str  # of SCENES; any other name: flat ground
    feels: bool
    seed: int
    period: float = PERIOD  # of the control [s]
    foothold: type[Foothold] = Foothold  # how a foot learns what bears it


@dataclass(frozen=True)
class Result:
    """How it ended."""

    stands: bool
    steps: int  # that were made
    area: float  # of the partial foothold as felt, relative to the sole


def box(x: tuple[float, float], y: tuple[float, float]) -> str:
    """Return a box between these coordinates [m] with its upper side at z = 0."""
    centre, half = np.mean((x, y), axis=1), np.ptp((x, y), axis=1) / 2
    return (
        f'<geom class="terrain" type="box" pos="{centre[0]} {centre[1]} {-DEPTH / 2}" '
        f'size="{half[0]} {half[1]} {DEPTH / 2}"/>'
    )


def terrain(scene: str) -> str:
    """Return the ground of a scene: all that is not in the lane of the right foot, and the partial foothold."""
    centre = forward_steps(STEPS, STEP, WIDTH)[PARTIAL].centre
    (rear, front), (right, left) = (np.array(part) * half for part, half in zip(SCENES[scene], HALF_SIZE))
    # Where the ground is to bear up to the edge of the sole, it is a little larger.
    rear, right = (low - MARGIN * (low == -half) for low, half in zip((rear, right), HALF_SIZE))
    front, left = (high + MARGIN * (high == half) for high, half in zip((front, left), HALF_SIZE))
    before, after = centre[0] + np.array((-1, 1)) * (HALF_SIZE[0] + MARGIN)
    grounds = [
        box((-1.0, before), (-0.5, 0.0)),
        box((after, 2.0), (-0.5, 0.0)),
        box((-1.0, 2.0), (0.0, 0.5)),
        box((centre[0] + rear, centre[0] + front), (centre[1] + right, centre[1] + left)),
    ]
    plane = f'<geom class="terrain" type="plane" pos="0 0 {-DEPTH}" size="10 10 .1" material="tiles" rgba="1 1 1 1"/>'
    return plane + "".join(grounds)


def run(case: Case, each: Callable[[Biped, Walker], None] | None = None) -> Result:
    """Walk."""
    ground = terrain(case.scene) if case.scene in SCENES else FLAT
    robot = Biped(ground, case.seed, proximity=False, period=case.period)
    walker = Walker(robot, forward_steps(STEPS, STEP, WIDTH), GAIT, feels=case.feels, foothold=case.foothold)
    area = 1.0

    def look(robot: Biped) -> None:
        nonlocal area
        if walker.index == PARTIAL + 1:
            area = walker.footholds["right"].area.area / full_sole().area
        if each:
            each(robot, walker)

    stands = walk(robot, walker, 3 + 2 * STEPS, each=look)
    return Result(stands, len(walker.log.landings), area)


def main() -> None:
    """Run all cases; print a table; draw."""
    given = arguments(__doc__).parse_args()
    kinds = [(scene, feels) for scene in SCENES for feels in (False, True)]
    cases = {kind: [Case(*kind, seed) for seed in range(given.seeds)] for kind in kinds}
    results = run_all(run, cases, given)
    rows = []
    for scene in SCENES:
        full, felt = results[scene, False], results[scene, True]
        rows.append((scene, *stands_and_steps(full, felt), spread([100 * r.area for r in felt])))
    heads = (
        "foothold",
        "full sole assumed: stands",
        f"steps of {STEPS}",
        "with what is felt: stands",
        f"steps of {STEPS}",
        "area that is felt [%]",
    )
    report(given, heads, rows)
    films = [lambda each, feels=feels: run(Case("front half", feels, 0), each) for feels in (False, True)]
    draw_walks(dict(zip(ASSUMED, films)), given.out / "footholds.png")
    if not given.no_animation:
        film_both(films, given.out / "footholds.gif", azimuth=100, distance=2.15)


if __name__ == "__main__":
    main()
