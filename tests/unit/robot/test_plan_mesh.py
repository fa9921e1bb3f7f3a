"""A plan whose mesh is a URDF: all visual meshes of its link, through every command."""

import json

import numpy as np
import pytest
import trimesh

from skin_calib_addon.calibration.file import load_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import InvalidMesh, InvalidPlan
from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh, weld
from skin_calib_addon.plan import load_plan
from skin_calib_addon.robot.link_mesh import load_plan_mesh, load_urdf_mesh
from tests.shapes import LENGTH, box, cylinder, together
from tests.unit.commands.test_cli import write_plan
from tests.unit.robot.test_robot_mesh import shape

MM = "0.001 -0.001 0.001"
TUBE = cylinder(around=24, along=8)
INNER = box((-0.01, -0.01, 0.01), (0.01, 0.01, LENGTH - 0.01))


@pytest.fixture
def robot(tmp_path):
    """A robot with a tube, mirrored, in millimetres and moved, and a box within it; a plan, and a folder ``out``."""
    for folder in ("bot/meshes", "plans", "out"):
        (tmp_path / folder).mkdir(parents=True)
    raw = weld((TUBE.vertices - (0, 0, 0.25)) * (1000, -1000, 1000), TUBE.faces[:, ::-1])
    trimesh.Trimesh(raw.vertices, raw.faces, process=False).export(tmp_path / "bot" / "meshes" / "tube.STL")
    save_mesh(INNER, tmp_path / "bot" / "meshes" / "box.ply")
    shapes = shape("package://bot/meshes/tube.STL", origin='xyz="0 0 0.25"', scale=MM) + shape("meshes/box.ply")
    (tmp_path / "bot" / "bot.urdf").write_text(
        f'<robot name="bot"><link name="base"/><link name="arm">{shapes}</link>'
        '<joint name="j" type="fixed"><parent link="base"/><child link="arm"/></joint></robot>'
    )
    write_plan(tmp_path / "plans", "arm", link="arm", mesh="../bot/bot.urdf")
    return tmp_path


def fit(robot):
    return main(["fit", str(robot / "plans"), "-o", str(robot / "out")])


def test_mesh_is_that_of_the_link(robot):
    """Scaled, mirrored and moved, with all visual meshes, to single precision."""
    mesh = load_plan_mesh(load_plan(robot / "plans" / "arm.plan.json"))
    expected = together(TUBE, INNER)
    assert len(mesh.faces) == len(expected.faces)
    np.testing.assert_allclose(mesh.face_areas.sum(), expected.face_areas.sum(), rtol=1e-6)
    a, b, c = mesh.triangles.transpose(1, 0, 2)
    u, v, w = expected.triangles.transpose(1, 0, 2)
    np.testing.assert_allclose((a * np.cross(b, c)).sum(), (u * np.cross(v, w)).sum(), rtol=1e-5)
    assert (mesh.vertices == mesh.vertices.astype(np.float32)).all()


def test_sources_have_the_urdf_and_its_meshes(robot, capsys):
    """A change of any of them is found by ``check``, and fitted again; the URDF does not contradict its own plan."""
    words = ["fit", str(robot / "bot" / "bot.urdf"), str(robot / "plans"), "-o", str(robot / "out")]
    assert main(words) == 0 and "robot" not in capsys.readouterr().err
    known = json.loads((robot / "out" / "arm.sources.json").read_text())
    assert known["mesh"] == "../bot/bot.urdf"
    mesh, urdf = load_calibration(robot / "out" / "arm.calibration.json").mesh, robot / "bot" / "bot.urdf"
    assert (mesh.file, mesh.sha256) == ("bot.urdf", load_urdf_mesh(urdf, "arm").sha256)
    assert list(known["inputs"]) == [
        *("../plans/arm.plan.json", "../bot/bot.urdf", "../bot/meshes/tube.STL", "../bot/meshes/box.ply")
    ]
    capsys.readouterr()
    assert main(["check", str(robot / "out" / "arm.calibration.json")]) == 0
    assert "bot.urdf is unchanged" in capsys.readouterr().out
    save_mesh(box((-0.01, -0.01, 0.02), (0.01, 0.01, 0.05)), robot / "bot" / "meshes" / "box.ply")
    main(["check", str(robot / "out" / "arm.calibration.json")])
    out = capsys.readouterr().out
    assert "was made from ../bot/meshes/box.ply, which has changed" in out and "mesh has changed" in out
    fit(robot)
    assert "arm.calibration.json: " not in capsys.readouterr().err
    main(["check", str(robot / "out" / "arm.calibration.json")])
    assert "bot.urdf is unchanged" in capsys.readouterr().out


def break_mesh(robot):
    (robot / "bot" / "meshes" / "box.ply").unlink()


def break_link(robot):
    write_plan(robot / "plans", "arm", link="arms", mesh="../bot/bot.urdf")


def break_urdf(robot):
    (robot / "bot" / "bot.urdf").write_text("<robot")


def no_urdf(robot):
    (robot / "bot" / "bot.urdf").unlink()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (break_mesh, "the mesh file meshes/box.ply of bot.urdf was not found"),
        (break_link, 'bot.urdf has no link "arms"; did you mean "arm"?'),
        (break_urdf, "is not XML at column"),
        (no_urdf, "cannot read"),
    ],
)
def test_missing_parts_are_one_line(robot, capsys, change, words):
    """``fit`` fails, ``check`` of the plan warns."""
    change(robot)
    assert fit(robot) == 1
    out, err = capsys.readouterr()
    assert err.count("\n") == 1 and words in err
    assert main(["check", str(robot / "plans" / "arm.plan.json")]) == 0
    assert "[no-mesh]" in capsys.readouterr().out


def test_unit_of_a_urdf_is_the_metre(robot):
    plan = write_plan(robot / "plans", "arm", link="arm", mesh="../bot/bot.urdf", unit="mm")
    with pytest.raises(InvalidPlan, match='The mesh is a URDF, which is in metres. Set "unit" to "m"'):
        load_plan(plan)


def test_wrong_scale_is_found(robot):
    urdf = robot / "bot" / "bot.urdf"
    urdf.write_text(urdf.read_text().replace(MM, "1 1 1"))
    with pytest.raises(InvalidMesh, match="arm has a diameter of .* m in bot.urdf. Correct the scale"):
        load_urdf_mesh(urdf, "arm")
