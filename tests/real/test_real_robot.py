"""A published robot from its URDF to presses in MuJoCo: the links of the Unitree G1 with the least skin."""

import importlib
import json
from pathlib import Path

import pytest

from skin_calib_addon.cli import main
from tests.unit.calibration.exchange import test_simulators
from tests.unit.test_robots_benchmark import robots  # noqa: F401  a fixture

G1 = Path(__file__).parents[3] / "shared" / "data" / "robots" / "g1_description" / "g1_29dof_rev_1_0.urdf"
LINKS = ("left_shoulder_pitch_link", "left_shoulder_roll_link", "left_wrist_roll_link", "left_wrist_yaw_link")
pytestmark = [pytest.mark.nightly, pytest.mark.skipif(not G1.exists(), reason=f"no real robots here: {G1} is missing")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Plans and calibrations of the links, by one command."""
    out = tmp_path_factory.mktemp("g1")
    only = [word for link in LINKS for word in ("--only", link)]
    assert main(["fit", str(G1), "--propose", "-o", str(out), "--skin", "hexagons:8mm", *only]) == 0
    return out


def test_links_are_proposed_fitted_and_checked(folder, capsys):
    """Each link has a plan and a calibration; channels of the robot are used once."""
    assert main(["check", str(folder)]) == 0
    found = json.loads((folder / "robot.json").read_text())
    assert sorted(link["link"] for link in found["links"]) == sorted(LINKS)
    assert all((folder / f"{link}.plan.json").exists() for link in LINKS)


def test_taxels_are_on_the_outside_of_the_links(robots, folder):  # noqa: F811
    """Within 1 mm and 15 degrees of the mesh, outward, visible and apart, or a warning names the taxel."""
    rows = robots.of_taxels(G1, folder)
    assert float(rows["largest distance of a taxel from the mesh"].split()[0]) <= 1.0
    assert rows[f"taxels with a mean angle above {robots.STEEP:.0f} degrees, without a warning"] == "0"
    assert rows["hidden taxels, normals inward, overlapping pairs"] == "0, 0, 0"


def test_presses_are_felt_where_they_are(robots, folder):  # noqa: F811
    """The sensor of the pressed taxel reports, and no other of the robot."""
    pytest.importorskip("mujoco")
    result = importlib.import_module("presses").measure(folder, 40)
    assert result.alone == result.count == 40 and result.links == len(LINKS), result.wrong


def test_presses_have_the_same_forces_in_mujoco_warp(folder, tmp_path):
    """Thirty at once on the links of the robot, within single precision."""
    warp = pytest.importorskip(
        "mujoco_warp", reason="MuJoCo Warp is not installed (pip install 'skin-calib[simulators]')"
    )
    assert main(["export", str(folder), "--to", "mjcf", "-o", str(tmp_path / "g1.xml")]) == 0
    spec = test_simulators.mujoco.MjSpec.from_file(str(tmp_path / "g1.xml"))
    model, data = test_simulators.with_fingers(spec, 30)
    test_simulators.press_apart(model, data, 30)
    expected, found = test_simulators.forces(warp, model, data)
    assert (expected > 0).sum() == 30 and abs(found - expected).max() < test_simulators.SINGLE
