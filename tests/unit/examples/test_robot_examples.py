"""Short runs of the examples with whole robots; they need the packages ``pin`` and ``mujoco``."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.cli import main
from skin_calib_addon.robot.kinematics import link_poses
from skin_calib_addon.robot.urdf import read_robot
from tests.unit.robot import test_robot_mjcf

fitted, robot = test_robot_mjcf.fitted, test_robot_mjcf.robot
EXAMPLES = Path(__file__).parents[3] / "examples"


def example(name):
    specification = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_torques_of_a_press_are_those_of_virtual_work(robot, capsys):
    """Of a press of 5 N on the hand: differences of the position of the taxel, by our own kinematics."""
    pytest.importorskip("pinocchio", reason="the package pin is not installed")
    urdf = robot / "bot" / "bot.urdf"
    state, positions, torques = example("robot_pinocchio").main(urdf, robot / "out", 20)
    assert capsys.readouterr().out.count("feels 5.00 N") == 2
    contact = state.links["hand"].contacts[0]
    content, joints = read_robot(urdf), ("a", "b")

    def place(angles):
        return (link_poses(content, dict(zip(joints, angles)))["hand"] @ (*contact.position, 1))[:3]

    pose = link_poses(content, dict(zip(joints, positions)))["hand"]
    np.testing.assert_allclose(state.poses["hand"], pose, atol=1e-9)
    force = -5 * pose[:3, :3] @ contact.normal
    steps = 1e-6 * np.eye(2)
    expected = [force @ (place(positions + step) - place(positions - step)) / 2e-6 for step in steps]
    np.testing.assert_allclose(torques, expected, atol=1e-6)


def test_presses_of_the_simulator_are_felt(robot, capsys):
    """The right link feels the force of the simulator, within half a cell; no other link feels any."""
    pytest.importorskip("mujoco", reason="the package mujoco is not installed")
    main(["export", str(robot / "out"), "--to", "mjcf", "-o", str(robot / "skin.xml")])
    presses = example("robot_mujoco").main(robot / "skin.xml", robot / "out", 12)
    assert {press.link for press in presses} == {"arm", "hand"} and len(presses) == 12
    for press in presses:
        assert press.felt == pytest.approx(press.force, rel=1e-6) and press.force > 0.2
        assert press.elsewhere == 0 and press.distance < 0.5e-3
