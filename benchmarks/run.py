"""Ours beside the paper's method and its peers, in one run: tables, CSV files and the charts of the documentation.

    python benchmarks/run.py [--repeats N] [--only time_error|stability|cost|placement|cycle|files]

Times are the median of N runs, or of as many as fit in ``measure.BUDGET``, from mesh to surface without reading files,
with whatever threads the machine gives. All surfaces are measured by the same exact distances, in as many even places.
"ours, same planes" fits along the very planes of the paper's method; "ours" lets the planes go where they lower the
error most, "ours, best net" chooses the proportion of planes and lines too, for as many control points; "ours, auto"
finds the smallest net for a tolerance, proof included.
"""

import argparse
import csv
from pathlib import Path

import charts
import cost
import cycle
import files
import placement
import stability
import time_error
from links import ROOT

MODULES = (time_error, stability, cost, placement, cycle, files)
BENCHMARKS = {module.__name__: module for module in MODULES}


def write(rows: list, path: Path) -> None:
    """Rows as a CSV file; what is not known is empty."""
    path.parent.mkdir(exist_ok=True)
    names = list(type(rows[0]).__dataclass_fields__)
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        for row in rows:
            values = [getattr(row, name) for name in names]
            writer.writerow(["" if value != value else value for value in values])  # NaN is not itself


def main() -> None:
    """Measure, print, write, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--only", choices=BENCHMARKS)
    arguments = parser.parse_args()
    measured = {}
    for name, benchmark in BENCHMARKS.items():
        if arguments.only in (None, name):
            measured[name] = rows = list(benchmark.measure(arguments.repeats))
            if rows:
                write(rows, ROOT / "out" / f"{name}.csv")
                print(benchmark.table(rows), flush=True)
    charts.draw_all(measured, ROOT / "docs")


if __name__ == "__main__":
    main()
