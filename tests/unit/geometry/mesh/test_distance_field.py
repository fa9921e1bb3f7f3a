"""Distances on a grid, compared with those of solid boxes."""

import numpy as np

from skin_calib_addon.geometry.mesh.distance_field import DistanceField
from tests.oracles import box_distance
from tests.shapes import box


def test_distances_far_from_a_link_are_lower_bounds_and_near_ones_exact():
    """Of a box: within a third of a cell in the mean, and never more than the distance by more than a cell."""
    low, high = (-0.03, -0.02, -0.01), (0.03, 0.02, 0.04)
    field = DistanceField(box(low, high), 0.0025)
    points = np.random.default_rng(0).uniform(-0.3, 0.3, (20_000, 3)) * np.random.default_rng(1).random((20_000, 1))
    exact = box_distance(points, low, high)
    error = field(points) - exact
    assert error.max() < 0.0025
    near = (exact > 0.002) & (exact < 0.006)
    assert near.sum() > 100
    assert np.abs(error[near]).mean() < 0.0025 / 3
    assert (field(points)[exact > 0.05] > 0.8 * exact[exact > 0.05]).mean() > 0.9
