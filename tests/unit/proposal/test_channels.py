"""No channel of a robot is used twice, whatever was proposed before."""

import json
from pathlib import Path

import pytest

from skin_calib_addon.cli import main
from skin_calib_addon.commands import propose
from skin_calib_addon.geometry.grid.grids import Across, Grid, Size
from skin_calib_addon.geometry.mesh.cover import CoverSpec
from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh
from skin_calib_addon.plan import load_plan
from skin_calib_addon.plan.plan import Plan, Surface
from skin_calib_addon.plan.skins import BoardSkin, SheetSkin, following_channel
from skin_calib_addon.proposal.links import Outcome
from skin_calib_addon.proposal.proposal import Proposal
from skin_calib_addon.skin.lattice import HexLattice, SheetLattice
from tests.shapes import box

SURFACE = Surface(CoverSpec("seen"), Grid(Across(normal=(0.0, 0.0, 1.0)), Size(5, 5), "uniform"), name="top")
SHEET = SheetSkin("skin", SheetLattice(3, 5, (0.01, 0.01)), None, (1.0, 0.0, 0.0), trim=True)
BOARDS = BoardSkin("boards", HexLattice(0.008, 0.0), ((0, 0), (1, 0)))
LINKS = ("one", "two", "three")


@pytest.fixture
def propose_links(tmp_path, monkeypatch):
    """A robot of three links; each gets a sheet of which all cells but one are cut off, and two boards.

    A link can be refused: no skin fits on it (True), or its proposal fails (False).
    """
    refused: dict[str, bool] = {}

    def stub(task):
        if task.link in refused:
            return Outcome(task, Proposal(task.link, None, ("No skin.",)) if refused[task.link] else None, "Broken.")
        plan = Plan(task.link, task.file.absolute(), "m", (SURFACE,), (SHEET, BOARDS))
        return Outcome(task, Proposal(task.link, plan, ("",), 1e-2, 1e-2, 1e-2, taxels=3))

    monkeypatch.setattr(propose, "propose_task", stub)
    save_mesh(box((0, 0, 0), (0.1, 0.1, 0.1)), tmp_path / "box.ply")
    mesh = '<visual><geometry><mesh filename="box.ply"/></geometry></visual>'
    (tmp_path / "robot.urdf").write_text(
        '<robot name="r">' + "".join(f'<link name="{link}">{mesh}</link>' for link in LINKS) + "</robot>"
    )

    def call(*words, code=0, **without):
        refused.clear()
        refused.update(without)
        assert main(["propose", str(tmp_path / "robot.urdf"), "-o", str(tmp_path / "plans"), *words]) == code
        return tmp_path / "plans"

    return call


def channels(folder: Path) -> list[int]:
    """Return the channels of all plans."""
    found = []
    for path in folder.glob("*.plan.json"):
        following = 0
        for skin in load_plan(path).skins:
            following = following if skin.first_channel is None else skin.first_channel
            found += range(following, following + skin.count)
            following += skin.count
    return found


def test_trimmed_sheets_have_channels_for_all_cells(propose_links):
    """Cells that are cut off have channels without taxels."""
    found = channels(propose_links())
    assert sorted(found) == list(range(3 * 17))


def test_new_plans_follow_those_that_stay(propose_links, capsys):
    """Also those of links that --only leaves out, and with --again."""
    propose_links("--only", "two")
    propose_links("--only", "one")
    found = channels(propose_links())
    assert len(found) == len(set(found)) == 3 * 17
    found = channels(propose_links("--again", "--only", "two"))
    assert len(found) == len(set(found)) == 3 * 17
    assert "not known" not in capsys.readouterr().out


def test_link_without_skin_keeps_no_earlier_files(propose_links, capsys):
    """With --again they have other names, because a person may have edited them; each time new ones."""
    folder = propose_links()
    calibration = folder / "two.calibration.json"
    for old in ("old", "old1"):
        (folder / "two.plan.json").write_text(old)
        calibration.write_text(old)
        propose_links(two=True)  # without --again it is kept
        assert calibration.exists() and "two    kept: " in capsys.readouterr().out
        found = channels(propose_links("--again", two=True))
        names = f"two.plan.json.{old}, two.calibration.json.{old}"
        line = f"two    no plan: No skin. Its earlier files have other names now: {names}."
        assert line in capsys.readouterr().out.splitlines() and sorted(found) == list(range(2 * 17))
        assert all((folder / name).read_text() == old for name in names.split(", ")) and not calibration.exists()
    propose_links("--again", two=True)
    assert "two    no plan: No skin." in capsys.readouterr().out.splitlines()


def test_channels_of_a_link_that_fails_are_not_used(propose_links):
    """Its earlier plan stays, also with --again."""
    propose_links()
    found = channels(propose_links("--again", code=1, two=False))
    assert len(found) == len(set(found)) == 3 * 17


def test_plan_with_an_unknown_number_of_boards_is_named(propose_links, capsys):
    """How many boards fill a surface is known after the fit."""
    path = propose_links("--only", "one") / "one.plan.json"
    document = json.loads(path.read_text())
    document["skins"][1]["cells"] = "fill"
    path.write_text(json.dumps(document))
    assert following_channel(load_plan(path).skins) is None
    propose_links()
    assert "one    kept: its plan exists; --again replaces it. Its channels are not known" in capsys.readouterr().out


def test_following_channel_is_after_the_last_one():
    """Skins may be in any order of channels."""
    first, second = (
        BoardSkin(name, HexLattice(0.008, 0.0), ((0, 0),), first_channel=n) for name, n in (("a", 9), ("b", 2))
    )
    assert following_channel((first, second)) == 10
    assert following_channel(()) == 0
