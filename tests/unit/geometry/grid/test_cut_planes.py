"""A new cut stands across the link and keeps its larger part."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.geometry.grid.cut_planes import cut_normal, long_direction
from tests.shapes import LENGTH, Motion, cylinder, sheet, wrist


@pytest.mark.parametrize("height, sign", [(0.2, 1), (0.8, -1)])
def test_cut_keeps_the_larger_part(height, sign):
    """Near either end of a tube, wide or long, the normal is the axis of the frame, to the bit."""
    for length in (0.03, LENGTH):
        assert cut_normal(cylinder(length=length), np.array((0.1, 0, height * length))).tolist() == [0, 0, sign]


def test_given_direction_is_taken():
    """Of any length, and made an axis of the frame where it nearly is one."""
    for x, sign in ((-0.02, 1), (0.1, -1)):
        normal = cut_normal(cylinder(), np.array((x, 0, 0.03)), np.array((3.0, 0, 4.0)))
        assert_allclose(normal, sign * np.array((0.6, 0, 0.8)), atol=1e-15)
    assert cut_normal(cylinder(), np.array((0, 0, 0.03)), np.array((0.01, 0, 5.0))).tolist() == [0, 0, 1]


def test_long_direction_moves_with_the_mesh():
    """Of a tube that is no axis of the frame, and of a plate that is no tube."""
    plate = sheet(lambda x, y: 0 * x, size=(0.1, 0.03))
    for mesh, direction in ((wrist(), None), (plate, (1.0, 0, 0))):
        motion = Motion(5)
        expected = motion.directions(long_direction(mesh) if direction is None else direction)
        assert abs(long_direction(motion.mesh(mesh)) @ expected) > 1 - 1e-6
