"""Curves of several sections at once, against one section after the other."""

import numpy as np
import pytest

from skin_calib_addon.geometry.sampling.curves import curves


@pytest.mark.parametrize("seed", range(5))
def test_curves_of_rows_are_those_of_each_row(seed):
    """Segments between random nodes: two are on a curve in all rows at once as they are in their row alone."""
    rng = np.random.default_rng(seed)
    nodes = rng.integers(-2, 3, (40, 2)).astype(float)
    ends = nodes[rng.integers(0, len(nodes), (60, 2))]
    row = np.sort(rng.integers(0, 4, len(ends)))
    found = curves(ends, row)
    alike = found[:, None] == found
    for i in range(4):
        alone = curves(ends[row == i])
        assert np.array_equal(alike[row == i][:, row == i], alone[:, None] == alone)
    assert not alike[row[:, None] != row].any()
    # By brute force: the smallest number of a segment that is connected, until nothing changes.
    number = np.arange(len(ends))
    touches = (ends[:, None, :, None] == ends[None, :, None]).all(axis=4).any(axis=(2, 3)) & (row[:, None] == row)
    while True:
        least = np.where(touches, number, len(ends)).min(axis=1)
        if np.array_equal(least, number):
            break
        number = least
    assert np.array_equal(alike, number[:, None] == number)
