"""Walk while sensors of the soles fail: the flags of the runtime against readings that are believed.

    python control/examples/faults.py [--seeds 20] [--steps 2]

At a random time of the walk a board of nine taxels dies, the bus of one sole freezes, the readings of one sole stop, or
those of both become noisier or later. With the flags, silent cells of a sole with a dead board are no evidence:
the full sole is assumed. If the contact of a foot is not known, its step ends by time, and the robot stops stepping.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import ceil

import numpy as np
from biped import NOISE, PERIOD, Biped, Faults
from diagrams import draw_walks
from experiment import arguments, film_both, report, run_all, spread, stands_and_steps, whole
from shapes import SOLE_CELLS
from walker import Walker, forward_steps, walk

STEP, WIDTH = 0.15, 0.18  # [m]
EARLIEST, LATEST = 1.2, 3.0  # time of a fault [s]
LATE = 10e-3  # of the fault of latency; rounded up to whole cycles, so 12 ms at 250 Hz [s]
FILMED = 3  # seed of the figure and the animation; the bus freezes in the first step
Array = np.ndarray


def board(rng: np.random.Generator) -> tuple[int, ...]:
    """Return the taxels of a square board of nine."""
    rows, columns = SOLE_CELLS
    row, column = rng.integers(0, rows // 3) * 3, rng.integers(0, columns // 3) * 3
    return tuple(int((row + i) * columns + column + j) for i in range(3) for j in range(3))


# The faults by name, from a time [s], a generator of random numbers and the period of the control [s].
FAULTS: dict[str, Callable[[float, np.random.Generator, float], Faults]] = {
    "none": lambda since, rng, period: Faults(),
    "dead board": lambda since, rng, period: Faults(since=since, dead=board(rng)),
    "frozen bus": lambda since, rng, period: Faults(since=since, is_frozen=True),
    "lost sole": lambda since, rng, period: Faults(since=since, lost="left_foot"),
    "noise doubled": lambda since, rng, period: Faults(since=since, noise=2 * NOISE),
    "10 ms of latency": lambda since, rng, period: Faults(since=since, latency=ceil(LATE / period)),
}
BELIEVED = ("dead board", "frozen bus", "lost sole")  # also run with the flags ignored
CASES = [(name, True) for name in FAULTS] + [(name, False) for name in BELIEVED]


@dataclass(frozen=True)
class Case:
    """One walk."""

    fault: str
    heeds: bool  # the flags
    steps: int
    seed: int
    period: float = PERIOD  # of the control [s]


@dataclass(frozen=True)
class Result:
    """How it ended."""

    stands: bool
    steps: int  # that were made
    stopped: float  # time from the fault to the decision to stop stepping [s]; NaN if there was none
    apart: float  # mean distance of the felt ZMP from the true one of the cycle before [m]


def run(case: Case, each: Callable[[Biped, Walker], None] | None = None) -> Result:
    """Walk."""
    rng = np.random.default_rng(case.seed)
    since = float(rng.uniform(EARLIEST, LATEST))
    faults = FAULTS[case.fault](since, rng, case.period)
    robot = Biped(seed=case.seed, faults=faults, proximity=False, period=case.period)
    walker = Walker(robot, forward_steps(case.steps, STEP, WIDTH), heeds=case.heeds)
    apart, true = [], deque([np.full(2, np.nan)] * 2, maxlen=3)

    def look(robot: Biped) -> None:
        true.append(robot.true_zmp())  # the felt one is of the readings of the cycle before, and there was a step since
        apart.append(float(np.linalg.norm(walker.log.rows[-1]["zmp"] - true[0])))
        if each:
            each(robot, walker)

    stands = walk(robot, walker, 3 + 1.3 * case.steps, each=look)
    stopped = np.nan if walker.log.stopped is None else walker.log.stopped - since
    return Result(stands, len(walker.log.landings), stopped, float(np.nanmean(apart)))


def main() -> None:
    """Run all cases; print a table; draw."""
    parser = arguments(__doc__)
    parser.add_argument("--steps", type=whole, default=2, help="of a walk")
    given = parser.parse_args()
    cases = {kind: [Case(*kind, given.steps, seed) for seed in range(given.seeds)] for kind in CASES}
    results = run_all(run, cases, given)
    rows = []
    for name in FAULTS:
        row = [name]
        for heeds in (True, False):
            runs = results.get((name, heeds))
            row += [""] * 3 if runs is None else stands_and_steps(runs)
            if runs:
                row.append(spread([1e3 * r.apart for r in runs], 1))
        rows.append((*row[:3], spread([r.stopped for r in results[name, True]], 2), *row[3:]))
    off = "felt ZMP to true ZMP [mm]"
    heads = ("fault", "stands, flags used", f"steps of {given.steps}", "stops stepping after the fault [s]", off)
    report(given, (*heads, "stands, flags ignored", "steps", off), rows)
    films = {
        f"frozen bus, flags {'used' if heeds else 'ignored'}": lambda each, heeds=heeds: run(
            Case("frozen bus", heeds, given.steps, FILMED), each
        )
        for heeds in (True, False)
    }
    draw_walks(films, given.out / "faults.png")
    if not given.no_animation:
        film_both(list(films.values()), given.out / "faults.gif", azimuth=100, distance=2.15, every=2)


if __name__ == "__main__":
    main()
