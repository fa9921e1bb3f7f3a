"""Limits of calibrations and of taxels from files: a number just within passes, one just beyond does not.

The numbers are written out, so that a limit does not change unnoticed.
"""

import numpy as np
import pytest

from skin_calib_addon.calibration.exchange.taxel_set import Draft, finished
from tests.unit.calibration.test_calibration_validate import changed, found, times

PATCH = "/patches/0"


def codes_of(positions, normals=None):
    """Codes of the findings of a file with these taxels."""
    draft = Draft(
        list(range(len(positions))), [f"t{k}" for k in range(len(positions))], [], list(map(tuple, positions))
    )
    draft.normals = None if normals is None else list(map(tuple, normals))
    return [finding.code for finding in finished(draft)[1]]


@pytest.mark.parametrize("ratio, is_unit", [(80, False), (150, True)])
def test_areas_are_up_to_a_hundred_times_those_of_the_corners(ratio, is_unit):
    """Above, they are in another unit; square centimetres give 10 000."""
    document = changed(**{f"{PATCH}/taxels/area": times(ratio)})
    assert (("units", f"{PATCH}/taxels/area") in found(document)) == is_unit


@pytest.mark.parametrize("pitch, is_unit", [(0.9, False), (1.1, True)])
def test_pitches_are_up_to_a_metre(pitch, is_unit):
    """More are millimetres."""
    assert (("units", f"{PATCH}/pitch") in found(changed(**{f"{PATCH}/pitch": [pitch, pitch]}))) == is_unit


@pytest.mark.parametrize("pitches, is_unit", [(0.12, False), (0.08, True), (9, False), (11, True)])
def test_corners_are_a_tenth_to_ten_pitches_from_their_taxel(pitches, is_unit):
    """Here the corners of squares of 10 mm, with another pitch."""
    pitch = 0.01 * 0.5**0.5 / pitches
    assert (("units", f"{PATCH}/taxels/corners") in found(changed(**{f"{PATCH}/pitch": [pitch, pitch]}))) == is_unit


@pytest.mark.parametrize("metres, codes", [(4.9, []), (5.1, ["units"])])
def test_taxels_of_a_file_are_up_to_5_metres_from_the_frame(metres, codes):
    """More are millimetres."""
    assert codes_of([(0.1, 0.0, 0.0), (metres, 0.0, 0.0)]) == codes


@pytest.mark.parametrize("length, codes", [(1.0015, []), (1.003, ["not-unit-normals"])])
def test_normals_of_a_file_have_a_length_within_two_thousandths(length, codes):
    """Three decimals give less."""
    assert codes_of([(0.1, 0.0, 0.0), (0.2, 0.0, 0.0)], [(0, 0, length), (0, 1.0, 0)]) == codes


@pytest.mark.parametrize("fraction, codes", [(0.08, []), (0.13, ["placeholder-normals"])])
def test_equal_normals_of_a_file_are_those_of_a_plane(fraction, codes):
    """Taxels are deeper along the normal than a tenth of their extent: then it is a placeholder."""
    positions = np.array([(0, 0, 0), (0.1, 0, 0), (0.05, 0.01, 0.1 * fraction)]) + 0.1
    assert codes_of(positions, [(0, 0, 1.0)] * 3) == codes
