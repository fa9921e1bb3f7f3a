"""The points at which distances are measured, and the statistics of distances."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.surface_errors import DistanceStatistics
from skin_calib_addon.geometry.surface.distance import surface_samples
from tests.shapes import plane_surface


def test_samples_stand_for_all_of_the_area():
    """The weights of a surface's samples add up to its area."""
    uv, weights = surface_samples(plane_surface())
    assert_allclose(weights.sum(), 0.1 * 0.08, rtol=1e-12)
    assert ((uv > 0) & (uv < 1)).all()


@given(values=st.lists(st.tuples(st.floats(0, 1), st.floats(1e-3, 1)), min_size=1, max_size=9))
def test_statistics_are_weighted(values):
    """Mean and root mean square by area, the maximum whatever its area."""
    d, w = np.array(values).T
    found = DistanceStatistics.of(d, w)
    assert_allclose(found.mean, sum(a * b for a, b in values) / sum(w), rtol=1e-12, atol=1e-300)
    assert_allclose(found.rms, np.sqrt(sum(a * a * b for a, b in values) / sum(w)), rtol=1e-12, atol=1e-150)
    assert found.max == max(d)
