"""A robot of MuJoCo becomes a URDF with the same poses, shapes and masses; MuJoCo itself says what they are."""

from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.cli import main
from skin_calib_addon.robot.from_mjcf import as_urdf
from skin_calib_addon.robot.kinematics import link_poses
from skin_calib_addon.robot.link_mesh import load_urdf_meshes
from skin_calib_addon.robot.urdf import read_robot

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")

ROBOT = """<mujoco model="arm"><compiler angle="radian"/><asset>
  <mesh name="wedge" vertex="0 0 0 .2 0 0 0 .1 0 0 0 .3"/></asset>
<worldbody><geom type="plane" size="1 1 .1"/>
 <body name="base" pos=".1 .2 .3" quat=".9 .1 -.3 .2">
  <geom type="box" size=".1 .05 .02" pos=".01 .02 .03" euler=".3 .2 .1"/>
  <body name="upper" pos="0 .1 .2" euler=".4 -.2 .9"><joint name="a" axis="0 .6 .8" pos=".01 -.02 .03" range="-1 2"/>
   <joint name="b" type="slide" axis="1 0 0" range="-.1 .3"/>
   <geom type="mesh" mesh="wedge" contype="0" conaffinity="0" pos=".02 0 .01"/><geom type="sphere" size=".4"/>
   <body name="hand" pos="0 0 .3"><joint name="c" axis="0 1 0" pos="0 0 0" ref=".2" range="-.5 .5"/>
    <geom type="capsule" size=".02 .05"/></body></body></body>
</worldbody></mujoco>"""


@pytest.fixture
def files(tmp_path):
    """The MJCF file, and the URDF made of it."""
    (tmp_path / "arm.xml").write_text(ROBOT)
    return tmp_path / "arm.xml", as_urdf(tmp_path / "arm.xml", tmp_path / "plans")


def test_poses_are_those_of_mujoco(files):
    """Anchors away from the body, two joints of one body, and a reference that is not zero."""
    model = mujoco.MjModel.from_xml_path(str(files[0]))
    data, robot = mujoco.MjData(model), read_robot(files[1])
    for seed in range(5):
        moved = np.random.default_rng(seed).uniform(-0.3, 0.3, 3)
        data.qpos[:] = model.qpos0 + moved
        mujoco.mj_kinematics(model, data)
        poses = link_poses(robot, dict(zip("abc", moved.tolist())))
        root = data.body("base")
        for link in ("upper", "hand"):
            expected = root.xmat.reshape(3, 3).T @ (data.body(link).xpos - root.xpos)
            assert_allclose(poses[link][:3, 3], expected, rtol=0, atol=1e-12)
            turn = root.xmat.reshape(3, 3).T @ data.body(link).xmat.reshape(3, 3)
            assert_allclose(poses[link][:3, :3], turn, rtol=0, atol=1e-12)
    assert_allclose(robot.joints["c"].limits, (-0.7, 0.3), atol=1e-12)


def test_shapes_and_masses_are_those_of_mujoco(files):
    """What does not collide is the link, or all if there is nothing else; the sphere around the wedge is not."""
    meshes, problems = load_urdf_meshes(files[1], read_robot(files[1]))
    assert not problems
    areas = {link: float(mesh.face_areas.sum()) for link, mesh in meshes.items()}
    wedge = 0.5 * (0.02 + 0.06 + 0.03) + 0.5 * np.linalg.norm(np.cross((-0.2, 0.1, 0), (-0.2, 0, 0.3)))
    assert_allclose(areas["upper"], wedge, rtol=1e-5)
    assert_allclose(meshes["upper"].vertices.min(axis=0), (0.02, 0, 0.01), atol=1e-6)
    assert_allclose(areas["base"], 8 * (0.1 * 0.05 + 0.1 * 0.02 + 0.05 * 0.02), rtol=1e-5)
    mass = ElementTree.parse(files[1]).find("link[@name='hand']/inertial/mass").get("value")
    assert_allclose(float(mass), mujoco.MjModel.from_xml_path(str(files[0])).body("hand").mass, rtol=1e-8)


def test_other_descriptions_are_named(tmp_path, capsys):
    """A template of a URDF, and XML of another program."""
    for name, words in (("arm.urdf.xacro", "Run: xacro "), ("arm.xml", "has no <mujoco>")):
        (tmp_path / name).write_text("<robot/>")
        assert main(["propose", str(tmp_path / name), "-o", str(tmp_path / "plans")]) == 1
        assert words in capsys.readouterr().err
    (tmp_path / "arm.xml").write_text("<mujoco><worldbody><body/></worldbody><no/></mujoco>")
    assert main(["propose", str(tmp_path / "arm.xml"), "-o", str(tmp_path / "plans")]) == 1
    assert "MuJoCo does not accept arm.xml" in capsys.readouterr().err and not (tmp_path / "plans").exists()


def test_names_that_files_cannot_have_keep_their_own_meshes(tmp_path):
    """ "a/b" and "a_b" keep their own meshes, in the folder."""
    body = '<body name="{0}"><geom type="box" size="{1} .1 .1"/></body>'
    (tmp_path / "r.xml").write_text(
        f"<mujoco><worldbody>{body.format('a/b', 0.1)}{body.format('a_b', 0.3)}</worldbody></mujoco>"
    )
    urdf = as_urdf(tmp_path / "r.xml", tmp_path / "out")
    meshes, _ = load_urdf_meshes(urdf, read_robot(urdf))
    assert_allclose([np.ptp(meshes[name].vertices[:, 0]) for name in ("a/b", "a_b")], (0.2, 0.6), rtol=1e-6)
