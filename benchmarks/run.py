"""Compare ours with the paper's method and with peers, in one run: tables, CSV files and the figures of the docs.

    python benchmarks/run.py [--repeats N] [--only time_error|stability|cost|placement|cycle] [--quick]

A warm time is the median of N calls, or of as many as fit in ``measure.BUDGET``; a cold time is that of the first call
in a fresh process, after imports. Times go from mesh to surface, without reading files, with the machine's default
number of threads. All surfaces are measured by the same exact distances at as many even positions. The methods are:

- "ours, same planes": along the planes of the paper's method;
- "ours, placed planes": as many planes, placed where they reduce the error most;
- "ours, best net": as many control points, with the best ratio of planes to lines, too;
- "ours, auto": the smallest net for a tolerance;
- "paper, letter": the paper's method as its text says (``paper_letter.py``);
- "paper, strengthened": the best form of it that we found (``paper_strengthened.py``);
- the peers, with our samples (``peers.py``).

``--quick`` measures the links of the README's figure at two sizes; its figures go to ``out``, not to ``docs``.
"""

import argparse
import csv
from pathlib import Path

import cost
import cycle
import figures
import placement
import stability
import time_error
from links import ROOT

MODULES = (time_error, stability, cost, placement, cycle)
BENCHMARKS = {module.__name__: module for module in MODULES}


def write(rows: list, path: Path) -> None:
    """Write rows as a CSV file; unknown values are empty."""
    path.parent.mkdir(exist_ok=True)
    names = list(type(rows[0]).__dataclass_fields__)
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        for row in rows:
            values = [getattr(row, name) for name in names]
            writer.writerow(["" if value != value else value for value in values])  # only NaN differs from itself


def main() -> None:
    """Measure, print, write, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--only", choices=BENCHMARKS)
    parser.add_argument("--quick", action="store_true", help="the links of the README at two sizes, figures into out")
    arguments = parser.parse_args()
    measured: dict[str, list] = {}
    for name, benchmark in BENCHMARKS.items():
        if arguments.only not in (None, name):
            continue
        quick = {"quick": True} if arguments.quick and benchmark is time_error else {}
        measured[name] = rows = list(benchmark.measure(arguments.repeats, **quick))
        if rows:
            write(rows, ROOT / "out" / f"{name}{'_quick' if arguments.quick else ''}.csv")
            print(benchmark.table(rows), flush=True)
    figures.draw_all(measured, ROOT / ("out" if arguments.quick else "docs"))


if __name__ == "__main__":
    main()
