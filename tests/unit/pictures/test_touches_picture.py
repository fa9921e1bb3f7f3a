"""The picture of touches."""

from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan
from skin_calib_addon.validation import Directions, placements, read_touches
from tests.unit.pictures.test_picture import read_png

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


def test_picture_shows_the_angles_of_forces(tmp_path):
    """The mean is in both titles, and a row of the picture is added."""
    from matplotlib.figure import Figure

    from skin_calib_addon.pictures.touches import _draw_angles, draw_touches

    rng = np.random.default_rng(0)
    tilts = np.deg2rad(rng.normal((10, 0), 2, (40, 2)))
    none = np.zeros(3), np.zeros((3, 3)), False
    directions = Directions(np.arange(40), np.full(40, 8.0), tilts, np.zeros(40, bool), 0.1, *none)
    angle_axis, tilt_axis = Figure().subplots(1, 2)
    _draw_angles(angle_axis, tilt_axis, directions)
    assert angle_axis.get_title("left").startswith("angle between force and normal: mean 10.")
    assert tilt_axis.get_title("left").startswith("leans by ") and len(angle_axis.patches) == 36
    calibration = calibrate(load_plan(ROOT / "sample_scenes/wrist.plan.json")).calibration
    found = placements(calibration, read_touches(ROOT / "examples/wrist_touches.csv", calibration))
    heights = []
    for k, forces in enumerate((None, directions)):
        draw_touches(found, tmp_path / f"{k}.png", forces)
        heights.append(read_png(tmp_path / f"{k}.png").shape[0])
    assert heights[1] > 1.5 * heights[0]
