"""Splines through nodes: the matrix against the ones of SciPy."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from skin_calib_addon.skin.sheet.between import interpolation

RNG = np.random.default_rng(3)


@pytest.mark.parametrize("count", [2, 3, 4, 5, 9])
@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_interpolation_is_the_not_a_knot_spline(count, derivative):
    """Values and derivatives, at nodes that are not equidistant, and a little beyond their ends."""
    nodes = np.arange(count) + RNG.uniform(0, 0.6, count)
    sites = np.linspace(nodes[0] - 0.1, nodes[-1] + 0.1, 30)
    spline = make_interp_spline(nodes, np.eye(count), k=min(3, count - 1))
    np.testing.assert_allclose(interpolation(nodes, sites, derivative), spline(sites, nu=derivative), atol=1e-12)
