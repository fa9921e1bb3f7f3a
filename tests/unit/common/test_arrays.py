"""Vector operations of the package agree with NumPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.arrays import cross, norms, row_order


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


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 3, 1000]))
def test_order_of_rows_is_that_of_a_lexical_sort(seed, most):
    """With many and with few equal numbers, also of rows that are sorted but for the last ones."""
    rows = np.random.default_rng(seed).integers(0, most, (40, 3))
    assert np.array_equal(row_order(rows), np.lexsort(rows.T[::-1]))
    nearly = np.concatenate((rows[row_order(rows)], rows[:7])).astype(float)
    assert np.array_equal(row_order(nearly), np.lexsort(nearly.T[::-1]))
    assert len(row_order(rows[:0])) == 0
