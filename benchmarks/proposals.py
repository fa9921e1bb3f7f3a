"""Single links: what ``propose`` chooses for a mesh without any setting, and how well the plan fits.

    python benchmarks/proposals.py [--skin hexagons] [--only G1]

For each of eight real links of the data folder it prints a row: surfaces and taxels, the fraction of the visible area
that they cover, the worst mean and the worst maximum distance from a surface to the mesh, the warnings, and the
seconds. Below the table it prints the reasons of each proposal.
"""

import argparse
import sys
from collections import Counter
from pathlib import Path
from time import perf_counter

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT)]

from skin_calib_addon.geometry import load_mesh  # noqa: E402
from skin_calib_addon.pipeline import calibrate  # noqa: E402
from skin_calib_addon.proposal.links import Task, propose_task  # noqa: E402
from skin_calib_addon.proposal.skins import DEFAULT_SKIN, parse_skin  # noqa: E402

MESHES = ROOT.parent / "shared" / "data" / "meshes"
LINKS = {
    "HRP-4C wrist": "hrp4c_r_wrist_y",
    "HRP-4C elbow": "hrp4c_r_elbow_p",
    "HRP-4C foot": "hrp4c_r_ankle_r_foot",
    "iCub forearm": "icub27_l_forearm",
    "iCub thigh": "icub27_l_upper_leg",
    "iCub sole": "icub27_l_foot_sole",
    "G1 wrist": "g1_left_wrist_roll",
    "G1 foot": "g1_left_ankle_roll_foot",
}
COLUMNS = "link | surfaces; taxels | covered | mean, max [mm] | warnings | propose, fit [s]"


def main() -> None:
    """Propose and fit each link, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--skin", default=DEFAULT_SKIN)
    parser.add_argument("--only", default="", help="links whose name has this text")
    options = parser.parse_args()
    choice, reasons = parse_skin(options.skin), {}
    print(f"| {COLUMNS} |\n|{'---|' * len(COLUMNS.split('|'))}")
    for name, stem in LINKS.items():
        file = MESHES / f"{stem}.stl"
        if options.only.lower() in name.lower() and file.exists():
            row, reasons[name] = judged(file, choice)
            print(f"| {name} | {' | '.join(row)} |", flush=True)
    for name, lines in reasons.items():
        print("", name, *(f"- {line}" for line in lines), sep="\n")


def judged(file, choice):
    """Return the cells of a row after its name, and the reasons of the proposal."""
    start = perf_counter()
    outcome = propose_task(Task(file, "m", file.stem, choice))
    proposed = perf_counter()
    found = outcome.proposal
    if found is None or found.plan is None:
        return ["none", "", "", outcome.problem or found.reasons[-1], f"{proposed - start:.1f}"], ()
    result = calibrate(found.plan, load_mesh(file, "m"))
    seconds = perf_counter() - proposed
    errors = [fit.errors.surface_to_mesh for fit in result.fits.values()]
    kinds = Counter(type(surface.grid.region).__name__.lower() for surface in found.plan.surfaces)
    warned = Counter(warning.code for warning in result.warnings)
    cells = [
        f"{', '.join(f'{n} {kind}' for kind, n in kinds.items())}; {found.taxels}",
        f"{found.covered / found.seen:.0%}",
        f"{max(e.mean for e in errors) * 1e3:.3f}, {max(e.max for e in errors) * 1e3:.2f}",
        ", ".join(f"{n} {code}" for code, n in warned.items()) or "none",
        f"{proposed - start:.1f}, {seconds:.1f}",
    ]
    return cells, found.reasons


if __name__ == "__main__":
    main()
