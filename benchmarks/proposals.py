"""Single links: what ``propose`` chooses for a mesh without any setting, and how well the plan fits.

    python benchmarks/proposals.py [--skin hexagons] [--only G1] [--write]

For each of eight real links of the data folder it prints a row. First the proposal: its surfaces, the largest of them
with its axis or direction, mean and maximum deviation of the least exact surface, and the warnings of the fit. Then the
area that can be seen from outside, the part of it that is open, the area of the cells, and that of surfaces on which no
board fits. Last, for comparison, a tube of
10 u-planes and 20 lines, the first values of the window. Below the table it prints the time and the reasons of each
proposal. With ``--write`` the table goes into the documentation.
"""

import argparse
import sys
from collections import Counter
from pathlib import Path
from time import perf_counter

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from pages import left_out_area, write_table  # noqa: E402

from skin_calib_addon.common.errors import SkinCalibError  # noqa: E402
from skin_calib_addon.geometry import CoverSpec, TubeGrid, load_mesh  # noqa: E402
from skin_calib_addon.pipeline import calibrate  # noqa: E402
from skin_calib_addon.plan.plan import Plan, Surface  # noqa: E402
from skin_calib_addon.proposal.links import Task, propose_task  # noqa: E402
from skin_calib_addon.proposal.skins import DEFAULT_SKIN, parse_skin  # noqa: E402

PAGE = ROOT / "docs" / "how-to" / "links.md"
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
COLUMNS = (
    "link | surfaces; boards | the largest | mean, max [mm] | warnings | seen, free, cells [cm²] "
    "| no board fits [cm²] | a plain tube: mean, max [mm]; warnings"
)


def main() -> None:
    """Propose and fit each link, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--skin", default=DEFAULT_SKIN)
    parser.add_argument("--only", default="", help="links whose name has this text")
    parser.add_argument("--write", action="store_true", help="the table into the documentation")
    options = parser.parse_args()
    files = {name: MESHES / f"{stem}.stl" for name, stem in LINKS.items() if options.only.lower() in name.lower()}
    if missing := [file.name for file in files.values() if not file.exists()]:
        sys.exit(f"{MESHES} does not have {', '.join(missing)}")
    choice, reasons = parse_skin(options.skin), {}
    table = [f"| {COLUMNS} |", f"|{'---|' * len(COLUMNS.split('|'))}"]
    print(*table, sep="\n")
    for name, file in files.items():
        row, reasons[name] = judged(file, choice)
        table.append(f"| {name} | {' | '.join(row)} |")
        print(table[-1], flush=True)
    for name, lines in reasons.items():
        print("", name, *(f"- {line}" for line in lines), sep="\n")
    if options.write:
        write_table(PAGE, "\n".join(table))


def judged(file, choice):
    """Return the cells of a row after its name, and the time and the reasons of the proposal."""
    start = perf_counter()
    found = proposed(file, choice)
    middle = perf_counter()
    if found.plan is None:
        return ["none", "", "", found.reasons[-1], "", "", plain(file)], found.reasons
    result = calibrate(found.plan, load_mesh(file, "m"))
    seconds = f"{middle - start:.1f} s to propose, {perf_counter() - middle:.1f} s to fit"
    kinds = Counter(kind_of(surface) for surface in found.plan.surfaces)
    no_board = left_out_area("\n".join(found.reasons))
    seen, free, covered = (round(area * 1e4) for area in (found.seen, found.free, found.cells))
    cells = [
        f"{', '.join(f'{n} {kind}' for kind, n in kinds.items())}; {found.taxels}",
        largest(found.plan),
        errors_of(result),
        warnings_of(result),
        f"{seen}, {free}, {covered}",
        f"{no_board}",
        plain(file),
    ]
    return cells, (seconds, *found.reasons)


def proposed(file, choice):
    """Return the proposal for a mesh."""
    outcome = propose_task(Task(file, "m", file.stem, choice))
    if outcome.proposal is None:
        sys.exit(f"{file.name}: {outcome.problem}")
    return outcome.proposal


def plain(file):
    """Return errors and warnings of a tube of 10 u-planes and 20 lines, or why it is refused."""
    plan = Plan(file.stem, file, "m", (Surface(CoverSpec(), TubeGrid(10, 20)),), ())
    try:
        result = calibrate(plan, load_mesh(file, "m"))
    except SkinCalibError as error:
        return f"refused: `{error.numbers.get('code', type(error).__name__)}`"
    return f"{errors_of(result)}; {warnings_of(result)}"


def kind_of(surface):
    """Return the kind of the grid of a surface: tube, sector or across."""
    return type(surface.grid.region).__name__.lower()


def largest(plan):
    """Return the first surface of a plan, which is the largest, with its axis or direction."""
    region = plan.surfaces[0].grid.region
    words, direction = ("towards", region.normal) if hasattr(region, "normal") else ("about", region.axis.direction)
    return f"{kind_of(plan.surfaces[0])} {words} ({', '.join(f'{round(x, 2) + 0.0:.2f}' for x in direction)})"


def errors_of(result):
    """Return mean and maximum deviation of the least exact surface [mm]."""
    errors = [fit.errors.surface_to_mesh for fit in result.fits.values()]
    return f"{max(e.mean for e in errors) * 1e3:.3f}, {max(e.max for e in errors) * 1e3:.2f}"


def warnings_of(result):
    """Return the codes of the warnings with their numbers."""
    return ", ".join(f"{n} `{code}`" for code, n in Counter(w.code for w in result.warnings).items()) or "none"


if __name__ == "__main__":
    main()
