"""Vector operations of the package agree with NumPy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.common.arrays import SINGLE_THREAD_PRODUCTS, cross, product


@pytest.mark.parametrize("shape", [(3,), (7, 3), (4, 2, 3)])
def test_cross_is_that_of_numpy(shape):
    """For single vectors, rows, tables, and a view."""
    a, b = np.random.default_rng(1).normal(size=(2, *shape))
    assert_allclose(cross(a, b), np.cross(a, b), rtol=0, atol=1e-15)
    assert_allclose(cross(a[..., ::-1], b), np.cross(a[..., ::-1], b), rtol=0, atol=1e-15)


counts: list[int] = []


class Counted(np.ndarray):
    """A matrix that records the multiplications of each product with it as the first factor."""

    def __matmul__(self, other):
        counts.append(len(self) * other.size)
        return np.asarray(self) @ other


@pytest.mark.parametrize("shape", [(1, 1, 1), (5, 7, 3), (900, 20, 60), (80, 5040, 80), (80, 560, 720), (560, 80, 720)])
def test_product_equals_numpy_without_starting_threads(shape):
    """Tall, wide and deep matrices: equal up to rounding, and no piece above the threshold of BLAS."""
    rows, inner, columns = shape
    random = np.random.default_rng(1)
    a, b = random.normal(size=(rows, inner)), random.normal(size=(inner, columns))
    counts.clear()
    result = product(a.view(Counted), b)
    assert max(counts) <= SINGLE_THREAD_PRODUCTS and sum(counts) == rows * inner * columns
    assert_allclose(result, a @ b, rtol=0, atol=1e-11)
