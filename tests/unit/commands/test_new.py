"""``new``: a plan with one skin at one place of a link."""

import json
import re
import shlex
import subprocess

import numpy as np
import pytest

from skin_calib_addon.calibration import load_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.commands import new
from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh
from tests.examples import slow
from tests.shapes import RADIUS, cylinder

SHEET = ("--sheet", "3x5x10mm")
AT, ALONG = ("--at", "-35,0,50mm"), ("--along", "0,1,0")
END = ("--at", "35,0,5mm")  # a sheet of three rows protrudes there
MESH = '<visual><geometry><mesh filename="tube.ply"/></geometry></visual>'
URDF = f'<robot name="r"><link name="arm">{MESH}</link></robot>'


@pytest.fixture
def tube(tmp_path, monkeypatch):
    """A folder with a tube, as the current one."""
    save_mesh(cylinder(around=24, along=8), tmp_path / "tube.ply")
    (tmp_path / "robot.urdf").write_text(URDF)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(*words):
    """Run the command on the tube, unless the words name a link."""
    link = () if "--on" in words else ("tube.ply",)
    return main(["new", *link, *words, "-o", "plan.json"])


def fitted(capsys):
    """Fit the plan, without errors and warnings about the skin, and return the taxels."""
    capsys.readouterr()
    assert main(["fit", "plan.json", "-o", "out.json"]) == 0
    assert "error" not in capsys.readouterr().err
    return load_calibration("out.json").patches[0].taxels


@pytest.mark.parametrize(
    ("words", "count", "middle"),
    [(SHEET, 15, 7), (("--hexagons", "8mm", "5"), 5, 0), (SHEET + ("--on", "robot.urdf:arm"), 15, 7)],
)
def test_skin_is_at_the_place(tube, capsys, words, count, middle):
    """Of a sheet the middle cell, of boards the first."""
    assert call(*words, *AT, *ALONG) == 0
    assert "(-35.0, 0.0, 50.0) mm of the mesh, 0.0 mm" in capsys.readouterr().out
    taxels = fitted(capsys)
    assert len(taxels.ids) == count
    at = 0 if middle else min(range(count), key=lambda k: np.linalg.norm(taxels.positions_link[k] - (-RADIUS, 0, 0.05)))
    np.testing.assert_allclose(taxels.positions_link[middle or at], (-RADIUS, 0, 0.05), atol=5e-4)
    assert taxels.tangents_link[middle or at] @ (0, 1, 0) > 0.99


@pytest.mark.parametrize(
    "words",
    [
        (*SHEET, *END),
        slow(("--hexagons", "8mm", "120", *AT)),
        slow(("--sheet", "3x30x10mm", *AT)),
    ],
)
def test_command_of_a_refusal_works(tube, capsys, words):
    """No plan is written; the command that is printed writes it, and the plan fits."""
    assert call(*words, *ALONG, "--picture", "no.png") == 1
    assert not (tube / "plan.json").exists() and (tube / "no.png").stat().st_size > 10_000
    err = capsys.readouterr().err
    away, command = re.search(r"([\d.]+) mm from there.*?: skin-calib (.*)", err).groups()
    assert float(away) < 60
    assert main(shlex.split(command)) == 0
    assert len(fitted(capsys).ids) > 1


@pytest.mark.parametrize(("along", "is_steep"), [("1,0,0.1", True), ("-1,0.3,0", True), ("1,1,0", False)])
def test_direction_that_says_little_is_a_warning(tube, capsys, along, is_steep):
    """The normal at the place is along x."""
    assert call("--sheet", "3x2x8mm", *AT, "--along", along) == 0
    assert ("degrees from the normal" in capsys.readouterr().err) == is_steep


def test_numbers_have_the_unit_of_the_mesh(tube, capsys):
    """Without a unit of their own."""
    assert call(*SHEET, "--at", "-.035,0,.05", *ALONG) == 0
    assert "(-35.0, 0.0, 50.0) mm of the mesh" in capsys.readouterr().out


def test_point_off_the_link_is_refused(tube, capsys):
    """Millimetres without a unit for a mesh in metres: where the link is is named, not the distance."""
    assert call(*SHEET, "--at", "35,0,50", *ALONG) == 1
    err = capsys.readouterr().err
    assert "(-35.0, -35.0, 0.0) mm to (35.0, 35.0, 100.0) mm" in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        ((*SHEET, "--at", "1,2", *ALONG), "'1,2' is not three numbers"),
        ((*SHEET, "--at", "1e999,0,0", *ALONG), "is not three numbers"),
        ((*SHEET, "--at", "1,2,3furlong", *ALONG), "'furlong' is not a unit of length. Use m, cm, mm, in"),
        ((*SHEET, *AT, "--along", "0,0,0"), "is not a direction"),
        (("--sheet", "3x5", *AT, *ALONG), "'3x5' is not the size of a sheet"),
        (("--hexagons", "8mm", "x", *AT, *ALONG), "'8mm x' is not a side and a number"),
        ((*SHEET, "--on", "tube.ply:arm", *AT, *ALONG), "is not a link of a robot"),
        ((*SHEET, "--on", "robot.urdf:arm", "--unit", "mm", *AT, *ALONG), "A URDF is in metres"),
    ],
)
def test_invalid_call_is_one_line(tube, capsys, words, problem):
    """With the exit code of an invalid call."""
    try:
        code = call(*words)
    except SystemExit as end:
        code = end.code
    err = capsys.readouterr().err
    assert code == 2 and problem in err and err.count("\n") == 1


def test_unknown_link_and_input_as_output(tube, capsys):
    """Neither is a traceback."""
    assert call(*SHEET, "--on", "robot.urdf:leg", *AT, *ALONG) == 1
    assert main(["new", "tube.ply", *SHEET, *AT, *ALONG, "-o", "tube.ply"]) == 2
    err = capsys.readouterr().err
    assert "leg" in err and "tube.ply would replace" in err and err.count("\n") == 2


def test_open_starts_blender_with_the_plan(tube, capsys, monkeypatch):
    """Without Blender the command says how to open the plan, and has written it."""
    monkeypatch.setattr(new.shutil, "which", lambda name: None)
    assert call(*SHEET, *AT, *ALONG, "--open") == 0
    assert "Open the plan with" in capsys.readouterr().err
    started = []
    monkeypatch.setattr(new.shutil, "which", lambda name: name)
    monkeypatch.setattr(subprocess, "Popen", started.append)
    assert call(*SHEET, *AT, *ALONG, "--open") == 0
    assert str(tube / "plan.json") in started[0][2]
    assert json.loads((tube / "plan.json").read_text())["mesh"] == "tube.ply"
