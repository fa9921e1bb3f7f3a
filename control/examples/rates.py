"""Control and skins at 1 kHz instead of 250 Hz: landings, partial footholds, a walk, balance, wrenches.

    python control/examples/rates.py [--seeds 20]

The same runs as of ``landing.py``, ``footholds.py``, ``faults.py``, ``wrenches.py`` and ``balance.py``, with both
rates. Readings are one cycle late with both: 4 ms at 250 Hz and 1 ms at 1 kHz. The noise of a reading is the same.
"""

from typing import Any

import balance
import faults
import footholds
import landing
import wrenches
from biped import PERIOD, TIME_STEP
from experiment import arguments, count, distances, report, run_all, spread

PERIODS = {"250 Hz": PERIOD, "1 kHz": TIME_STEP}  # [s]
STEPS, SPEED = 3, 0.4  # of the landings on flat ground [1, m/s]
SCENES = ("front half", "inner half", "30 %")
CONES = {"full": "the full sole", "felt": "the felt polygon"}
ROWS = ("no proximity", "proximity", *SCENES, "walk", *CONES, "balance")
RUNS = {module.Case: module.run for module in (landing, footholds, faults, wrenches, balance)}


def run(case: Any) -> Any:
    """Return the result of a case of one of the scripts."""
    return RUNS[type(case)](case)


def cases_of(name: str, number: int, period: float) -> list[Any]:
    """Return the cases of a row of the table for a number of seeds."""
    seeds = range(number)
    if name in SCENES:
        return [footholds.Case(name, True, seed, period) for seed in seeds]
    if name == "walk":
        return [faults.Case("none", True, 2, seed, period) for seed in seeds]
    if name in CONES:
        return [wrenches.Case(name, seed, period) for seed in seeds]
    if name == "balance":  # each direction counts equally
        seeds = range(number + -number % balance.DIRECTIONS)
        return [balance.Case("full sole", "skin", seed, period) for seed in seeds]
    return [landing.Case("flat", name == "proximity", STEPS, SPEED, seed, period) for seed in seeds]


def column(results: dict[str, list[Any]]) -> dict[str, str]:
    """Return the texts of one rate by quantity, from the results of its rows."""
    texts, impacts = {}, {}
    for name, words in (("no proximity", "landing without proximity"), ("proximity", "landing with proximity")):
        impacts[name] = [impact for _, landings in results[name] for impact in landings]
        texts[f"{words}: stands"] = count(stands for stands, _ in results[name])
        texts[f"{words}: impact [N]"] = spread(impact.force for impact in impacts[name])
    texts["ratio of the means, of the largest"] = landing.ratio(impacts["proximity"], impacts["no proximity"])
    for scene in SCENES:
        texts[f"foothold, {scene}: stands"] = count(walk.stands for walk in results[scene])
        texts[f"foothold, {scene}: area that is felt [%]"] = spread(100 * walk.area for walk in results[scene])
    texts["walk of 2 steps: stands"] = count(walk.stands for walk in results["walk"])
    texts["walk: felt ZMP to true ZMP [mm]"] = spread((1e3 * walk.apart for walk in results["walk"]), 1)
    for cone, words in CONES.items():
        texts[f"cone of {words}: stands"] = count(shift.stands for shift in results[cone])
        texts[f"cone of {words}: right sole tips"] = count(shift.tilt > wrenches.TIPPED for shift in results[cone])
    texts["cone of the felt polygon: ZMP off by [mm]"] = spread((1e3 * shift.off for shift in results["felt"]), 1)
    searches = results["balance"]
    texts["balance, full sole: largest push [N s]"] = spread((search.survived for search in searches), 1)
    apart = distances(search.apart for search in searches)
    texts["balance: ZMPs of skin and ankles apart, mean / 95 % / maximum [mm]"] = apart
    return texts


def main() -> None:
    """Run all cases; print a table."""
    given = arguments(__doc__, has_animation=False).parse_args()
    cases = {(rate, name): cases_of(name, given.seeds, PERIODS[rate]) for rate in PERIODS for name in ROWS}
    results = run_all(run, cases, given)
    columns = [column({name: results[rate, name] for name in ROWS}) for rate in PERIODS]
    report(given, ("quantity", *PERIODS), [(name, *(texts[name] for texts in columns)) for name in columns[0]])


if __name__ == "__main__":
    main()
