"""Control and skins at 1 kHz instead of 250 Hz: the experiments that ``rates.py`` does not have.

    python control/examples/rates_others.py [--seeds 20] [--urdf g1_29dof_rev_1_0.urdf]

The same runs as of ``landing.py``, ``balance.py``, ``replanning.py``, ``faults.py``, ``beam.py``, ``arm.py``,
``g1_landing.py``, ``g1.py`` and ``g1_arm.py``, with both rates. Without the G1 its rows are left out.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import arm
import balance
import beam
import faults
import g1
import g1_arm
import g1_landing
import landing
import replanning
from experiment import arguments, count, distances, report, run_all, spread
from rates import PERIODS

SPEED = 0.4  # of landing without proximity [m/s]
WALK_STEPS, BEAM_STEPS, G1_STEPS = 2, 10, 4  # of a walk with a fault, on the beam, of the G1 on flat ground
BEAM_WIDTH = 0.08  # [m]
G1_ARM = ("contacts", "near")
RUNS = {module.Case: module.run for module in (landing, balance, replanning, faults, beam, arm, g1_landing, g1)}
RUNS[g1_arm.G1Case] = g1_arm.run


@dataclass(frozen=True)
class Row:
    """One experiment. Each case is called with ``seed`` and ``period``; the text gets a list of results for each."""

    cases: tuple[Callable[..., Any], ...]
    text: Callable[..., str]


def run(case: Any) -> Any:
    """Return the result of a case of one of the scripts."""
    return RUNS[type(case)](case)


def landings(*groups: list[tuple[bool, list[landing.Impact]]]) -> str:
    """Return impacts on flat ground without and with proximity, as text."""
    impacts = [[impact for _, some in runs for impact in some] for runs in groups]
    stands = " and ".join(count(stands for stands, _ in runs) for runs in groups)
    forces = " and ".join(f"{spread(impact.force for impact in some)} N" for some in impacts)
    return f"{stands} stand; impacts {forces}; ratios {landing.ratio(impacts[1], impacts[0])}"


def on_obstacle(*groups: list[tuple[bool, list[landing.Impact]]]) -> str:
    """As :func:`landings`, of the impacts on the obstacle only."""
    return landings(*([(stands, [i for i in some if i.is_on_obstacle]) for stands, some in runs] for runs in groups))


def first_landings(*groups: list[tuple[bool, list[landing.Impact]]]) -> str:
    """As :func:`landings`, of the first impact of each run only, which is that of the G1 on the obstacle."""
    return landings(*([(stands, some[:1]) for stands, some in runs] for runs in groups))


def searches(found: list[Any]) -> str:
    """Return the largest pushes, and the distances of the ZMPs, as text."""
    apart = distances(search.apart for search in found)
    return f"largest push {spread((search.survived for search in found), 1)} N s; ZMPs {apart} mm apart"


def new_steps(walks: list[replanning.Result]) -> str:
    """Return how walks over an obstacle ended, as text."""
    again, area = count(bool(walk.retracted) for walk in walks), spread(100 * walk.area for walk in walks)
    return f"{count(walk.stands for walk in walks)} stand; new step in {again}, area {area} %"


def faulty_walks(walks: list[faults.Result]) -> str:
    """Return how walks with a fault ended, as text."""
    steps, apart = spread((walk.steps for walk in walks), 1), spread((1e3 * walk.apart for walk in walks), 1)
    stopped = spread((walk.stopped for walk in walks), 2)
    stop = "no stop" if stopped == "none" else f"stop after {stopped} s"
    return f"{count(walk.stands for walk in walks)} stand; {steps} steps, {stop}; felt ZMP {apart} mm from the true one"


def side_steps(walks: list[beam.Result]) -> str:
    """Return how walks on the beam ended, as text."""
    return f"{count(walk.stands for walk in walks)} stand; {spread((walk.steps for walk in walks), 1)} steps"


def along_axes(case: Callable[..., Any]) -> Callable[..., Any]:
    """Return a case whose seeds have the directions ahead, left, back and right, and not the diagonal ones."""
    return lambda seed, period: case(seed=2 * seed, period=period)


def of_robot() -> dict[str, Row]:
    """Return the rows of the own robot."""
    both = (False, True)  # without and with proximity
    lands = tuple(partial(landing.Case, "obstacle", near, landing.OBSTACLE_STEPS, SPEED) for near in both)
    rows = {"landing on the obstacle, without and with proximity": Row(lands, on_obstacle)}
    rows["balance on the half sole"] = Row((along_axes(partial(balance.Case, "half sole", "skin")),), searches)
    for obstacle in replanning.OBSTACLES:
        walk = partial(replanning.Case, obstacle, "what is felt, new steps")
        rows[f"new step, {obstacle}"] = Row((walk,), new_steps)
    for fault in ("frozen bus", "10 ms of latency"):
        rows[f"{fault}, flags used"] = Row((partial(faults.Case, fault, True, WALK_STEPS),), faulty_walks)
    rows["beam, what is felt"] = Row((partial(beam.Case, True, BEAM_WIDTH, BEAM_STEPS),), side_steps)
    for kind, variants in arm.VARIANTS.items():
        for variant in variants:
            case = partial(arm.Case, kind, variant)
            rows[f"{arm.TITLES[kind]}: {variant}"] = Row((case,), partial(arm.numbers, kind))
    return rows


def of_g1(urdf: Path, feet: Path, arms: Path) -> dict[str, Row]:
    """Return the rows of the G1.

    Parameters
    ----------
    urdf, feet, arms : path
        Of the robot, and the folders with the calibrations of its feet and of its arm.
    """
    rows = {}
    for place, ground, steps, text in (
        ("flat ground", "flat", G1_STEPS, landings),
        ("the obstacle", "obstacle", g1_landing.OBSTACLE_STEPS, first_landings),
    ):
        lands = tuple(partial(g1_landing.Case, urdf, feet, ground, near, steps, SPEED) for near in (False, True))
        rows[f"G1, landing on {place}, without and with proximity"] = Row(lands, text)
    for ground in g1.GROUND:
        pushed = along_axes(partial(g1.Case, urdf, feet, ground, "skin"))
        rows[f"G1, balance on the {ground}"] = Row((pushed,), searches)
    for kind in G1_ARM:
        for variant in g1_arm.VARIANTS[kind]:
            case = partial(g1_arm.G1Case, kind, variant, urdf=urdf, folder=arms)
            rows[f"G1, {g1_arm.TITLES[kind]}: {variant}"] = Row((case,), partial(arm.numbers, kind))
    return rows


def cases_of(row: Row, seeds: int, period: float) -> list[list[Any]]:
    """Return the cases of a row with one rate, a list for each of its kinds."""
    return [[case(seed=seed, period=period) for seed in range(seeds)] for case in row.cases]


def main() -> None:
    """Run all cases; print a table."""
    given = g1.with_g1(arguments(__doc__, has_animation=False), (*g1_arm.COVERED, g1_arm.HAND)).parse_args()
    rows = of_robot()
    if given.urdf.exists():
        feet, arms = given.out / "g1", given.out / "g1_arm"
        g1.propose(given.urdf, feet)
        g1.propose(given.urdf, arms, g1_arm.COVERED)
        rows |= of_g1(given.urdf, feet, arms)
    cases = {
        (name, rate, k): some
        for name, row in rows.items()
        for rate, period in PERIODS.items()
        for k, some in enumerate(cases_of(row, given.seeds, period))
    }
    results = run_all(run, cases, given)
    texts = {
        (name, rate): row.text(*(results[name, rate, k] for k in range(len(row.cases))))
        for name, row in rows.items()
        for rate in PERIODS
    }
    report(given, ("experiment", *PERIODS), [(name, *(texts[name, rate] for rate in PERIODS)) for name in rows])


if __name__ == "__main__":
    main()
