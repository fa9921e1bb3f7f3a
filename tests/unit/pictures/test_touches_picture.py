"""The picture of touches."""

from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan
from skin_calib_addon.validation import placements, read_touches

pytest.importorskip("matplotlib", reason="the package matplotlib is not installed")

ROOT = Path(__file__).resolve().parents[3]


def test_cell_shows_all_touches_but_outliers():
    """No touch is outside the axes; the two swapped taxels, which are several cells away, do not set their size."""
    from matplotlib.figure import Figure

    from skin_calib_addon.pictures.touches import _draw_cell

    calibration = calibrate(load_plan(ROOT / "sample_scenes/wrist.plan.json")).calibration
    (placement,) = placements(calibration, read_touches(ROOT / "examples/wrist_touches.csv", calibration))
    axis = Figure().subplots()
    _draw_cell(axis, placement)
    largest = np.abs(1e3 * np.delete(placement.offsets[:, :2], placement.outliers, axis=0)).max()
    assert len(placement.outliers) == 2 and largest < axis.get_ylim()[1] < 1.2 * largest
