"""Limits of touches: one just within passes, one just beyond does not.

The numbers are written out, so that a limit does not change unnoticed.
"""

import numpy as np
import pytest

from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.validation import placements
from skin_calib_addon.validation.placement import flat_places
from tests.unit.validation.test_touches import (
    CALIBRATION,
    COLUMNS,
    PITCH,
    ROWS,
    SHEET,
    on_sheet,
    points_after_motion,
    read,
    touched,
)

EACH = np.arange(ROWS * COLUMNS)


def placement_of(offsets):
    """The comparison of one touch of each taxel, with these offsets (72, 2) along the skin [mm]."""
    along, across = (flat_places(SHEET, SHEET.taxels.index) + 1e-3 * offsets).T
    return placements(CALIBRATION, touched(CALIBRATION, EACH, on_sheet(along, across)))[0]


@pytest.mark.parametrize(
    "millimetres, codes", [(2.2, []), (-2.2, []), (2.8, ["touch-height"]), (-2.8, ["touch-height"])]
)
def test_touches_are_up_to_2_5_mm_from_the_taxels(millimetres, codes):
    """Half of the distance at which a single touch is an error."""
    points = points_after_motion(EACH, 0.0, 0.0, 0.0, height=1e-3 * millimetres)
    (found,) = placements(CALIBRATION, touched(CALIBRATION, EACH, points))
    assert [warning.code for warning in found.warnings()] == codes


@pytest.mark.parametrize("degrees, is_grazing", [(9, True), (11, False)])
def test_line_of_action_is_ten_degrees_from_the_skin(degrees, is_grazing):
    """Its sine is 0.17."""
    a, taxels = np.deg2rad(degrees), SHEET.taxels
    directions = np.cos(a) * taxels.tangents_link - np.sin(a) * taxels.normals_link
    (found,) = placements(CALIBRATION, touched(CALIBRATION, EACH, taxels.positions_link, directions))
    assert len(found.grazing) == (len(EACH) if is_grazing else 0)


@pytest.mark.parametrize("usual, far, is_outlier", [(0, 13.5, False), (0, 16.5, True), (7, 18, False), (7, 25, True)])
def test_outlier_is_one_and_a_half_cells_and_three_usual_distances_off(usual, far, is_outlier):
    """One touch is off along the rows; the others are at the usual distance, to the left and to the right in turn."""
    offsets = np.zeros((len(EACH), 2))
    offsets[:, 1] = usual * np.where((EACH + EACH // COLUMNS) % 2, 1.0, -1.0)
    offsets[30] = far, 0
    assert placement_of(offsets).outliers.tolist() == ([30] if is_outlier else [])


@pytest.mark.parametrize("ratio, is_named", [(0.42, True), (0.6, False)])
def test_another_order_of_the_channels_halves_the_distances(ratio, is_named):
    """Touches of the third of six rows that are nearer to the fourth, as if rows were counted from the other end."""
    rows = np.arange(2 * COLUMNS, 3 * COLUMNS)
    along, across = flat_places(SHEET, SHEET.taxels.index[rows]).T
    points = on_sheet(along, across + PITCH / (1 + ratio))
    (found,) = placements(CALIBRATION, touched(CALIBRATION, rows, points))
    assert ("channel-order" in [warning.code for warning in found.warnings()]) == is_named


def test_coordinates_are_up_to_10_metres(tmp_path):
    """More are millimetres."""
    table = [("taxel", "x", "y", "z"), ("s1.2", 0, 9.0, 0)]
    assert read(tmp_path, table).points[0, 1] == 9.0
    with pytest.raises(CalibrationFormatError, match="more than 10 m from the origin"):
        read(tmp_path, [table[0], ("s1.2", 0, 11.0, 0)])


def test_forces_are_at_least_a_tenth_of_a_newton(tmp_path):
    """Less gives no reliable line of action."""
    table = [("taxel", "fx", "fy", "fz", "tx", "ty", "tz"), ("s1.2", 0, 0, -0.11, 0, 0, 0)]
    assert read(tmp_path, table).directions[0].tolist() == [0, 0, -1]
    with pytest.raises(CalibrationFormatError, match=r"needs 0\.1 N or more"):
        read(tmp_path, [table[0], ("s1.2", 0, 0, -0.09, 0, 0, 0)])
