"""How far surfaces of real links are off their meshes: where warnings and refusals begin, see `DeviationLimits`.

``python benchmarks/deviations.py FOLDER...`` fits tubes of 10 x 20 and 20 x 40 lines to each STL file. It prints the
largest distance at a sample site, the mean distance, and whether the surface folds, ordered by the largest distance.
"""

import argparse
from pathlib import Path

from skin_calib_addon.common.errors import SkinCalibError
from skin_calib_addon.geometry import CoverSpec, TubeGrid, cut_cover, load_mesh
from skin_calib_addon.geometry.fit.diagnosis import FOLDED_AREA, DeviationLimits, maximum_deviation
from skin_calib_addon.geometry.fit.fitting import fit_lines

SIZES = ((10, 20), (20, 40))


def rows(path: Path) -> list[tuple[float, str]]:
    """Return the largest distance [m] and a line of text for each size of the grid."""
    cover, found = cut_cover(load_mesh(path), CoverSpec()), []
    for n, lines in SIZES:
        name = f"{path.stem:32} {n} x {lines}"
        try:
            fit = fit_lines(cover, TubeGrid(n, lines).line_grid(cover, (3, 3)), (3, 3))
        except SkinCalibError as error:
            found.append((float("inf"), f"{name}  {str(error)[:80]}"))
            continue
        limit = DeviationLimits().warned
        distance, _ = maximum_deviation(cover, fit.lines, fit.basis, fit.samples, limit)
        folded = "folded" if fit.smallest_area < FOLDED_AREA else ""
        mean = fit.to_mesh.mean
        text = (
            f"{distance * 1e3:7.2f} mm ({distance / cover.size:5.1%} of the size), mean {mean * 1e3:7.3f} mm  {folded}"
        )
        found.append((distance, f"{name}  {text}"))
    return found


def main() -> None:
    """Print a line for each link and size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path, help="folders of STL files in metres")
    paths = sorted(p for folder in parser.parse_args().folders for p in folder.iterdir() if p.suffix.lower() == ".stl")
    for _, line in sorted(row for path in paths for row in rows(path)):
        print(line)


if __name__ == "__main__":
    main()
