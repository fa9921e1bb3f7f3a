"""Links that are mirror images of each other get plans that are."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from skin_calib_addon.calibration.file import load_calibration
from skin_calib_addon.calibration.model import Touched
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh, weld
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan, plan_document, plan_from, save_plan
from skin_calib_addon.plan.plan import Plan
from skin_calib_addon.plan.skins import BoardSkin, Registered, spot_of
from skin_calib_addon.proposal.links import Task, is_current, plan_path, plan_warnings, propose_task, robot_of
from skin_calib_addon.proposal.moved_plan import moved_plan
from skin_calib_addon.proposal.skins import parse_skin
from skin_calib_addon.robot.mirrored import Twin
from skin_calib_addon.skin import HexLattice, lay_boards
from tests.shapes import box, plane_surface
from tests.unit.commands.test_cli import PLAN, planes

MIRROR = np.array((1.0, -1.0, 1.0))
SECTOR = {"kind": "patch", "from": -0.4, "to": 1.3, "margin": 0.03, "n": 6, "lines": 8}
URDF = """<robot name="arms"><link name="body"/>
  <link name="left"><visual><geometry><mesh filename="left.ply"/></geometry></visual></link>
  <link name="right"><visual><geometry><mesh filename="right.ply"/></geometry></visual></link>
  <joint name="left_joint" type="revolute"><parent link="body"/><child link="left"/><origin xyz="0 0.3 0"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="right_joint" type="revolute"><parent link="body"/><child link="right"/><origin xyz="0 -0.3 0"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


def arm():
    """A skewed arm without a plane of symmetry, with rounded edges."""
    ball = trimesh.creation.icosphere(3)
    rounded = ball.vertices / (ball.vertices**4).sum(axis=1, keepdims=True) ** 0.25
    x, y, z = (rounded * (0.05, 0.035, 0.09)).T
    return weld(np.column_stack((x + 0.15 * z + 0.1 * y, y * (1 + 2 * z), z)), ball.faces)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The robot; its right mesh is reflected, with its faces in another order and start."""
    folder = tmp_path_factory.mktemp("arms")
    left = arm()
    save_mesh(left, folder / "left.ply")
    right = weld((left.vertices * MIRROR)[::-1], len(left.vertices) - 1 - left.faces[::-1, ::-1])
    save_mesh(right, folder / "right.ply")
    (folder / "arms.urdf").write_text(URDF)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("skin", ["hexagons", "sheet:6x8x8mm"])
def test_right_taxels_are_the_reflected_left_ones(folder, tmp_path, capsys, skin):
    """Each taxel, to 0.01 mm and 0.001 rad; normals point outward on both. No channel and no id is used twice."""
    assert main(["fit", str(folder / "arms.urdf"), "--propose", "-o", str(tmp_path / "out"), "--skin", skin]) == 0
    left, right = (load_calibration(tmp_path / "out" / f"{side}.calibration.json") for side in ("left", "right"))
    assert "mirror image of left" in load_plan(tmp_path / "out" / "right.plan.json").extra["x_proposal"][0]
    assert len(left.patches) == len(right.patches) > 0
    for a, b in zip(left.patches, right.patches):
        assert len(a.taxels.ids) == len(b.taxels.ids) > 0
        np.testing.assert_allclose(a.taxels.positions_link * MIRROR, b.taxels.positions_link, atol=1e-5)
        np.testing.assert_allclose(a.taxels.normals_link * MIRROR, b.taxels.normals_link, atol=1e-3)
    assert sum(len(patch.taxels.ids) for patch in left.patches) > 20
    channels = np.concatenate([p.taxels.channels for c in (left, right) for p in c.patches])
    assert len(set(channels.tolist())) == len(channels)
    capsys.readouterr()
    assert main(["check", str(tmp_path / "out")]) == 0
    assert "robot.json: 0 errors, 0 warnings" in capsys.readouterr().out


@pytest.mark.slow
def test_link_with_another_joint_range_gets_its_own_plan(folder, tmp_path):
    """The right arm can turn to where a wall covers it; the left one cannot."""
    text = URDF.replace('name="left_joint" type="revolute"', 'name="left_joint" type="fixed"')
    text = text.replace('lower="-1" upper="1"', 'lower="-1.5" upper="1.5"')
    wall = '<link name="wall"><visual><geometry><mesh filename="wall.ply"/></geometry></visual></link>'
    joint = '<joint name="j" type="fixed"><parent link="body"/><child link="wall"/><origin xyz="0.1 0 0"/></joint>'
    (folder / "other.urdf").write_text(text.replace("</robot>", wall + joint + "</robot>"))
    save_mesh(box((-0.01, -0.5, -0.01), (0.01, 0.5, 0.01)), folder / "wall.ply")
    assert main(["propose", str(folder / "other.urdf"), "-o", str(tmp_path), "--only", "*t"]) == 0
    right = load_plan(tmp_path / "right.plan.json")
    words = r"The link is the mirror image of left, but has its own layout: \d+ instead of \d+ cm\^2 are free\."
    assert re.fullmatch(words, right.extra["x_proposal"][0])


def test_links_of_a_pair_keep_only_the_boards_that_fit_on_both(tmp_path):
    """A pit in the right plate, which is small enough for a pair, takes the same boards from both."""
    plate = trimesh.creation.box((0.07, 0.05, 0.024)).subdivide().subdivide().subdivide()
    pit = plate.vertices * MIRROR
    pit[np.linalg.norm(pit - (0.02, -0.01, 0.012), axis=1).argmin(), 2] -= 0.006
    save_mesh(weld(plate.vertices, plate.faces), tmp_path / "left.ply")
    save_mesh(weld(pit, plate.faces[:, ::-1]), tmp_path / "right.ply")
    (tmp_path / "arms.urdf").write_text(URDF)
    robot_of.cache_clear()
    left, right = (
        propose_task(Task(tmp_path / "arms.urdf", "m", side, parse_skin("hexagons:8mm"))).proposal
        for side in ("left", "right")
    )
    back = moved_plan(right.plan, "left", robot_of(tmp_path / "arms.urdf").twins["right"].inverse("right"))
    assert [skin.choice for skin in back.skins] == [skin.choice for skin in left.plan.skins]
    assert left.taxels == right.taxels > 20 and left.chains == right.chains
    lost = int(re.match(r"right has the mirrored layout, for which (\d+) taxels are left out", left.reasons[0])[1])
    assert f"without {lost} taxels of it. Over an edge or off the mesh here: {lost}." in right.reasons[0]
    for proposal in (left, right):
        save_plan(proposal.plan, plan_path(tmp_path, proposal.link))
    save_mesh(weld(plate.vertices * MIRROR, plate.faces[:, ::-1]), tmp_path / "right.ply")  # without the pit
    for proposal in (left, right):
        path = plan_path(tmp_path, proposal.link)
        assert not is_current(path, Task(tmp_path / "arms.urdf", "m", proposal.link, parse_skin("hexagons:8mm")))
    assert "The mesh of the link right has changed" in " ".join(plan_warnings(plan_path(tmp_path, "left")))


def test_moved_plan_is_what_its_file_gives():
    """Also where the twin is shifted: across a face, only the direction of an axis counts."""
    axis, cut = {"point": [0, 0, 0], "direction": [1, 0, 0]}, {"point": [0.1, 0.2, 0.3], "normal": [0, 1, 0]}
    grid = {"kind": "patch", "normal": [0, 0, 1], "axis": axis, "n": 6, "lines": 5}
    surface = {"name": "palm", "cover": {"cuts": [cut]}, "grid": grid}
    document = {"format": "skin-plan", "version": 2, "link": "left", "mesh": "left.ply", "unit": "m", "skins": []}
    plan = plan_from(document | {"surfaces": [surface]})
    shift = np.diag((1.0, -1.0, 1.0, 1.0))
    shift[:3, 3] = 1e-5, -2e-5, 3e-5
    moved = moved_plan(plan, "right", Twin("left", shift))
    assert plan_from(plan_document(moved)) == moved
    (found,) = moved.surfaces[0].cover.cuts
    assert found.point == pytest.approx((0.10001, -0.20002, 0.30003)) and found.normal == (0, -1, 0)


@pytest.fixture(scope="module")
def of_arm():
    """A plan with a sheet and boards on a sector that is no mirror image of itself, and its taxels."""
    axis = {"point": [0, 0, 0], "direction": [0.15, 0, 1]}
    grid = {"kind": "patch", "axis": axis, "from": -0.4, "to": 1.3, "margin": 0.03, "n": 6, "lines": 8}
    grid["spacing"] = "uniform"
    place = {"origin": [0.05, 0.02, 0.0], "direction": [0.2, 1, 0.3]}
    cells = [[0, 0], [1, 0], [0, 1], [-1, 2]]
    skins = [
        {"name": "s", "kind": "sheet", "rows": 3, "columns": 4, "pitch": [0.006, 0.008], "hand": "left"} | place,
        {"name": "b", "kind": "hexagons", "side": 0.006, "cells": cells} | place,
        # Along the lines of the surface, with a board that is disabled, a screw, and the place of its mount.
        {"name": "c", "kind": "hexagons", "side": 0.005, "cells": [[0, 0], [1, 0], [0, 1], [2, 1], [-1, 2]]}
        | {"origin": [0.045, 0.02, -0.035], "taxels": [{"taxel": "2.1", "enabled": False}]}
        | {"excluded": [{"point": [0.05, 0.02, 0.07], "radius": 0.004}]}
        | {"registration": {"anchor": [0.045, 0.02, -0.035]}},
    ]
    document = {"format": "skin-plan", "version": 1, "link": "left", "mesh": "left.ply", "unit": "m"}
    plan = plan_from(document | {"grid": grid, "skins": skins})
    return plan, calibrate(plan, arm()).calibration


@pytest.mark.parametrize("mirrored", [True, False])
def test_skins_of_a_moved_plan_are_the_moved_skins(of_arm, mirrored):
    """Each taxel of the twin is that of the link."""
    transform, side = np.eye(4), -1 if mirrored else 1
    transform[:3, :3] = Rotation.from_euler("xyz", (0.3, -0.2, 0.5)).as_matrix() @ np.diag((1, side, 1))
    transform[:3, 3] = 0.05, -0.1, 0.2
    plan, here = of_arm
    mesh = arm()
    faces = mesh.faces[:, ::-1] if mirrored else mesh.faces
    there = weld(mesh.vertices @ transform[:3, :3].T + transform[:3, 3], faces)
    found = calibrate(moved_plan(plan, "right", Twin("left", transform)), there).calibration
    for a, b in zip(here.patches, found.patches):
        assert len(a.taxels.ids) == len(b.taxels.ids) > 3
        expected = a.taxels.positions_link @ transform[:3, :3].T + transform[:3, 3]
        np.testing.assert_allclose(b.taxels.positions_link, expected, atol=5e-5)
        np.testing.assert_allclose(b.taxels.normals_link, a.taxels.normals_link @ transform[:3, :3].T, atol=1e-3)
        for name in a.taxels.quality.keys() & {"overhang", "gap"}:
            np.testing.assert_allclose(b.taxels.quality[name], a.taxels.quality[name], atol=5e-5)
    touched = Touched(
        "2026-11-29", "", 9, 0, (0.0, 0.0), 0.0, ((1e-6, 0, 0), (0, 1e-6, 0), (0, 0, 1e-4)), (0, 0, 0), 1e-3
    )
    skins = tuple(replace(skin, touches=Registered(touched, spot_of(skin))) for skin in plan.skins)
    moved = moved_plan(replace(plan, skins=skins), "right", Twin("left", transform)).skins[2]
    assert moved.touches is None  # nobody touched the twin
    for old, new in (
        (plan.skins[2].excluded[0].point, moved.excluded[0].point),
        (plan.skins[2].registration.anchor, moved.registration.anchor),
    ):
        np.testing.assert_allclose(new, transform[:3, :3] @ old + transform[:3, 3], atol=1e-6)


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"grid": planes((0.0, 0.05, 0.1, 0.15))}, "planes placed by hand"),
        ({"grid": SECTOR}, "a sector about an automatic axis"),
        ({"skins": [{"name": "s", "kind": "imported", "file": "a.ini"}]}, "taxels of a file"),
    ],
)
def test_plan_that_has_no_copy_is_refused(changes, words):
    """Its numbers mean another place on the twin."""
    plan = plan_from(PLAN | changes)
    with pytest.raises(InvalidPlan, match=words):
        moved_plan(plan, "right", Twin("left", np.diag((1.0, -1, 1, 1))))


def test_mirrored_board_shifted_from_its_place():
    """On a plane: its position is the reflected one, and a row of it has the reflected direction."""
    listed = ((0, 0), (1, 1, 0.002, -0.003, 0.15))
    skin = BoardSkin("boards", HexLattice(0.008, 0.0), listed, (0.1, 0.0, 0.0), (1.0, 0.2, 0.0))
    plan = Plan("right", Path("right.ply"), "m", (), (skin,))
    (back,) = moved_plan(plan, "left", Twin("right", np.diag((*MIRROR, 1.0)))).skins
    surface = plane_surface(0.2, 0.2)
    one, other = (
        lay_boards(surface, own.lattice, own.choice, np.add(own.origin, (0, 0.1, 0)), own.direction)[0]
        for own in (skin, back)
    )
    np.testing.assert_allclose((one.points - (0, 0.1, 0)) * MIRROR, other.points - (0, 0.1, 0), atol=1e-6)
    np.testing.assert_allclose(one.tangents[1] * MIRROR, other.tangents[1], atol=1e-5)
