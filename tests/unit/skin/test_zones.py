"""Balls that cover faces."""

import numpy as np
import pytest

from skin_calib_addon.skin.zones import discs_over

SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)


def inside(triangles, rng):
    """Return random points on faces."""
    weights = rng.dirichlet((1, 1, 1), (400, len(triangles)))
    return np.einsum("kfc,fcx->kfx", weights, triangles).reshape(-1, 3)


@pytest.mark.parametrize("size, radius", [(0.004, 0.01), (0.03, 0.01), (0.05, 0.005), (0.1, 0.02)])
def test_balls_contain_the_faces_and_little_else(size, radius):
    """Every point of the faces is inside a ball; no ball protrudes by more than its radius; small faces need one."""
    triangles, rng = size * SQUARE, np.random.default_rng(0)
    balls = discs_over(triangles, radius)
    centres, radii = np.array([c for c, _ in balls]), np.array([r for _, r in balls])
    points = inside(triangles, rng)
    off = np.linalg.norm(points[:, None] - centres, axis=2) - radii
    assert off.min(axis=1).max() <= 1e-9
    assert (radii <= radius + 1e-12).all() and ((centres >= -1e-9) & (centres <= size + 1e-9))[:, :2].all()
    assert len(balls) <= 1 + 4 * size**2 / (np.pi * radius**2)
    assert len(balls) == 1 or size > radius
    assert max(radii) < size or size > radius  # one ball over a small face is small


def test_many_small_faces_need_no_more_balls():
    """A selection of 20 000 faces is as quick as one of two."""
    x, y = np.meshgrid(np.linspace(0, 0.03, 100), np.linspace(0, 0.03, 100))
    corner = np.stack((x.ravel(), y.ravel(), np.zeros(x.size)), axis=1)
    small = (corner[:, None, None] + 0.0003 * SQUARE).reshape(-1, 3, 3)
    assert len(small) == 20_000 and len(discs_over(small, 0.01)) <= 2 * len(discs_over(0.0303 * SQUARE, 0.01))
