"""Footpoints against projections, dense grids and brute force."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

from skin_calib_addon.geometry import TubeGrid, fit_surface
from skin_calib_addon.geometry.fit.fitting import fit_lines
from skin_calib_addon.geometry.surface.footpoints import _second_derivatives, descend, footpoints
from tests.shapes import Z_AXIS, cylinder, plane_surface, swept, wrist_surface

seeds = st.integers(0, 2**32 - 1)


@given(seed=seeds)
def test_footpoints_on_a_plane_are_projections(seed):
    """Over the plane: straight down, u and v are fractions of the sides; next to it: on the edge, at its distance."""
    points = np.random.default_rng(seed).uniform((-0.02, -0.02, -0.01), (0.12, 0.10, 0.01), (30, 3))
    uv, distance = footpoints(plane_surface(), points)
    assert_allclose(uv, np.clip(points[:, :2] / (0.1, 0.08), 0, 1), rtol=0, atol=1e-9)
    near = points - np.clip(points, 0, (0.1, 0.08, 0))
    assert_allclose(distance, np.linalg.norm(near, axis=1), rtol=1e-9)


def test_footpoints_on_a_tube_are_nearest():
    """Points about the wrist, over the seam too: no dense grid has a nearer point, and the gap is along the normal."""
    surface = wrist_surface()
    rng = np.random.default_rng(3)
    places = np.column_stack(
        (rng.uniform(0.1, 0.9, 60), np.append(rng.uniform(0, 1, 50), rng.uniform(-0.01, 0.01, 10)))
    )
    points = surface.points(places) + rng.uniform(-0.004, 0.004, (60, 1)) * surface.normals(places)
    uv, distance = footpoints(surface, points)
    u, v = np.linspace(0, 1, 200), np.linspace(0, 1, 400)
    dense = surface.grid_points(u, v).reshape(-1, 3)
    assert (distance <= cKDTree(dense).query(points)[0] + 1e-12).all()
    gap = points - surface.points(uv)
    assert_allclose(np.abs((gap * surface.normals(uv)).sum(axis=1)), distance, rtol=1e-9, atol=1e-12)
    assert ((uv[:, 1] >= 0) & (uv[:, 1] < 1)).all()


def square_tube(radius=0.001, half=0.03, height=0.08, steps=6, rings=11):
    """Return a tube with a square section and rounded corners [m]."""
    corner = np.linspace(0, np.pi / 2, steps)
    section = np.concatenate(
        [
            np.column_stack((np.cos(a), np.sin(a))) * radius
            + (half - radius) * np.sign((np.cos(middle), np.sin(middle)))
            for middle, a in ((k * np.pi / 2 + np.pi / 4, corner + k * np.pi / 2) for k in range(4))
        ]
    )
    sides = np.concatenate([np.linspace(a, b, 8)[:-1] for a, b in zip(section, np.roll(section, -1, axis=0))])
    return swept(sides, rings, height)


def check_against_brute_force(surface, points, per_span=24):
    """No point of a dense grid is nearer than a footpoint, but for rounding at cells, and the distances are true."""
    u, v = (np.linspace(0, 1, 1 + per_span * len(s.starts)) for s in surface.spans)
    brute = cKDTree(surface.grid_points(u, v).reshape(-1, 3)).query(points)[0]
    uv, distance = footpoints(surface, points)
    assert_allclose(np.linalg.norm(surface.points(uv) - points, axis=1), distance, rtol=1e-9, atol=1e-12)
    assert ((uv >= 0) & (uv <= 1)).all()
    assert (distance - brute - 5e-4 * distance).max() < 1e-6


def around_surface(surface, heights, number, seed):
    """Return random points at some heights over a surface [m]."""
    rng = np.random.default_rng(seed)
    uv = rng.random((number, 2))
    return surface.points(uv) + rng.choice(heights, number)[:, None] * surface.normals(uv)


def test_footpoints_over_sharp_corners_are_nearest():
    """A square tube with corners of 1 mm: points 2 mm outside once went 50 mm along the surface."""
    fit = fit_lines(square_tube(), TubeGrid(10, 80, Z_AXIS, 0.004, "uniform").line_grid(square_tube(), (3, 3)), (3, 3))
    check_against_brute_force(fit.surface, around_surface(fit.surface, (0.002, -0.002, 0.02), 3000, 0))


def test_a_few_points_have_the_footpoints_of_many():
    """The number of points in one call does not change a footpoint."""
    surface = wrist_surface()
    points = around_surface(surface, (-0.02, 0.002, 0.03), 200, 1)
    many = footpoints(surface, points)
    few = [np.concatenate(part) for part in zip(*(footpoints(surface, points[i : i + 4]) for i in range(0, 200, 4)))]
    assert_allclose(few[1], many[1], rtol=0, atol=1e-9)
    assert_allclose(few[0], many[0], rtol=0, atol=1e-6)


def test_footpoints_from_the_axis_of_a_tube_are_on_its_surface():
    """On the axis all directions are equal: the distance is the radius, whichever footpoint is chosen."""
    fit = fit_surface(cylinder(), TubeGrid(6, 30, Z_AXIS, 0.004))
    points = np.column_stack((np.zeros((20, 2)), np.linspace(0.01, 0.07, 20)))
    radius = np.linalg.norm(fit.surface.grid_points(np.linspace(0, 1, 60), np.linspace(0, 1, 400))[..., :2], axis=2)
    found = footpoints(fit.surface, points)[1]
    assert (found >= radius.min() - 1e-6).all() and (found <= radius.max() + 1e-6).all()


def test_second_minimum_is_found():
    """Points inside a wrist are a micrometre farther from one side than from the other: triangles cannot decide it."""
    surface, rng = wrist_surface(), np.random.default_rng(0)
    one = np.column_stack((rng.uniform(0.2, 0.8, 200), rng.random(200)))
    other = one + (0, 0.5)
    start, across = surface.points(one), surface.points(other) - surface.points(one)
    part = np.full(200, 0.5)
    for farther in (0, 0, 0, 0, 1e-6, None):
        points = start + part[:, None] * across
        to_one, to_other = (descend(surface, at, points)[1] for at in (one, other))
        if farther is not None:
            part += (to_other - to_one - farther) / (2 * np.linalg.norm(across, axis=1))
    assert np.median(np.abs(to_one - to_other)) < 2e-6
    assert (footpoints(surface, points)[1] <= np.minimum(to_one, to_other) + 1e-9).all()


def test_second_derivatives_are_within_their_bounds():
    """The bound of each pair of spans holds for all of its points, and is not far above the largest."""
    surface = wrist_surface()
    bounds = _second_derivatives(surface)
    for i, j in ((0, 0), (1, 5), (len(surface.spans[0].starts) - 1, len(surface.spans[1].starts) - 1)):
        u, v = (s.starts[k] + s.lengths[k] * np.linspace(0, 0.999, 30) for s, k in zip(surface.spans, (i, j)))
        r = surface.derivatives(np.column_stack((np.repeat(u, 30), np.tile(v, 30))), 2)
        found = [np.linalg.norm(x, axis=1).max() for x in (r[2, 0], r[1, 1], r[0, 2])]
        assert (found <= bounds[:, i, j] * (1 + 1e-9)).all()
        assert (bounds[:, i, j] < 2 * np.array(found) + 1e-3).all()
