"""A recording on a skin: any frame at any time; recordings of another skin are refused."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.inspection.replaying import Replay
from skin_calib_addon.runtime import Skin
from tests.samples import small_calibration


@pytest.fixture
def calibration():
    """Return a calibration of 8 taxels with 0.25 N per unit of reading."""
    return small_calibration()


def recording(count=5, numbers=8):
    """Return a press that moves from taxel to taxel."""
    return [(0.1 * k, 4.0 * np.eye(1, numbers, k % 8)[0] + k) for k in range(count)]


def test_frame_is_that_of_the_runtime_in_any_order(calibration):
    """Contacts keep the numbers that a controller would see."""
    skin = Skin(calibration)
    expected = [skin.update(reading, time) for time, reading in recording()]
    replay = Replay(calibration, recording(), "r.csv")
    for k in (3, 0, 4, 3, 1):
        assert_allclose(replay.frame(k).forces, expected[k].forces)
        assert [c.number for c in replay.frame(k).contacts] == [c.number for c in expected[k].contacts]
        assert replay.frame(k).flags == expected[k].flags
    assert len(replay) == 5 and replay.strongest == max(frame.forces.max() for frame in expected)


def test_frame_is_found_by_its_time(calibration):
    """It is the last one that has begun, the first one before all, the last one after all."""
    replay = Replay(calibration, recording(), "r.csv")
    assert [replay.at(s) for s in (-1.0, 0.0, 0.05, 0.1, 0.35, 9.0)] == [0, 0, 0, 1, 3, 4]
    assert_allclose(replay.duration, 0.5)


TIMES = [
    ((5.0, 5.1, 5.3), (0.0, 0.1, 0.3)),
    ((1.0, np.nan, 3.0), (0.0, 0.0, 2.0)),
    ((1.0, 0.5, 2.0), (0.0, 0.0, 1.0)),
    ((1.0, np.inf, 2.0), (0.0, 0.0, 1.0)),
    ((7.0, 7.0, 7.0), (0.0, 0.01, 0.02)),
    ((np.nan, np.nan), (0.0, 0.01)),
    ((2.0,), (0.0,)),
]


@pytest.mark.parametrize("times, seconds", TIMES)
def test_time_never_decreases(calibration, times, seconds):
    """Invalid times are replayed in even steps."""
    replay = Replay(calibration, [(time, np.ones(8)) for time in times], "r.csv")
    assert_allclose(replay.seconds, seconds, atol=1e-12)
    assert replay.duration > 0


def test_longer_readings_are_accepted_and_shorter_ones_refused(calibration, tmp_path):
    """Electronics may send more values than the skin has; a frame with too few values is named."""
    assert len(Replay(calibration, recording(numbers=11), "r.csv")) == 5
    short = [*recording(), (1.0, np.ones(7))]
    with pytest.raises(CalibrationFormatError, match="'r.csv', frame 5: the reading has 7 channels, .* needs 8"):
        Replay(calibration, short, "r.csv")
    with pytest.raises(CalibrationFormatError, match="'r.csv' has no frame"):
        Replay(calibration, [], "r.csv")
    bare = dataclasses.replace(calibration, patches=())
    with pytest.raises(CalibrationFormatError, match="forearm has no taxels, so '.*r.csv' cannot be replayed"):
        Replay.read(bare, tmp_path / "r.csv")


def test_recording_that_is_too_long_is_refused(calibration, monkeypatch):
    """The limit protects the memory."""
    monkeypatch.setattr("skin_calib_addon.inspection.replaying.MAX_NUMBERS", 24)
    assert len(Replay(calibration, recording(3), "r.csv")) == 3
    with pytest.raises(CalibrationFormatError, match="more than 3 frames"):
        Replay(calibration, recording(4), "r.csv")


def test_missing_numbers_are_no_peak(calibration):
    """A reading that is not finite does not count for the largest force."""
    lost = np.where(np.arange(8) == 2, np.nan, 4.0)
    assert_allclose(Replay(calibration, [(0.0, lost)], "r.csv").strongest, 0.25 * 4 - 0.001 * 16)
