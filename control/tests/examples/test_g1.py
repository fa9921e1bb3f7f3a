"""The balance of the G1, by short versions of the runs."""

import numpy as np
import pytest


@pytest.mark.slow
def test_g1_keeps_its_balance_by_the_skin_that_was_proposed_for_its_feet(g1_feet):
    """A push of 12 N s from behind; the ZMP of the skin agrees with the true one."""
    from g1 import URDF, Case, push

    stands, zmps = push(Case(URDF, g1_feet, "full sole", "skin", 0), 12.0)
    off = np.linalg.norm(zmps[:, 0] - zmps[:, 2], axis=1)
    assert stands and np.ptp(zmps[:, 2, 0]) > 0.03
    assert off.mean() < 0.004 and np.percentile(off, 95) < 0.008


@pytest.mark.slow
def test_g1_is_the_same_robot_with_its_meshes_on_a_beam_that_bears_the_middle_of_its_soles_only(g1_feet):
    """The meshes of an animation touch nothing and have no mass; the ground is below the middle half only."""
    from dataclasses import replace

    import g1
    from biped import normal_forces

    case = g1.Case(g1.URDF, g1_feet, "half sole", "skin", 0)
    pressed = []

    def look(robot):
        for foot in g1.FEET:
            skin, forces = robot.body.skins[foot], normal_forces(robot.model, robot.data)[robot.cells[foot]]
            pressed.extend(robot.data.body(foot).xpos[0] + skin.positions[forces > 0, 0])

    plain, shown = (
        g1.push(replace(case, is_shown=is_shown), 3.0, each) for is_shown, each in ((False, look), (True, None))
    )
    np.testing.assert_array_equal(plain[1], shown[1])
    beam = g1.GROUND["half sole"].boxes[0]
    assert plain[0] and np.abs(np.array(pressed) - beam.centre[0]).max() < beam.half[0] + 0.01


def test_skins_of_an_earlier_run_are_replaced(tmp_path, monkeypatch):
    """They were used for any robot that --urdf named later."""
    import g1

    calls, urdf = [], tmp_path / "robot.urdf"
    urdf.write_text("<robot name='g1'/>")
    (tmp_path / "robot.json").write_text("{}")
    monkeypatch.setattr(g1, "skin_calib", calls.append)
    g1.propose(urdf, tmp_path, ("foot",))
    (words,) = calls
    assert words[:2] == ["fit", str(urdf)] and "--again" in words and words[-2:] == ["--only", "foot"]
