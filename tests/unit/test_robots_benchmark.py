"""The benchmark of whole robots, on a robot of two plates whose errors are known."""

import re
from dataclasses import replace

import numpy as np
import pytest

from skin_calib_addon.calibration.file import load_calibration, save_calibration
from skin_calib_addon.cli import main
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
    covered, of_free, of_seen = map(int, re.findall(r"\d+", rows["area of the surfaces with skin"]))
    area = 2 * SIDE**2 * 1e4  # cm^2
    assert surfaces == 2 and of_free == of_seen == pytest.approx(100 * covered / area, abs=2)
    assert 60 < of_free <= 100
    assert float(rows["area of the cells"].split()[0]) == pytest.approx(boards * 1.5 * 3**0.5 * 0.8**2, abs=0.6)
    for row in ("distance of a taxel from the mesh", "angle of a normal to the face at the taxel"):
        assert float(rows[f"largest {row}"].split()[0]) < 0.01
    assert rows["hidden taxels, normals inward, overlapping pairs"] == "0, 0, 0"
    assert re.fullmatch(r"fit --propose [\d.]+, propose [\d.]+, fit [\d.]+, export [\d.]+", rows["CPU seconds"])


@pytest.mark.nightly
def test_presses_of_links_whose_names_have_slashes_are_felt(benchmarks, tmp_path):
    """Sensors are named LINK/ID, and ids have the name of the link, too."""
    presses = pytest.importorskip("presses")
    out = tmp_path / "out"
    call = [
        "fit",
        str(plates(tmp_path, ("base", "right/arm"))),
        "--propose",
        "-o",
        str(out),
        "--skin",
        "sheet:3x3x10mm",
    ]
    assert main(call) == 0
    found = presses.measure(out, 18)
    assert (found.count, found.alone, found.links, found.wrong) == (18, 18, 2, ())


@pytest.mark.nightly
def test_damage_is_found(robots, kept, tmp_path):
    """A taxel 2 mm off, a normal 20 degrees off, one that points inward, one board moved onto another."""
    urdf, out, said = kept
    calibration = load_calibration(out / "end.calibration.json")
    (patch,) = calibration.patches
    taxels = patch.taxels
    positions, normals, corners = (
        getattr(taxels, name).copy() for name in ("positions_link", "normals_link", "corners_link")
    )
    distance = np.linalg.norm(positions - positions[0], axis=1)
    neighbour = int(distance.argsort()[1])
    step = (positions[0] - positions[neighbour]) * 0.5
    positions[neighbour] += step
    corners[neighbour] += step
    for moved in (positions, corners):
        moved[2] += 2e-3 * normals[2]
    angle, across = np.deg2rad(20), np.cross(normals[3], taxels.tangents_link[3])
    normals[3] = np.cos(angle) * normals[3] + np.sin(angle) * across
    normals[4], corners[4] = -normals[4], corners[4, ::-1].copy()
    changed = replace(taxels, positions_link=positions, normals_link=normals, corners_link=corners)
    damaged = replace(calibration, patches=(replace(patch, taxels=changed),), warnings=())
    folder = tmp_path / "out"
    folder.mkdir()
    save_calibration(damaged, folder / "end.calibration.json")
    rows = robots.of_taxels(urdf, folder)
    assert rows["largest distance of a taxel from the mesh"] == "2.00 mm (end)"
    assert rows["largest angle of a normal to the face at the taxel"] == "180.00 degrees (end)"
    assert rows["taxels with a mean angle above 15 degrees, without a warning"] == "2"
    hidden, inward, overlapping = map(int, rows["hidden taxels, normals inward, overlapping pairs"].split(", "))
    assert inward == 1 and overlapping >= 1
