"""Taxels that lose their readings under a load: what they may carry is stated, or nothing is."""

import numpy as np
import pytest

from skin_calib_addon.calibration import Response
from skin_calib_addon.runtime import Body, Skin
from tests.samples import cylinder, small_calibration
from tests.soles import counting_sole, skin_of, sole_patch

N, COUNTS = 42, 0.2  # taxels; [N] of a count


def forearm():
    """Return a skin around a cylinder, and which of its taxels a finger presses."""
    skin = Skin(small_calibration(surfaces=(cylinder(),), response=Response((0.0, 1.0))), 0.2, 0.1)
    nearest = np.argsort(np.linalg.norm(skin.positions - skin.positions[0], axis=1))
    return skin, nearest[:3]


def standing_sole(rng=None):
    """Return a sole after a tare, and a reading of a foot with 840 N."""
    skin, rng = counting_sole(), rng or np.random.default_rng(3)
    skin.tare(np.maximum(np.rint(rng.normal(0, 2, (250, N))), 0))
    return skin, np.full(N, 100.0)


def test_finger_under_which_all_taxels_are_lost_still_presses():
    """A stop that looks at ``touched`` must not take NaN for a lifted finger; one that is seen to lift is none."""
    skin, pressed = forearm()
    reading = np.zeros(len(skin.ids))
    reading[pressed] = 16 / len(pressed)
    assert skin.update(reading, 0.0).touched
    lost = np.where(reading > 0, np.nan, 0.0)
    for time in (0.01, 0.02, 0.5):
        frame = skin.update(lost, time)
        assert frame.touched is None and np.isnan(frame.wrench).all() and "may carry 16 N" in frame.problem
    assert skin.update(np.zeros(len(reading)), 0.51).touched is False
    frame = skin.update(lost, 0.52)
    assert frame.touched is False and (frame.wrench == 0).all() and frame.problem is None


def test_taxel_without_a_first_reading_is_not_free():
    """Nothing is known about it, from the start and after a jump of the time, until it is masked."""
    skin, _ = forearm()
    reading = np.zeros(len(skin.ids))
    reading[3] = np.nan
    frame = skin.update(reading, 0.0)
    assert frame.touched is None and skin.ids[3] in frame.problem
    skin.mask(skin.ids[3:4])
    assert skin.update(reading, 0.01).touched is False
    skin.mask(())
    assert skin.update(np.zeros(len(reading)), 0.02).touched is False
    assert skin.update(reading, 0.03).touched is False
    assert skin.update(reading, 100.0).touched is None


@pytest.mark.parametrize("count", [1, 4, 10])
def test_deviations_hold_where_some_taxels_are_lost(count):
    """Lost at one edge of a standing foot: load, CoP, ZMP and wrench are within one stated deviation of the truth."""
    skin, reading = standing_sole()
    whole = skin.update(reading, 0.0)
    lost = reading.copy()
    lost[np.argsort(skin.positions[:, 0])[:count]] = np.nan
    frame = skin.update(lost, 0.01)
    assert frame.problem is None and frame.load < whole.load - 15 * count
    assert abs(frame.load - whole.load) < frame.load_sigma < 2 * abs(frame.load - whole.load) + 10
    for name in ("cop", "zmp", "wrench"):
        true, found, sigma = getattr(whole, name), getattr(frame, name), getattr(frame, f"{name}_sigma")
        assert (np.abs(found - true) <= sigma + 1e-4).all()


@pytest.mark.parametrize("where", ["half", "all but one"])
@pytest.mark.parametrize("is_masked", [False, True])
def test_half_a_foot_gives_no_point(where, is_masked):
    """A ZMP of the other half would be far off; the body says which foot."""
    skin, reading = standing_sole()
    skin.update(reading, 0.0)
    rows = np.argsort(skin.positions[:, 0])[: 21 if where == "half" else 41]
    if is_masked:
        skin.mask(skin.ids[k] for k in rows)
    else:
        reading[rows] = np.nan
    body = Body({"left": skin})
    frame = body.update({"left": reading}, 0.01, {"left": np.eye(4)})
    foot = frame.links["left"]
    assert foot.touched and foot.cop is None and foot.zmp is None and np.isnan(foot.load) and not foot.stands
    assert frame.zmp is None and frame.wrench is None and frame.polygon is None
    assert frame.reason.startswith(f"'left' may stand, but its contact is not known: {len(rows)} taxels")


def test_outer_polygon_contains_what_is_lost():
    """The toe carries all, and loses its readings: nothing else is touched, but the outer polygon has the toe."""
    skin, _ = standing_sole()
    toe = np.argsort(skin.positions[:, 0])[-12:]
    reading = np.where(np.isin(np.arange(N), toe), 100.0, 0.0)
    skin.update(reading, 0.0)
    reading[toe] = np.nan
    frame = skin.update(reading, 0.01)
    assert frame.touched is None and all(frame.polygon.outer.margin(skin.ground.centres[k]) > 0 for k in toe)


def test_what_no_neighbour_leads_to_may_carry_as_much_as_the_others():
    """One of two patches of a foot is lost from the start."""
    left = sole_patch((5, 6, 5))
    right = sole_patch((4, 3, 4), name="heel", height=0.001, first_channel=16)
    skin = skin_of(left, right)
    reading = np.where(skin.channels < 16, 10.0, np.nan)
    frame = skin.update(reading, 0.0)
    assert frame.lost[16:] == pytest.approx(10) and frame.problem.startswith("11 taxels")
    assert frame.touched and np.isnan(frame.load)
