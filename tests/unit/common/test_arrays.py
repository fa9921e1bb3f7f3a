"""Vector operations of the package agree with NumPy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.common.arrays import cross, norms


@pytest.mark.parametrize("shape", [(3,), (7, 3), (4, 2, 3)])
def test_cross_is_that_of_numpy(shape):
    """For single vectors, rows, tables, and a view."""
    a, b = np.random.default_rng(1).normal(size=(2, *shape))
    assert_allclose(cross(a, b), np.cross(a, b), rtol=0, atol=1e-15)
    assert_allclose(cross(a[..., ::-1], b), np.cross(a[..., ::-1], b), rtol=0, atol=1e-15)


@pytest.mark.parametrize("shape", [(3,), (7, 3), (4, 2, 3), (5, 2), (6, 1), (0, 3)])
def test_norms_are_those_of_numpy(shape):
    """For single vectors, rows, tables, a view, and no vectors."""
    vectors = np.random.default_rng(2).normal(size=shape)
    assert_allclose(norms(vectors), np.linalg.norm(vectors, axis=-1), rtol=1e-15)
    assert_allclose(norms(vectors[..., ::-1]), np.linalg.norm(vectors[..., ::-1], axis=-1), rtol=1e-15)
