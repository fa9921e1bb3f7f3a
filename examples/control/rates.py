"""Control and skins at 1 kHz instead of 250 Hz: landings, partial footholds, and the ZMP of a walk.

    python examples/control/rates.py [--seeds 20]

The same runs as of ``landing.py``, ``footholds.py`` and ``faults.py``, with both rates. Readings are one cycle late
with both: 4 ms at 250 Hz and 1 ms at 1 kHz. The noise of a reading is the same.
"""

from collections.abc import Iterable
from typing import Any

import faults
import footholds
import landing
from biped import PERIOD, TIME_STEP
from experiment import arguments, count, report, run_all, spread

PERIODS = {"250 Hz": PERIOD, "1 kHz": TIME_STEP}  # [s]
STEPS, SPEED = 3, 0.4  # of the landings on flat ground [1, m/s]
SCENES = ("front half", "inner half", "30 %")
RUNS = {landing.Case: landing.run, footholds.Case: footholds.run, faults.Case: faults.run}


def run(case: Any) -> Any:
    """Return the result of a case of one of the three scripts."""
    return RUNS[type(case)](case)


def cases_of(name: str, seeds: Iterable[int], period: float) -> list[Any]:
    """Return the cases of a row of the table."""
    if name in SCENES:
        return [footholds.Case(name, True, seed, period) for seed in seeds]
    if name == "walk":
        return [faults.Case("none", True, 2, seed, period) for seed in seeds]
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
    return texts


def main() -> None:
    """Run all cases; print a table."""
    given = arguments(__doc__, has_animation=False).parse_args()
    kinds = [(rate, name) for rate in PERIODS for name in ("no proximity", "proximity", *SCENES, "walk")]
    cases = [case for rate, name in kinds for case in cases_of(name, range(given.seeds), PERIODS[rate])]
    found = run_all(run, cases, given)
    results: dict[str, dict[str, list[Any]]] = {rate: {} for rate in PERIODS}
    for k, (rate, name) in enumerate(kinds):
        results[rate][name] = found[k * given.seeds : (k + 1) * given.seeds]
    columns = [column(results[rate]) for rate in PERIODS]
    report(given, ("quantity", *PERIODS), [(name, *(texts[name] for texts in columns)) for name in columns[0]])


if __name__ == "__main__":
    main()
