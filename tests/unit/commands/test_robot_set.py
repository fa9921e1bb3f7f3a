"""``robot.json``: written by ``fit``, examined by ``check``, loaded by a controller."""

import json
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.calibration.robot_set import load_robot_set
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh
from skin_calib_addon.runtime import Body, load
from tests.examples import slow
from tests.shapes import cylinder
from tests.unit.commands.test_cli import write_plan

LINKS = ("arm", "hand")
URDF = """<robot name="bot"><link name="base"/>{2}
<joint name="a" type="revolute"><parent link="base"/><child link="{0}"/></joint>
<joint name="b" type="revolute"><parent link="{0}"/><child link="{1}"/></joint></robot>"""


def write_urdf(folder, links=LINKS):
    mesh = '<link name="{0}"><visual><geometry><mesh filename="{0}.ply"/></geometry></visual></link>'
    (folder / "bot.urdf").write_text(URDF.format(*links, "".join(mesh.format(name) for name in links)))


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A folder with a URDF and two plans, fitted into the folder ``out``."""
    folder = tmp_path_factory.mktemp("robot")
    (folder / "out").mkdir()
    write_urdf(folder)
    for name in LINKS:
        save_mesh(cylinder(around=24, along=8), folder / f"{name}.ply")
        write_plan(folder, name, link=name, mesh=f"{name}.ply")
    assert main(["fit", str(folder / "bot.urdf"), "-o", str(folder / "out")]) == 0
    return folder


@pytest.fixture
def robot(fitted, tmp_path, capsys):
    """A copy of it."""
    capsys.readouterr()
    return Path(shutil.copytree(fitted, tmp_path, dirs_exist_ok=True))


def check(robot, capsys):
    """Return exit code and lines about the set of ``check``."""
    capsys.readouterr()
    code = main(["check", str(robot / "out")])
    lines = [line for line in capsys.readouterr().out.splitlines() if "calibration.json:" not in line]
    return code, lines


def edit(robot, **changes):
    """Change members of the links in the file."""
    path = robot / "out" / "robot.json"
    document = json.loads(path.read_text())
    for member, values in changes.items():
        for link, value in zip(document["links"], values):
            link[member] = value
    path.write_text(json.dumps(document))


def test_fit_lists_the_links_of_the_robot(robot, capsys):
    """Names, parents, hashes and channels; a second fit leaves the file as it is."""
    found = load_robot_set(robot / "out")
    assert found.robot == "bot" and found.urdf.file == "../bot.urdf"
    assert [(k.link, k.parent, k.calibration, k.first_channel, k.bus) for k in found.links] == [
        ("arm", "base", "arm.calibration.json", 0, None),
        ("hand", "arm", "hand.calibration.json", 0, None),
    ]
    before = (robot / "out" / "robot.json").stat().st_ino
    assert main(["fit", str(robot), "-o", str(robot / "out")]) == 0
    assert (robot / "out" / "robot.json").stat().st_ino == before and load_robot_set(robot / "out") == found


def test_check_warns_of_channels_that_two_links_without_a_bus_use(robot, capsys):
    """Each may have its own readings."""
    code, lines = check(robot, capsys)
    taxels = len(load(robot / "out" / "arm.calibration.json").ids)
    words = f'("hand") has channel 0, as "arm" has; {taxels} in all; name their buses if each has its own readings'
    assert code == 0 and f"warning: /links/1 {words} [duplicate-channel]" in lines
    assert set(Body.load(robot / "out").skins) == set(LINKS)


def test_body_loads_the_noise_of_its_links(robot):
    """Of those that have a file in the folder; the file of another link is refused."""
    out, rows = robot / "out", np.random.default_rng(0).normal(size=(100, 500))
    body = Body.load(out)
    body.skins["arm"].tare(rows[:, : body.skins["arm"].reading_length])
    body.skins["arm"].save_noise(out / "arm.noise.json")
    skins = Body.load(out, noise=out).skins
    assert skins["arm"].noise is not None and skins["hand"].noise is None
    shutil.copy(out / "arm.noise.json", out / "hand.noise.json")
    with pytest.raises(CalibrationFormatError, match="hand.noise.json"):
        Body.load(out, noise=out)


def test_calibration_whose_plan_is_lost_is_named(robot, capsys):
    """By check and fit, as long as there are other plans; a folder of calibrations alone is one for a controller."""
    path = next(robot.glob("*.plan.json"))
    name = path.name.replace(".plan.json", ".calibration.json")
    os.rename(path, path.with_suffix(".old"))
    capsys.readouterr()
    assert main(["check", str(robot / "out" / name)]) == 0
    assert (
        f"was made from ../{path.name}, which is missing; remove one, or propose again [no-plan]"
        in capsys.readouterr().out
    )
    assert main(["fit", str(robot), "-o", str(robot / "out")]) == 0
    assert f"warning: {name} stays in robot.json, but its plan ../{path.name} is missing" in capsys.readouterr().err
    for other in robot.glob("*.plan.json"):
        other.unlink()
    assert main(["check", str(robot / "out" / name)]) == 0
    assert "no-plan" not in capsys.readouterr().out


@pytest.mark.parametrize(
    "problem",
    [
        *("changed", "no-calibration", "invalid", "unknown-link", "duplicate", "duplicate-channel", "link"),
        *("parent", "first-channel"),
    ],
)
def test_check_finds_what_is_wrong_between_links(robot, capsys, problem):
    path = robot / "out" / "hand.calibration.json"
    if problem == "changed":
        path.write_bytes(path.read_bytes() + b" \n")
    elif problem == "no-calibration":
        path.unlink()
    elif problem == "invalid":
        path.write_text("{")
    elif problem == "duplicate":
        edit(robot, link=["arm", "arm"])
    elif problem == "unknown-link":
        write_urdf(robot, ("arm", "hnad"))
    elif problem == "duplicate-channel":
        edit(robot, bus=["can0", "can0"])
    elif problem == "parent":
        edit(robot, parent=["base", "hand"])
    elif problem == "first-channel":
        edit(robot, first_channel=[0, -5])
    else:
        edit(robot, link=["arm", "foot"])
    code, lines = check(robot, capsys)
    found = [line for line in lines if line.startswith("error: ") and line.endswith(f"[{problem}]")]
    assert code == 1 and found
    named = {"duplicate": '"arm"', **dict.fromkeys(("unknown-link", "duplicate-channel", "parent"), '"hand"')}
    named["first-channel"] = 'is not the lowest channel of "hand", which is 0'
    assert all(named.get(problem, '"hand.calibration.json"') in line for line in found)


@pytest.mark.parametrize("changes", [{"parent": ["hand", None]}, {"first_channel": [777, None]}])
def test_fit_corrects_what_follows_from_the_files(robot, capsys, changes):
    """The parents of the URDF, and the channels of calibrations that are up to date."""
    before = load_robot_set(robot / "out")
    edit(robot, **changes)
    assert main(["fit", str(robot / "bot.urdf"), "-o", str(robot / "out")]) == 0
    assert load_robot_set(robot / "out") == before and check(robot, capsys)[0] == 0


def test_calibration_of_another_link_is_not_kept(robot, capsys):
    """Two files are exchanged: both links are fitted, with a warning."""
    save_mesh(cylinder(around=20, along=8), robot / "hand.ply")
    assert main(["fit", str(robot / "bot.urdf"), "-o", str(robot / "out")]) == 0
    arm, hand = (robot / "out" / f"{name}.calibration.json" for name in LINKS)
    right = arm.read_bytes(), hand.read_bytes()
    arm.write_bytes(right[1])
    hand.write_bytes(right[0])
    capsys.readouterr()
    assert main(["fit", str(robot / "bot.urdf"), "-o", str(robot / "out")]) == 0
    out, err = capsys.readouterr()
    assert "2 links: 2 fitted" in out and err.count("The calibration was changed after its last fit") == 2
    assert (arm.read_bytes(), hand.read_bytes()) == right and check(robot, capsys)[0] == 0


def test_buses_of_the_author_stay_and_separate_channels(robot, capsys):
    edit(robot, bus=["can0", "can1"])
    assert main(["fit", str(robot), "-o", str(robot / "out")]) == 0
    assert [link.bus for link in load_robot_set(robot / "out").links] == ["can0", "can1"]
    assert check(robot, capsys)[0] == 0


def test_body_has_the_skins_of_all_links(robot):
    edit(robot, bus=["can0", "can1"])
    for path in (robot / "out", robot / "out" / "robot.json"):
        body = Body.load(path)
        assert [warning.code for warning in body.warnings] == ["duplicate-id"]
        assert set(body.skins) == set(LINKS)
    alone = load(robot / "out" / "hand.calibration.json")
    readings = np.linspace(0.5, 3, alone.reading_length)
    frame = body.update({"arm": 0 * readings, "hand": readings}, 0.0, {"arm": np.eye(4), "hand": np.eye(4)})
    assert (frame.links["hand"].forces == alone.update(readings, 0.0).forces).all()


def test_body_refuses_a_changed_calibration(robot):
    """The file may be another skin; a fit of the folder accepts it."""
    path = robot / "out" / "arm.calibration.json"
    path.write_bytes(path.read_bytes() + b"\n")
    with pytest.raises(CalibrationFormatError, match="has changed since robot.json was written.*Fit the plans"):
        Body.load(robot / "out")
    assert main(["fit", str(robot), "-o", str(robot / "out")]) == 0
    assert set(Body.load(robot / "out").skins) == set(LINKS)


@pytest.mark.parametrize("name", ["../arm.calibration.json", "/etc/passwd", "a\\b"])
def test_calibrations_outside_of_the_folder_are_refused(robot, name):
    edit(robot, calibration=[name])
    with pytest.raises(CalibrationFormatError, match="/links/0/calibration"):
        Body.load(robot / "out")


def test_several_calibrations_of_one_link_are_no_robot(robot, capsys):
    """Without a URDF no file is written; a file that is there stays, with an error."""
    write_plan(robot, "other", link="arm", mesh="arm.ply")
    before = (robot / "out" / "robot.json").read_bytes()
    assert main(["fit", str(robot), "-o", str(robot / "out")]) == 1
    words = 'arm.calibration.json and other.calibration.json are of the same link "arm". Remove one of them'
    assert f"robot.json is not up to date: {words}" in capsys.readouterr().err
    assert (robot / "out" / "robot.json").read_bytes() == before
    shutil.copytree(robot / "out", robot / "new", ignore=lambda *_: ["robot.json"])
    assert main(["fit", str(robot), "-o", str(robot / "new")]) == 0
    assert not (robot / "new" / "robot.json").exists() and capsys.readouterr().err == ""
    assert main(["check", str(robot / "new")]) == 0
    assert 'calibration.json are of the same link "arm" [no-robot]' in capsys.readouterr().out


def test_calibrations_that_the_set_does_not_list_are_errors(robot, capsys):
    """Of a link that the loaded robot then lacks, of a link that it has, and one that cannot be read."""
    edit(robot, bus=["can0", "can1"])
    path = robot / "out" / "robot.json"
    document = json.loads(path.read_text())
    document["links"].pop()  # the hand
    path.write_text(json.dumps(document))
    (robot / "out" / "copy.calibration.json").write_bytes((robot / "out" / "arm.calibration.json").read_bytes())
    (robot / "out" / "other.calibration.json").write_text("{")
    code, lines = check(robot, capsys)
    same = 'which is of the link "arm", as "arm.calibration.json" is; remove one, and fit again [same-link]'
    lines = [line for line in lines if line.startswith("error: /links")]
    assert code == 1 and len(lines) == 3 and f'error: /links does not list "copy.calibration.json", {same}' == lines[0]
    assert 'does not list "hand.calibration.json", which is of the link "hand"' in lines[1] and "other" in lines[2]
    assert main(["show", str(robot / "out")]) == 1 and capsys.readouterr().err.count("does not list") == 3
    body = Body.load(robot / "out")  # a controller continues without them, and can know it
    assert set(body.skins) == {"arm"} and {warning.severity for warning in body.warnings} == {"warning"}
    assert [warning.code for warning in body.warnings] == ["same-link", "not-listed", "not-listed"]
    assert f'{path}: /links does not list "hand.calibration.json"' in str(body.warnings[1])


def test_folder_without_the_set_says_so(robot, capsys):
    """As after Ctrl+C: every command that needs the set names the one that writes it, and check warns."""
    out = robot / "out"
    (out / "robot.json").unlink()
    code, lines = check(robot, capsys)
    assert code == 0 and lines[-1] == f"{out / 'robot.json'}: 0 errors, 1 warning"
    words = "fit into this folder again, which writes it [no-robot]"
    assert lines[-2] == f"warning: robot.json is missing, and the links are no robot without it: {words}"
    words = f"'{out}': it is a folder without robot.json, which lists the calibrations of a robot. It is written by"
    for call in (["show"], ["export", "--to", "mjcf", "-o", str(robot / "robot.xml")]):
        assert main([*call, str(out)]) == 1
        assert words in capsys.readouterr().err
    with pytest.raises(CalibrationFormatError, match="a folder without robot.json"):
        Body.load(out)
    assert main(["fit", str(robot), "-o", str(out)]) == 0 and check(robot, capsys)[0] == 0
    for name in ("arm", "hand"):  # a folder that is not of a fit
        os.remove(out / f"{name}.sources.json")
    (out / "robot.json").unlink()
    assert not check(robot, capsys)[1]


@pytest.mark.parametrize(
    "command",
    [slow(["show", "out", "--picture", "bot.png"]), ["export", "out", "--to", "mjcf", "-o", "b.xml"]],
)
def test_changed_urdf_is_named_where_it_is_used(robot, capsys, monkeypatch, command):
    """The skins were not compared with it; ``check`` says the same."""
    monkeypatch.chdir(robot)
    if "--picture" in command:
        pytest.importorskip("matplotlib")
    if "export" in command:
        pytest.importorskip("mujoco")
    capsys.readouterr()
    assert main(command) == 0 and "outdated" not in capsys.readouterr().err
    urdf = robot / "bot.urdf"
    urdf.write_text(
        urdf.read_text().replace('name="b" type="revolute">', 'name="b" type="fixed"><origin xyz="0 0 1"/>')
    )
    assert main(command) == 0
    assert "warning: /urdf/file has changed; fit the plans again, with this URDF" in capsys.readouterr().err
    assert "/urdf/file has changed; fit the plans again" in " ".join(check(robot, capsys)[1])


def test_buses_of_chains_stay_and_separate_channels(robot, capsys):
    """A chain has its own bus, or that of the link; one that exists no more is named."""
    cells = [[0, 0], [1, 0], [2, 0], [0, 3], [1, 3]]
    boards = {"name": "boards", "kind": "hexagons", "side": 0.006, "gap": 0, "cells": cells}
    write_plan(robot, "hand", link="hand", mesh="hand.ply", skins=[boards])
    assert main(["fit", str(robot / "bot.urdf"), "-o", str(robot / "out")]) == 0
    path = robot / "out" / "robot.json"
    arm, hand = json.loads(path.read_text())["links"]
    assert "chains" not in arm  # a sheet
    three, two = {"first_channel": 0, "boards": 3, "bus": None}, {"first_channel": 3, "boards": 2, "bus": None}
    assert hand["chains"] == [three, two]
    edit(robot, bus=["can0", "can1"], chains=[[], [three, two | {"bus": "can0"}]])
    assert '("hand") has channel 3 of bus can0, as "arm" has; 2 in all' in "".join(check(robot, capsys)[1])
    edit(robot, chains=[[], [three, two | {"bus": "can2"}]])
    assert main(["fit", str(robot / "bot.urdf"), "-o", str(robot / "out")]) == 0  # keeps it
    assert check(robot, capsys)[0] == 0 and main(["show", str(path)]) == 0
    out = capsys.readouterr().out
    assert "bus can1: 1 chain of boards, 3 channels\nbus can2: 1 chain of boards, 2 channels\n" in out
    assert re.search(r"^hand +arm +1 +5 +0 to 4 +2 of 2 to 3 boards +can1, can2 ", out, re.M)
    edit(robot, chains=[[], [three]])
    assert any("are not the chains" in line and "[chains]" in line for line in check(robot, capsys)[1])
    edit(robot, chains=[[], [three, two | {"bus": "can2"}]])
    write_plan(robot, "hand", link="hand", mesh="hand.ply", skins=[boards | {"cells": cells[:3]}])
    capsys.readouterr()
    assert main(["fit", str(robot / "bot.urdf"), "-o", str(robot / "out")]) == 0
    assert "robot.json does not name the bus of channel 3 of hand any more" in capsys.readouterr().err
