"""``fit --propose`` does the work of proposal and calibration once; its files are those of the two commands."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.calibration.file import load_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.commands import fit, fit_jobs
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, save_mesh
from skin_calib_addon.plan import load_plan
from skin_calib_addon.proposal.links import Task, numbered, propose_task, robot_of
from skin_calib_addon.proposal.skins import parse_skin
from skin_calib_addon.robot.link_mesh import load_urdf_mesh
from tests.examples import slow
from tests.shapes import box

LINKS = "one", "two"
SKIN = "sheet:2x2x10mm"


def plate(size: float, height: float = 0.0) -> TriangleMesh:
    """A plate of 70 mm times ``size`` [m] at a height [m]."""
    corners = np.array([(0, 0, height), (0.07, 0, height), (0.07, size, height), (0, size, height)])
    return TriangleMesh(corners, np.array([(0, 1, 2), (0, 2, 3)]))


@pytest.fixture
def urdf(tmp_path):
    """A robot of two plates that are far from each other."""
    robot_of.cache_clear()
    links = joints = ""
    for k, link in enumerate(LINKS):
        save_mesh(plate(0.07 + 0.01 * k), tmp_path / f"{link}.ply")
        links += f'<link name="{link}"><visual><geometry><mesh filename="{link}.ply"/></geometry></visual></link>'
        joints = '<joint name="j" type="fixed"><parent link="one"/><child link="two"/><origin xyz="1 0 0"/></joint>'
    (tmp_path / "robot.urdf").write_text(f'<robot name="r">{links}{joints}</robot>')
    return tmp_path / "robot.urdf"


def propose_and_fit(urdf: Path, *words: str) -> Path:
    assert main(["fit", str(urdf), "--propose", "-o", str(urdf.parent / "out"), "--skin", SKIN, *words]) == 0
    return urdf.parent / "out"


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.slow
def test_files_are_those_of_two_commands(urdf):
    """Every byte, with one process and with two."""
    out = propose_and_fit(urdf)
    found = contents(out)
    assert {f"{link}.{kind}.json" for link in LINKS for kind in ("plan", "calibration")} < set(found)
    propose_and_fit(urdf, "--again", "--jobs", "2")
    assert contents(out) == found
    for path in out.iterdir():
        path.unlink()
    assert main(["propose", str(urdf), "-o", str(out), "--skin", SKIN]) == 0
    assert main(["fit", str(out), str(urdf), "-o", str(out)]) == 0
    assert contents(out) == found


def test_no_link_is_fitted_twice(urdf, monkeypatch):
    monkeypatch.setattr(fit_jobs, "calibrate", None)
    out = propose_and_fit(urdf)
    assert load_calibration(out / "two.calibration.json").patches[0].taxels.channels.min() > 0


@pytest.mark.slow
def test_mesh_that_changes_after_the_proposal_is_fitted_again(urdf, monkeypatch):
    def propose(*arguments):
        found = original(*arguments)
        save_mesh(plate(0.0701), urdf.parent / "one.ply")
        return found

    original = fit.propose
    monkeypatch.setattr(fit, "propose", propose)
    calibration = load_calibration(propose_and_fit(urdf) / "one.calibration.json")
    assert calibration.mesh.sha256 == load_urdf_mesh(urdf, "one").sha256


@pytest.mark.slow
def test_edited_plan_has_no_calibration_yet(urdf, tmp_path):
    """Another mesh path and other channels make no difference."""
    propose_and_fit(urdf, "--only", "two")
    plan = load_plan(tmp_path / "out" / "two.plan.json")
    fitted = propose_task(Task(urdf, "m", "two", parse_skin(SKIN), fit=True)).fitted
    follow = replace(plan, skins=tuple(replace(skin, first_channel=None) for skin in plan.skins))
    assert fitted.calibration_of(numbered(follow, 7)).patches[0].taxels.channels[0] == 7
    surface = replace(plan.surfaces[0], max_deviation=1e-3)
    assert fitted.calibration_of(replace(plan, surfaces=(surface, *plan.surfaces[1:]))) is None


def test_link_next_to_one_that_cannot_be_read_says_so(urdf, capsys):
    """Its skin can lie under the other one: the output and the plan state it; the rest is done."""
    (urdf.parent / "two.ply").unlink()
    assert main(["propose", str(urdf), "-o", str(urdf.parent / "out"), "--skin", SKIN, "--jobs", "1"]) == 1
    words = "What two covers is not known: the mesh file two.ply of robot.urdf was not found."
    said = f"one  warning: {words}"
    assert said in capsys.readouterr().out
    assert main(["propose", str(urdf), "-o", str(urdf.parent / "out"), "--skin", SKIN]) == 1  # its plan is kept
    assert said in capsys.readouterr().out
    reasons = load_plan(urdf.parent / "out" / "one.plan.json").extra["x_proposal"]
    assert reasons[0].startswith(words) and reasons[0].endswith("Then propose again.")
    assert main(["check", str(urdf.parent / "out")]) == 0
    assert f"warning: /x_proposal warns: {words}" in capsys.readouterr().out


@pytest.mark.parametrize("shift", [0.0001, slow(0.02)])
def test_mesh_that_is_not_that_of_the_proposal_is_named(urdf, capsys, shift):
    """By propose, check and fit, whether the plan still fits or not; a new proposal is of the new mesh."""
    out, again = str(urdf.parent / "out"), ["propose", str(urdf), "--skin", SKIN, "--only", "one", "-o"]
    assert main([*again, out]) == 0
    plan = load_plan(Path(out) / "one.plan.json")
    assert plan.extra["x_proposal_mesh"] == load_urdf_mesh(urdf, "one").sha256
    save_mesh(plate(0.07, shift), urdf.parent / "one.ply")
    words = "The mesh has changed since the plan was proposed. Propose the plan again."
    capsys.readouterr()
    assert main([*again, out]) == 0 and f"one  warning: {words}" in capsys.readouterr().out
    assert main(["check", out]) == 0 and f"warning: /x_proposal warns: {words}" in capsys.readouterr().out
    assert main(["fit", out, "-o", out]) == (shift > 0.01)
    err = capsys.readouterr().err
    assert words in err and ("is 20.0 mm from the surface" in err or shift < 0.01)
    if shift < 0.01:  # also of a calibration that is up to date
        assert main(["fit", out, "-o", out]) == 0 and words in capsys.readouterr().err
        assert main(["check", out + "/one.calibration.json"]) == 0 and words in capsys.readouterr().out
    robot_of.cache_clear()
    assert main([*again, out, "--again"]) == 0 and words not in capsys.readouterr().out
    assert main(["fit", out, "-o", out]) == 0 and words not in capsys.readouterr().err


def test_links_without_a_visual_mesh_have_a_line(tmp_path, capsys):
    """A box that is seen, and a mesh for collisions. A link without shapes has none; one that is left out, neither."""
    save_mesh(plate(0.02), tmp_path / "one.ply")
    mesh, cube = '<geometry><mesh filename="one.ply"/></geometry>', '<geometry><box size="1 1 1"/></geometry>'
    shapes = {
        **{"one": f"<visual>{mesh}</visual>", "cube": f"<visual>{cube}</visual>", "sensor": f"<visual>{cube}</visual>"},
        **{"hull": f"<collision>{mesh}</collision>", "frame": ""},
    }
    links = "".join(f'<link name="{name}">{inside}</link>' for name, inside in shapes.items())
    joint = '<joint name="{0}" type="fixed"><parent link="one"/><child link="{0}"/></joint>'
    joints = "".join(joint.format(name) for name in list(shapes)[1:])
    (tmp_path / "robot.urdf").write_text(f'<robot name="r">{links}{joints}</robot>')
    arguments = [
        "propose",
        str(tmp_path / "robot.urdf"),
        "-o",
        str(tmp_path / "plans"),
        "--except",
        "sensor",
        "--skin",
        SKIN,
    ]
    assert main(arguments) == 0
    lines = [line.split(maxsplit=5) for line in capsys.readouterr().out.splitlines()]
    assert [line[0] for line in lines[:-1]] == ["one", "cube", "hull"]
    assert all(" ".join(line[1:]).startswith("no plan: it has no visual mesh. Shapes") for line in lines[1:3])


@pytest.mark.parametrize(("up", "is_named"), [("Y_UP", True), ("Z_UP", False)])
def test_dae_file_with_another_axis_has_a_warning(tmp_path, capsys, up, is_named):
    """Y_UP is ignored as in RViz, but some robots are written for programs that turn such meshes."""
    link = '<link name="{0}"><visual><geometry><mesh filename="{1}"/></geometry></visual></link>'
    joint = '<joint name="j" type="fixed"><parent link="base"/><child link="tip"/></joint>'
    (tmp_path / "robot.urdf").write_text(
        f'<robot name="r">{link.format("base", "a.ply")}{link.format("tip", "a.dae")}{joint}</robot>'
    )
    save_mesh(box((0, 0, 0), (0.01, 0.01, 0.01)), tmp_path / "a.ply")
    asset = f"<asset><up_axis>{up}</up_axis></asset>"
    (tmp_path / "a.dae").write_text(f'<COLLADA version="1.4.1">{asset}</COLLADA>')
    for file, words in (("robot.urdf", "The DAE files of 1 link of robot.urdf state"), ("a.dae", "a.dae states")):
        main(["propose", str(tmp_path / file), "-o", str(tmp_path / "plans")])
        assert (f"warning: {words} an <up_axis> that is not Z_UP" in capsys.readouterr().err) == is_named


HINGE = (
    '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="1 0 0"/>'
    '<limit lower="{3}" upper="1"/></joint>'
)


def chain(urdf: Path, lower: float) -> None:
    """Write a robot of plates: three follows two after three joints; the range of the first joint is given."""
    plates = [
        f'<link name="{k}"><visual><geometry><mesh filename="{k}.ply"/></geometry></visual></link>' for k in LINKS
    ]
    plates += ['<link name="a"/><link name="b"/>', plates[0].replace('name="one"', 'name="three"')]
    joints = [("j", "one", "two", lower), ("k", "two", "a", 0), ("l", "a", "b", 0), ("m", "b", "three", 0)]
    urdf.write_text(f'<robot name="r">{"".join(plates)}{"".join(HINGE.format(*joint) for joint in joints)}</robot>')
    robot_of.cache_clear()


def test_stale_plans_are_named_and_alone_proposed_again(urdf, capsys):
    """After another range of a joint, another mesh next to a link, and for another skin."""
    chain(urdf, 0)
    call = ["propose", str(urdf), "-o", str(urdf.parent / "out"), "--skin"]
    assert main([*call, SKIN]) == 0
    chain(urdf, -0.5)
    capsys.readouterr()
    assert main(["check", str(urdf.parent / "out")]) == 0
    out = capsys.readouterr().out
    assert out.count("The joint j has changed since the plan was proposed: other places are free. Propose") == 2
    assert main([*call, SKIN]) == 0 and capsys.readouterr().out.count("warning: The joint j has changed") == 2
    assert main([*call, SKIN, "--again"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines if "kept: what it was made from has not changed" in line] == ["three"]
    assert main(["check", str(urdf.parent / "out")]) == 0 and "has changed" not in capsys.readouterr().out
    save_mesh(plate(0.09), urdf.parent / "two.ply")
    robot_of.cache_clear()
    assert main(["check", str(urdf.parent / "out")]) == 0
    out = capsys.readouterr().out
    assert "The mesh of the link two has changed since" in out and "The mesh has changed since" in out
    assert main([*call, "sheet:2x3x10mm", "--again"]) == 0 and "kept" not in capsys.readouterr().out


def test_changed_mesh_without_a_robot_is_proposed_again(tmp_path, capsys):
    save_mesh(plate(0.07), tmp_path / "one.ply")
    call = ["propose", str(tmp_path / "one.ply"), "-o", str(tmp_path / "out"), "--skin", SKIN, "--again"]
    for size, kept in ((0.07, False), (0.07, True), (0.08, False)):
        save_mesh(plate(size), tmp_path / "one.ply")
        assert main(call) == 0 and ("kept" in capsys.readouterr().out) == kept
