"""The benchmark of whole robots, on a robot of two plates whose errors are known."""

import re

import pytest

from tests.unit.commands.test_bad_robots import plates

pytestmark = pytest.mark.slow
SIDE = 0.07  # [m] of a plate


@pytest.fixture(scope="module")
def robots(benchmarks):
    """The benchmark as a module."""
    return pytest.importorskip("robots")


@pytest.fixture(scope="module")
def kept(robots, tmp_path_factory):
    """The robot with its plans and calibrations, and what the program said."""
    folder = tmp_path_factory.mktemp("robot")
    urdf, out = plates(folder, ("base", "end")), folder / "out"
    out.mkdir()
    return urdf, out, robots.made(urdf, out, "hexagons:8mm", "1")


def rows_of(robots, kept):
    """The judged rows."""
    urdf, out, said = kept
    return {**robots.of_proposal(urdf, out, said), **robots.of_taxels(urdf, out)}


@pytest.mark.nightly
def test_figures_of_plates_are_those_of_their_geometry(robots, kept):
    """All of each plate is free; boards are exactly on it, and their area follows from their number."""
    rows = rows_of(robots, kept)
    assert rows["links, with a mesh, with a plan"] == "2, 2, 2" and rows["links without a plan"] == "none"
    surfaces, boards = map(int, rows["surfaces, boards"].split(", "))
    of_free, of_seen = map(int, re.findall(r"\d+", rows["cells cover"]))
    cells = float(rows["area of the cells"].split()[0])
    area = 2 * SIDE**2 * 1e4  # cm^2
    assert surfaces == 2 and of_free == of_seen == pytest.approx(100 * cells / area, abs=2)
    assert 40 < of_free <= 100
    assert cells == pytest.approx(boards * 1.5 * 3**0.5 * 0.8**2, abs=0.6)
    for row in ("distance of a taxel from the mesh", "angle of a normal to the face at the taxel"):
        assert float(rows[f"largest {row}"].split()[0]) < 0.01
    assert rows["hidden taxels, normals inward, overlapping pairs"] == "0, 0, 0"
    assert re.fullmatch(r"fit --propose [\d.]+, propose [\d.]+, fit [\d.]+, export [\d.]+", rows["CPU seconds"])
