"""The arm of the biped: its probes, and short versions of the runs."""

import numpy as np
import pytest


def test_balls_of_the_soft_probe_touch_the_forearm():
    """All at the distance of their radius from the cone of the forearm."""
    from arm import FOREARM_LENGTH, PRESSED, SMALL, WRIST_RADIUS, cushion, radius_at
    from shapes import ELBOW_RADIUS

    places = cushion()
    slope = (WRIST_RADIUS - ELBOW_RADIUS) / FOREARM_LENGTH
    to_axis = np.hypot(places[:, 1], radius_at(PRESSED) + SMALL - places[:, 2])
    np.testing.assert_allclose(to_axis - SMALL, radius_at(PRESSED) + slope * places[:, 0], atol=1e-9)


@pytest.mark.slow
def test_arm_yields_to_two_contacts():
    from arm import Case, run

    stiff, yields = (run(Case("contacts", variant, 0), duration=1.2) for variant in ("stiff", "yields"))
    for name in ("force", "second"):
        assert yields[name].max() < stiff[name].max() / 2


@pytest.mark.slow
def test_arm_avoids_in_the_null_space_of_its_hand():
    from arm import Case, run

    still, moves = (run(Case("near", variant, 0), duration=2.8) for variant in ("hand only", "null space"))
    assert still["force"].max() > 0 == moves["force"].max()
    assert moves["hand"].max() < 0.02 and moves["gap"].min() > 0.002


@pytest.mark.slow
def test_heat_and_pain_have_priority_over_the_hand():
    from arm import HEAT_LIMIT, Case, run

    hand, first = (run(Case("heat", variant, 0), duration=3.0) for variant in ("hand only", "first"))
    assert first["heat"].max() - HEAT_LIMIT < 0.5 * (hand["heat"].max() - HEAT_LIMIT)
    pain = run(Case("pain", "small", 0), duration=3.0)
    assert 2 < pain.pain_force < 10


def test_animation_shows_hot_pads_in_red(frames, tmp_path):
    """In the right half they have the temperature at which a pad is red."""
    from arm import SHOWN_HOT, Arm, Case, film

    def cold(look):
        look(Arm(Case("heat", "first", 0)))

    def hot(look):
        arm = Arm(Case("heat", "first", 0))
        arm.heat[:] = SHOWN_HOT
        look(arm)

    film([cold, hot], tmp_path / "arm.gif")
    (picture,) = frames(tmp_path / "arm.gif")
    red = (picture[..., 0] > 1.7 * picture[..., 1]) & (picture[..., 2] < 40)  # the burner is a little blue
    left, right = np.hsplit(red, 2)
    assert left.sum() < 10 and right.sum() > 300
