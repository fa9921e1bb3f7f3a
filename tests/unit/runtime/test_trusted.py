"""One rule for controllers: which statements of a frame hold, and which flags take the others away."""

import numpy as np
import pytest

from skin_calib_addon.calibration import Response
from skin_calib_addon.runtime import Body
from skin_calib_addon.runtime.trusted import NOT_GUARANTEED, STATEMENTS, TAKES, Trusted
from tests.soles import counting_sole

N = 42
REST = np.maximum(np.rint(2 * np.random.default_rng(0).normal(size=(250, N))), 0)
FOOT = np.full(N, 100.0) + REST[7]


def sole(**options):
    """Return a sole that knows its noise."""
    skin = counting_sole(Response((0.0, 0.2), (0.0, 4095.0)), **options)
    skin.tare(REST)
    return skin


def lost(reading, k):
    """Return a reading in which the first taxels have none."""
    return np.where(np.arange(N) < k, np.nan, reading)


@pytest.mark.parametrize(
    "reading, holds, why",
    [
        (FOOT, (True, True, True, True), ()),
        (REST[3], (True, True, True, True), ()),
        (lost(FOOT, 4), (True, True, True, True), ()),
        (lost(FOOT, 30), (True, False, False, True), ("lost",)),
        (lost(FOOT, N), (False, False, False, False), ("blind",)),
        (np.zeros(3), (False, False, False, False), ("wrong_length",)),
        (np.where(np.arange(N) == 5, 4095, FOOT), (True, False, False, True), ("saturated",)),
        (FOOT * 20, (False, False, False, False), ("overload",)),
        (REST[3] - 40, (False, False, False, True), ("below_rest",)),
    ],
)
def test_statements_that_hold(reading, holds, why):
    """Small losses are in the deviations; the others take away what they make wrong, and no more."""
    skin = sole()
    skin.update(FOOT, 0.0)
    trusted = skin.update(reading, 0.004).trusted
    assert tuple(getattr(trusted, s) for s in STATEMENTS) == holds and trusted.why == why
    assert bool(trusted) == all(holds)


def test_nothing_is_trusted_before_the_noise_is_known():
    """Unless the caller gives thresholds."""
    assert counting_sole().update(FOOT, 0.0).trusted == Trusted(False, False, False, False, ("noise_unknown",))
    assert counting_sole(switch_on=1.0).update(FOOT, 0.0).trusted


@pytest.mark.parametrize("flag", sorted(NOT_GUARANTEED))
def test_guarantee_that_is_taken_away_is_an_empty_polygon(flag):
    """A controller that forgets the rule gets no polygon."""
    frame = sole().update(FOOT, 0.0)
    object.__setattr__(frame, "flags", frozenset({flag}))
    assert len(frame.polygon.guaranteed.corners) == 0 and "guaranteed" in TAKES[flag]


def test_body_trusts_what_all_links_have():
    """A foot without a reading takes all away; feet at different heights only the guarantee."""
    feet, poses = {"left": sole(), "right": sole()}, {"left": np.eye(4), "right": np.eye(4)}
    body = Body(feet)
    assert body.update({"left": FOOT, "right": FOOT}, 0.0, poses).trusted
    poses["right"] = np.eye(4)
    poses["right"][2, 3] = 0.1
    trusted = body.update({"left": FOOT, "right": FOOT}, 0.004, poses).trusted
    assert trusted == Trusted(True, True, True, False, ("not_coplanar",))
    trusted = body.update({"left": FOOT}, 0.008, poses).trusted
    assert trusted == Trusted(False, False, False, False, ("right",))


@pytest.mark.parametrize("even", [0.0, 0.3])
def test_assumed_rest_guarantees_nothing_before_a_lift(even):
    """Nobody knows whether the first quiet frames were without load: 0.3 N on each taxel is below the limit."""
    rng, skin = np.random.default_rng(4), counting_sole()

    def frames(load, count, start):
        counts = np.maximum(np.rint(5 * (load + even * (start < 2)) + 2 * rng.normal(size=(count, N))), 0)
        return [skin.update(row, start + 0.004 * k) for k, row in enumerate(counts)]

    first = frames(0.0, 300, 0.0)[-1]
    assert skin.noise is not None and first.trusted.why == ("rest_assumed",) and first.trusted.touched
    stance = frames(20.0, 200, 1.2)[-1]
    assert stance.trusted.wrench and not len(stance.polygon.guaranteed.corners)
    assert "rest_assumed" in frames(0.0, 490, 2.0)[-1].flags
    assert ("rest_assumed" in frames(0.0, 260, 3.96)[-1].flags) == bool(even)
    if not even:
        assert frames(20.0, 100, 5.0)[-1].polygon.guaranteed.kind == "area"
