"""The arm of the G1, by short versions of the runs."""

import numpy as np
import pytest


@pytest.fixture
def g1_arm(tmp_path_factory):
    """Runs a case of the arm of the G1; its skins are made once for all tests."""
    from g1 import URDF, propose
    from g1_arm import COVERED, G1Case, run

    if not URDF.exists():
        pytest.skip(f"no real robot here: {URDF} is missing")
    folder = tmp_path_factory.getbasetemp() / "g1_arm"
    propose(URDF, folder, COVERED)
    return lambda kind, variant: run(G1Case(kind, variant, 0, urdf=URDF, folder=folder))


@pytest.mark.slow
def test_g1_forearm_yields_to_a_contact_and_shrinks_back_before_one_and_from_heat(g1_arm):
    stiff, soft = (g1_arm("contacts", variant) for variant in ("stiff", "yields"))
    assert 0 < soft["force"].max() < stiff["force"].max() / 4 and soft["moved"][-1] > 0.05 > stiff["moved"][-1]
    hit, clear = (g1_arm("near", variant) for variant in ("hand only", "null space"))
    assert hit["force"].max() > 10 and clear["force"].max() == 0
    assert clear["hand"].max() < 0.03
    burns, cool = (g1_arm("heat", variant) for variant in ("hand only", "first"))
    assert cool["heat"].max() < burns["heat"].max() - 10 and cool["gap"].min() > burns["gap"].min()


@pytest.mark.slow
def test_g1_forearm_feels_the_force_of_its_probe(g1_arm):
    """Its readings are counts; they were taken as newtons, 34 times too large."""
    stiff = g1_arm("contacts", "stiff")
    pressed = slice(len(stiff.log) * 3 // 4, None)
    assert stiff["force"][pressed].min() > 10
    np.testing.assert_allclose(stiff["virtual"][pressed], stiff["force"][pressed], rtol=0.15)


@pytest.mark.slow
def test_g1_arm_yields_by_the_torques_of_contacts_on_two_links(g1_arm):
    """With the torques of the elbow alone the contact of the upper arm stays hard."""
    stiff, one, both = (g1_arm("links", variant) for variant in ("stiff", "one link", "yields"))
    assert both["force"].max() < stiff["force"].max() / 3 and both["second"].max() < one["second"].max() - 10


@pytest.mark.slow
def test_g1_arm_has_pain_by_a_small_probe_earlier_than_by_a_large_one(g1_arm):
    """The pressure of the same force on more taxels is lower; so it also yields more slowly to it."""
    small, large = (g1_arm("pain", variant) for variant in ("small", "large"))
    assert 2 < small.pain_force < 10 and large.pain_force > 2 * small.pain_force
    fast, slow = (g1_arm("pressure", f"{size}, pressure") for size in ("small", "large"))
    assert slow.speed < 0.75 * fast.speed and slow.pressed_area > 3 * fast.pressed_area
