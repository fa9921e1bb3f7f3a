"""``export --to ros-package``: programs of ROS and independent readers accept what it writes; bad input is one line."""

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.calibration import load_calibration, save_calibration
from skin_calib_addon.calibration.robot_set import RobotSet, UrdfFile, load_robot_set, robot_link, save_robot_set
from skin_calib_addon.cli import main
from skin_calib_addon.common.atomic_file import write_folder_safely
from skin_calib_addon.common.errors import OutputError
from skin_calib_addon.common.file_hash import file_hash
from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh
from skin_calib_addon.messages.scene import SceneMaker
from skin_calib_addon.runtime import Skin
from tests.samples import small_calibration
from tests.shapes import cylinder
from tests.unit.commands.test_cli import assert_refused
from tests.unit.messages.test_messages import rosbags_store

COLCON = "apt install ament-cmake colcon python3-colcon-cmake python3-colcon-ros python3-colcon-recursive-crawl"
COLCON += " python3-colcon-library-path"
LINKS = ("left sole", "arm")
URDF = """<?xml version="1.0"?>
<!-- Übung -->
<robot name="Bot 2&lt;3" xmlns:xacro="http://ros.org/wiki/xacro">
  <!-- stays --><link name="base"/>
  <link name="{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="a/tube 1.ply"/></geometry></visual>
    <collision><geometry><mesh filename="b/tube 1.ply" scale="1 1 2"/></geometry></collision></link>
  <link name="{1}"><visual><geometry><mesh filename="package://other/arm.stl"/></geometry></visual>
    <collision><geometry><mesh filename="a/tube 1.ply"/></geometry></collision></link>
  <joint name="a" type="revolute"><parent link="base"/><child link="{0}"/><origin xyz="1 2 3" rpy="0 0 0.5"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="b" type="fixed"><parent link="{0}"/><child link="{1}"/><origin xyz="0 0 0.3"/></joint>
</robot>
"""


@pytest.fixture
def robot(tmp_path):
    """A folder with a robot: a skin each on two links, meshes next to its URDF and in another package."""
    return write_robot(tmp_path, LINKS)


def write_robot(folder, links, urdf=URDF):
    (folder / "robot").mkdir()
    for part, size in (("a", 24), ("b", 12)):
        (folder / part).mkdir()
        save_mesh(cylinder(around=size, along=8), folder / part / "tube 1.ply")
    (folder / "bot.urdf").write_text(urdf.format(*links), "utf-8")
    for k, link in enumerate(links):
        save_calibration(small_calibration(link=link, rows=2 + k), folder / "robot" / f"{k}.calibration.json")
    parents = ("base", links[0])
    entries = (replace(robot_link(folder / "robot", f"{k}.calibration.json"), parent=parents[k]) for k in range(2))
    used = UrdfFile("../bot.urdf", file_hash(folder / "bot.urdf"))
    save_robot_set(RobotSet("Bot 2<3", used, tuple(entries)), folder / "robot")
    return folder / "robot"


def export(path, out, *more):
    return main(["export", str(path), "--to", "ros-package", "-o", str(out), *more])


@pytest.fixture
def package(robot, tmp_path, capsys):
    """The package of the robot."""
    assert export(robot, f"{tmp_path}/out/") == 0
    capsys.readouterr()
    return tmp_path / "out" / "bot_2_3_skin"


def test_packages_are_those_of_ros(package):
    """catkin_pkg, which colcon uses, reads both without a warning; dependencies have what the launch file starts."""
    parse_package = pytest.importorskip("catkin_pkg.package", reason="pip install catkin_pkg").parse_package
    for folder in (package, package.parent / "skin_calib_msgs"):
        warnings = []
        found = parse_package(folder, warnings=warnings)
        found.validate(warnings=warnings)
        assert not warnings and found.name == folder.name and found.get_build_type() == "ament_cmake"
        assert "ament_cmake" in {depend.name for depend in found.buildtool_depends}
        depends = {depend.name for depend in found.exec_depends}
    assert "geometry_msgs" in depends
    needed = {depend.name for depend in parse_package(package).exec_depends}
    assert needed >= {"robot_state_publisher", "rviz2", "skin_calib_msgs", "rclpy", "launch_ros", "other"}


@pytest.mark.skipif(shutil.which("colcon", path="/usr/bin") is None, reason=f"colcon is not installed: {COLCON}")
def test_colcon_builds_and_installs_the_package(package, tmp_path):
    """With the ament_cmake of Debian. It has no generators of messages: their package is left out."""
    (package.parent / "skin_calib_msgs" / "COLCON_IGNORE").touch()
    paths = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}
    done = subprocess.run(["colcon", "build"], cwd=tmp_path, env=paths, capture_output=True, text=True)
    if "ament_cmakeConfig.cmake" in done.stderr:
        pytest.skip(f"ament_cmake is not installed: {COLCON}")
    assert done.returncode == 0, done.stdout + done.stderr
    installed = tmp_path / "install" / package.name
    (content,) = (path.parent for path in installed.rglob("package.xml"))
    for file in filter(Path.is_file, package.rglob("*")):
        path = file.relative_to(package).as_posix()
        if path not in ("CMakeLists.txt", "scripts/publish_skin"):
            assert (content / path).read_bytes() == file.read_bytes()
    assert os.access(installed / "lib" / package.name / "publish_skin", os.X_OK)
    assert [path.name for path in installed.rglob("resource_index/packages/*")] == [package.name]


@pytest.mark.skipif(
    shutil.which("check_urdf") is None, reason="check_urdf is not installed: apt install liburdfdom-tools"
)
def test_urdf_is_that_of_ros(package):
    """The parser that ROS uses finds all frames below their links."""
    urdf = package / "urdf" / "robot.urdf"
    done = subprocess.run(["check_urdf", urdf], capture_output=True, text=True)
    assert done.returncode == 0 and "root Link: base has 1 child" in done.stdout, done.stdout + done.stderr
    for link in LINKS:
        for patch in load_calibrations(package)[link].patches:
            assert done.stdout.count(f"  {link}/{patch.name}\n") == 1
            assert all(done.stdout.count(f"  {link}/{name}\n") == 1 for name in patch.taxels.ids)


def load_calibrations(package):
    files = sorted((package / "calibration").glob("*.calibration.json"))
    return {calibration.link: calibration for calibration in map(load_calibration, files)}


def test_frames_of_taxels_are_at_the_taxels(package):
    """MuJoCo's kinematics: positions and normals of all taxels in their links; meshes are found in the package."""
    mujoco = pytest.importorskip("mujoco", reason="pip install mujoco")
    text = (package / "urdf" / "robot.urdf").read_text("utf-8")
    assert "<!-- stays -->" in text and text.count('"package://other/arm.stl"') == 1
    assert text.count(f'"package://{package.name}/meshes/tube_1.ply"') == 2
    assert text.count(f'"package://{package.name}/meshes/1_tube_1.ply" scale="1 1 2"') == 1
    for name, part in (("tube_1.ply", "a"), ("1_tube_1.ply", "b")):
        original = package.parents[1] / part / "tube 1.ply"
        assert (package / "meshes" / name).read_bytes() == original.read_bytes()
    spec = mujoco.MjSpec.from_string(re.sub("<visual>.*?</collision>", "", text, flags=re.DOTALL))
    spec.compiler.fusestatic = False
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = 0.3
    mujoco.mj_kinematics(model, data)
    for link, calibration in load_calibrations(package).items():
        body = data.body(link)
        turn = body.xmat.reshape(3, 3)
        for taxels in (patch.taxels for patch in calibration.patches):
            frames = [data.body(f"{link}/{name}") for name in taxels.ids]
            expected = body.xpos + taxels.positions_link @ turn.T
            assert_allclose([frame.xpos for frame in frames], expected, atol=1e-9)
            found = [frame.xmat.reshape(3, 3)[:, 2] for frame in frames]
            assert_allclose(found, taxels.normals_link @ turn.T, atol=1e-9)


def run_script(package, monkeypatch):
    """Run the script with stand-ins for ROS; messages are read by rosbags. Return profile and message of each topic."""
    store, found, calls = rosbags_store(), {}, []

    def create_publisher(kind, topic, profile):
        return SimpleNamespace(publish=lambda message: found.update({topic: (profile, message)}))

    def spin(node):
        calls.append("spin")
        raise KeyboardInterrupt

    rclpy = SimpleNamespace(
        init=lambda: calls.append("init"),
        create_node=lambda name: SimpleNamespace(create_publisher=create_publisher),
        spin=spin,
    )
    parts = {
        "rclpy": vars(rclpy),
        "rclpy.executors": {"ExternalShutdownException": RuntimeError},
        "rclpy.qos": {"QoSProfile": dict, "DurabilityPolicy": SimpleNamespace(TRANSIENT_LOCAL="latched")},
        "rclpy.serialization": {"deserialize_message": store.deserialize_cdr},
        "rosidl_runtime_py": {},
        "rosidl_runtime_py.utilities": {"get_message": lambda name: name},
    }
    use(parts, monkeypatch)
    monkeypatch.setattr(sys, "argv", ["publish_skin", str(package / "messages"), "--ros-args"])
    runpy.run_path(str(package / "scripts" / "publish_skin"), run_name="__main__")
    assert calls == ["init", "spin"]
    return found


def use(parts, monkeypatch):
    """Put modules with these members in the place of packages that cannot be installed here."""
    for name, members in parts.items():
        module = ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)


def test_published_messages_are_layout_and_cells(package, monkeypatch):
    """All latched, in the frames of the links, with the checksum of the calibration; rosbags reads every number."""
    found = run_script(package, monkeypatch)
    assert set(found) == {f"/skin/{link}/{name}" for link in ("left_sole", "arm") for name in ("layout", "cells")}
    assert all(profile == {"depth": 1, "durability": "latched"} for profile, _ in found.values())
    for link, calibration in load_calibrations(package).items():
        skin, topic = Skin(calibration), f"/skin/{link.replace(' ', '_')}"
        layout, cells = found[f"{topic}/layout"][1], found[f"{topic}/cells"][1].markers
        assert (layout.header.frame_id, layout.calibration, tuple(layout.ids)) == (link, skin.checksum, skin.ids)
        assert_array_equal(layout.channels, skin.channels)
        assert_array_equal([(p.x, p.y, p.z) for p in layout.positions], skin.positions)
        assert_array_equal([(n.x, n.y, n.z) for n in layout.normals], skin.normals)
        assert len(cells) == 1 and (cells[0].header.frame_id, cells[0].type, cells[0].frame_locked) == (link, 11, True)
        stamp = cells[0].header.stamp
        assert (stamp.sec, stamp.nanosec) == (0, 0)  # the newest pose of the link
        triangles = SceneMaker(calibration, skin).cells
        assert_array_equal([(p.x, p.y, p.z) for p in cells[0].points], triangles.reshape(-1, 3))


def test_launch_file_starts_what_is_there(package, monkeypatch):
    """With stand-ins for ROS: the description is the URDF, paths exist, the program has the name of the script."""

    def kept(*values, **named):
        return SimpleNamespace(values=values, **named)

    parts = {
        "launch": {"LaunchDescription": list},
        "launch.actions": {"DeclareLaunchArgument": kept},
        "launch.conditions": {"IfCondition": kept},
        "launch.substitutions": {"LaunchConfiguration": kept},
        "launch_ros": {},
        "launch_ros.actions": {"Node": kept},
        "launch_ros.parameter_descriptions": {"ParameterValue": kept},
    }
    use(parts, monkeypatch)
    argument, *nodes = runpy.run_path(str(package / "launch" / "skin.launch.py"))["generate_launch_description"]()
    assert argument.values == ("show",) and argument.default_value == "false"
    by_name = {node.package: node for node in nodes}
    (description,) = by_name["robot_state_publisher"].parameters
    assert description["robot_description"].values == ((package / "urdf" / "robot.urdf").read_text("utf-8"),)
    ours = by_name[package.name]
    assert (package / "scripts" / ours.executable).is_file() and Path(ours.arguments[0]) == package / "messages"
    assert Path(by_name["rviz2"].arguments[1]).is_file()
    shown = {name for name, node in by_name.items() if hasattr(node, "condition")}
    assert shown == {"rviz2", "joint_state_publisher"}


def test_rviz_shows_the_robot_and_all_cells(package):
    """As YAML, with the topics and their durability; the fixed frame is the root of the URDF."""
    yaml = pytest.importorskip("ruamel.yaml", reason="pip install ruamel.yaml").YAML(typ="safe")
    view = yaml.load(package / "rviz" / "skin.rviz")["Visualization Manager"]
    robot, *markers = view["Displays"]
    assert (
        robot["Description Topic"]["Value"] == "/robot_description" and view["Global Options"]["Fixed Frame"] == "base"
    )
    topics = {marker["Topic"]["Value"]: marker["Topic"]["Durability Policy"] for marker in markers}
    latched, live = "Transient Local", "Volatile"
    names = ("left_sole", "arm")
    assert topics == {f"/skin/{n}/cells": latched for n in names} | {f"/skin/{n}/scene": live for n in names}
    assert [marker["Name"] for marker in markers[::2]] == [f"{link} cells" for link in LINKS]


def test_calibrations_in_the_package_are_a_robot(package, robot, capsys):
    """``check`` compares them with the URDF of the package and finds no error; the files are the same."""
    assert main(["check", str(package / "calibration")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.endswith("robot.json: 0 errors, 2 warnings") for line in lines)  # equal channels, equal ids
    assert not [line for line in lines if "urdf" in line]
    assert load_robot_set(package / "calibration").urdf.file == "../urdf/robot.urdf"
    for k in range(2):
        name = f"{k}.calibration.json"
        assert (package / "calibration" / name).read_bytes() == (robot / name).read_bytes()


def test_one_link_is_a_package_too(robot, tmp_path, capsys):
    """With the frames of the format ``urdf``, and the link as the fixed frame."""
    file = robot / "0.calibration.json"
    assert export(file, tmp_path / "out") == 0
    text = capsys.readouterr().out
    assert text == f"{tmp_path / 'out'}: ROS 2 packages skin_calib_msgs and left_sole_skin, 8 taxels on 1 link; " + (
        "build them with colcon\n"
    )
    package = tmp_path / "out" / "left_sole_skin"
    assert main(["export", str(file), "--to", "urdf", "-o", str(tmp_path / "x")]) == 0
    assert (package / "urdf" / "robot.urdf").read_bytes() == (tmp_path / "x").read_bytes()
    assert 'Fixed Frame: "left sole"' in (package / "rviz" / "skin.rviz").read_text()
    assert (package / "calibration" / file.name).read_bytes() == file.read_bytes()


@pytest.mark.parametrize(
    ("link", "name"), [("7-DoF arm", "robot_7_dof_arm_skin"), ("腕🦾", "robot_skin"), ("__Sole", "sole_skin")]
)
def test_names_become_names_of_packages(tmp_path, capsys, link, name):
    """The link keeps its name in the view, also one with characters outside of the first plane of Unicode."""
    yaml = pytest.importorskip("ruamel.yaml", reason="pip install ruamel.yaml").YAML(typ="safe")
    save_calibration(small_calibration(link=link), tmp_path / "a.json")
    assert export(tmp_path / "a.json", tmp_path / "out") == 0
    assert f"skin_calib_msgs and {name}," in capsys.readouterr().out and (tmp_path / "out" / name).is_dir()
    view = yaml.load(tmp_path / "out" / name / "rviz" / "skin.rviz")["Visualization Manager"]
    assert view["Global Options"]["Fixed Frame"] == link


def test_links_with_the_same_topic_are_refused(tmp_path, capsys):
    robot = write_robot(tmp_path, ("left-sole", "left sole"))
    capsys.readouterr()
    words = ("export", robot, "--to", "ros-package", "-o", tmp_path / "out")
    assert_refused(capsys, 1, 'the links "left-sole" and "left sole" would have the same topic', *words)
    assert not (tmp_path / "out").exists()


def test_robot_without_urdf_is_refused(robot, tmp_path, capsys):
    save_robot_set(replace(load_robot_set(robot), urdf=None), robot)
    words = ("export", robot, "--to", "ros-package", "-o", tmp_path / "out")
    assert_refused(capsys, 1, "robot.json names no URDF. Fit the plans with it", *words)


def test_missing_mesh_and_unknown_link_are_one_line_each(robot, tmp_path, capsys):
    """The rest is written; the exit code is 1."""
    (tmp_path / "b" / "tube 1.ply").unlink()
    urdf = tmp_path / "bot.urdf"
    urdf.write_text(urdf.read_text("utf-8").replace('"arm"', '"hand"'), "utf-8")
    assert export(robot, tmp_path / "out") == 1
    lines = [line for line in capsys.readouterr().err.splitlines() if "[duplicate-" not in line]
    assert len(lines) == 3 and "has changed" in lines[0] and "arm is not a link of bot.urdf" in lines[1]
    assert "the mesh file b/tube 1.ply of bot.urdf was not found" in lines[2]
    package = tmp_path / "out" / "bot_2_3_skin"
    main(["check", str(package / "calibration")])
    assert "has changed; fit the plans again" in capsys.readouterr().out
    text = (package / "urdf" / "robot.urdf").read_text("utf-8")
    assert '"b/tube 1.ply"' in text and '"left sole/s0.0"' in text and '"arm/s0.0"' not in text


def test_frames_that_the_robot_has_are_refused(robot, tmp_path, capsys):
    urdf = tmp_path / "bot.urdf"
    urdf.write_text(urdf.read_text("utf-8").replace('"base"', '"arm/s0.0"'), "utf-8")
    assert export(robot, tmp_path / "out") == 1
    assert "the name 'arm/s0.0' would occur twice in URDF" in capsys.readouterr().err.replace('"', "'")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("option", [("--patch", "boards"), ("--free-base",)])
def test_other_options_are_refused(robot, tmp_path, capsys, option):
    words = ("export", robot, "--to", "ros-package", "-o", tmp_path / "out", *option)
    assert_refused(capsys, 2, "ros-package has no other options", *words)


@pytest.mark.parametrize("change", ["edited", "added", "link", "foreign", "file"])
def test_only_an_unchanged_export_is_replaced(robot, tmp_path, capsys, change):
    """Folders with anything else stay as they are."""
    out = tmp_path / "out"
    for _ in range(2):  # the second replaces the first
        assert export(robot, out) == 0
    assert list(tmp_path.glob(".skin-*")) == []
    view = out / "bot_2_3_skin" / "rviz" / "skin.rviz"
    if change == "edited":
        view.write_text("mine")
    elif change == "added":
        (out / "mine").mkdir()
        (out / "mine" / "a").touch()
    elif change == "link":
        (out / "mine").symlink_to(tmp_path / "robot")
    elif change == "foreign":
        (out / "skin-calib.json").write_text("[]")
    else:
        shutil.rmtree(out)
        out.write_text("mine")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    capsys.readouterr()
    words = ("export", robot, "--to", "ros-package", "-o", out)
    assert_refused(capsys, 2, "exists, and is not a folder" if change == "file" else "would be replaced, but", *words)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_folder_stays_if_the_new_one_cannot_be_written(tmp_path):
    """No part of it, and no temporary folder."""
    out = tmp_path / "out"
    write_folder_safely(out, {"a/b": b"1"})
    with pytest.raises(OutputError, match="cannot write"):
        write_folder_safely(out, {"a/b": b"2", "a/b/c": b"3"})
    assert (out / "a" / "b").read_bytes() == b"1" and [path.name for path in tmp_path.iterdir()] == ["out"]
    assert json.loads((out / "skin-calib.json").read_text()).keys() == {"a/b"}


def test_empty_folder_is_used(robot, tmp_path):
    (tmp_path / "out").mkdir()
    assert export(robot, tmp_path / "out") == 0
    assert np.all([(tmp_path / "out" / name).is_dir() for name in ("bot_2_3_skin", "skin_calib_msgs")])
