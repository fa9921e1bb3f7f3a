"""Surfaces over facets that are chords of them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import LSQBivariateSpline

from skin_calib_addon.common.arrays import pairs_of
from skin_calib_addon.geometry import SectorGrid, TubeGrid, fit_surface, weld
from skin_calib_addon.geometry.fit.chords import largest_sagittas, lift_to_corners
from skin_calib_addon.geometry.sampling.samples import SampleRows
from tests.shapes import LENGTH, RADIUS, TURN, Z_AXIS, box, cylinder, keep, quads, wrist

MARGIN, PLANES, LINES = 0.002, 14, 50
UV = pairs_of(np.linspace(0, 1, 30), np.arange(40) / 40)


def lobed_radius(angle, z):
    """Return the radius of a tube that bends in both directions [m]."""
    s = z / LENGTH
    return RADIUS * (1 + 0.05 * np.cos(3 * angle + s) + 0.06 * np.sin(2.5 * np.pi * s) - 0.1 * s)


def lobed_tube(around=90, along=45):
    """Return a mesh whose vertices, at uneven positions, have the radius of ``lobed_radius``."""
    rng = np.random.default_rng(0)
    tube = cylinder(around=around, along=along)
    x, y, z = tube.vertices.T
    inner = (z > 0) & (z < z.max())
    angle = np.arctan2(y, x) + rng.uniform(-0.25, 0.25, len(z)) * TURN / around
    z = z + inner * rng.uniform(-0.25, 0.25, len(z)) * LENGTH / (along - 1)
    radius = lobed_radius(angle, z)
    return weld(np.column_stack((radius * np.cos(angle), radius * np.sin(angle), z)), tube.faces)


def lobed_errors(points):
    """Return the distances of points along their radius to the true surface [m]."""
    return np.abs(
        np.hypot(points[:, 0], points[:, 1]) - lobed_radius(np.arctan2(points[:, 1], points[:, 0]), points[:, 2])
    )


def spline_through_vertices(mesh, angle, z):
    """Return points of SciPy's least squares of the radius of the vertices, on as many even knots."""
    x, y, heights = mesh.vertices.T
    known = (heights >= MARGIN) & (heights <= LENGTH - MARGIN)
    turns = np.arctan2(y, x)[known] % TURN
    turns = np.concatenate((turns - TURN, turns, turns + TURN))
    step = TURN / LINES
    around = np.arange(-4, LINES + 5) * step
    within = (turns > around[0] - step) & (turns < around[-1] + step)
    rest = (np.tile(c[known], 3)[within] for c in (heights, np.hypot(x, y)))
    along = np.linspace(MARGIN, LENGTH - MARGIN, PLANES - 2)[1:-1]
    h, r = rest
    spline = LSQBivariateSpline(turns[within], h, r, around, along)
    radius = spline(angle % TURN, z, grid=False)
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), z))


def test_surface_is_as_near_to_the_truth_as_a_spline_through_the_vertices():
    """SciPy's least squares has the true angle and height of each vertex; the fit has the mesh only."""
    mesh = lobed_tube()
    surface = fit_surface(mesh, TubeGrid(PLANES, LINES, Z_AXIS, MARGIN), chords=True).surface
    uv = pairs_of((np.arange(150) + 0.5) / 150, np.arange(200) / 200)
    points = surface.points(uv)
    errors = lobed_errors(points)
    peers = lobed_errors(spline_through_vertices(mesh, np.arctan2(points[:, 1], points[:, 0]), points[:, 2]))
    facets = lobed_errors(fit_surface(mesh, TubeGrid(PLANES, LINES, Z_AXIS, MARGIN)).surface.points(uv))
    assert errors.mean() < 1.1 * peers.mean() < 0.1 * facets.mean()
    assert errors.max() < 1.1 * peers.max()


@pytest.mark.parametrize("around", [48, 96])
def test_surface_is_on_the_true_cylinder_up_to_the_edges(around):
    """The corners next to the edges of a sector are partly outside of the surface."""
    surface = fit_surface(cylinder(around=around), SectorGrid(5, 12, -0.5, 1.0, Z_AXIS, 0.01), chords=True).surface
    radii = np.hypot(*surface.points(UV)[:, :2].T)
    facet = RADIUS * (1 - np.cos(np.pi / around))
    assert np.abs(radii - RADIUS).mean() < 0.03 * facet and np.abs(radii - RADIUS).max() < 0.06 * facet


def test_gaps_end_where_the_surface_meets_the_corners():
    """Over a mesh of the surface's own points the gaps equal the residuals: the surface stays."""
    fit = fit_surface(wrist(), TubeGrid(10, 20, Z_AXIS, 0.004))
    u, v = np.linspace(0, 1, 17), np.arange(23) / 23
    mesh = quads(fit.surface.grid_points(u, v), closed=(False, True))
    samples = SampleRows.of(mesh, fit.lines, fit.basis).cast(
        fit.basis.blend(fit.offsets[..., None] * fit.lines.directions)
    )
    met = ~np.isnan(samples.residuals)
    offsets, gaps = lift_to_corners(mesh, fit.lines, fit.basis, fit.offsets, samples)
    assert met.mean() > 0.9 and np.abs(samples.residuals[met]).mean() > 1e-4
    assert_allclose(gaps[met], -samples.residuals[met], rtol=0, atol=3e-6)  # of half a millimetre
    assert_allclose(offsets, fit.offsets, rtol=0, atol=3e-6)
    assert (gaps[~met] == 0).all()


def test_gap_is_zero_next_to_a_sharp_edge():
    """All faces of a box have one."""
    assert (largest_sagittas(box((0, 0, 0), (0.1, 0.1, 0.1))) == 0).all()


def test_surface_through_the_corners_of_a_half_keeps_its_distance_over_a_hole():
    """Rays without a hit have no gap."""
    mesh = keep(cylinder(around=48), lambda c: ~((c[:, 0] > 0.02) & (np.abs(c[:, 2] - 0.05) < 0.01)))
    fit = fit_surface(mesh, TubeGrid(8, 16, Z_AXIS, 0.004), chords=True)
    assert fit.missing > 0
    radii = np.hypot(*fit.surface.points(UV)[:, :2].T)
    assert np.median(np.abs(radii - RADIUS)) < 1e-6


@pytest.mark.parametrize("seed", range(2))
def test_vertices_of_a_noisy_scan_are_not_on_the_true_surface(seed):
    """Facets are used there, as without the option, and a warning says so."""
    tube = cylinder(around=120, along=60)
    noise = np.random.default_rng(seed).normal(scale=1.5e-4, size=tube.vertices.shape)
    scan, grid = weld(tube.vertices + noise, tube.faces), TubeGrid(8, 16, Z_AXIS, 0.004, "uniform")
    plain, chords = fit_surface(scan, grid), fit_surface(scan, grid, chords=True)
    assert_allclose(chords.offsets, plain.offsets, rtol=0, atol=1e-12)
    assert "chords-refused" in {w.code for w in chords.warnings}
    assert "chords-refused" not in {w.code for w in plain.warnings}


def test_small_noise_is_no_reason_to_keep_the_facets():
    """Vertices are off by a fifth of the distance of the facets: the surface is nearer than the facets."""
    tube = cylinder(around=48, along=30)
    noise = np.random.default_rng(0).normal(scale=1e-5, size=tube.vertices.shape)
    fit = fit_surface(weld(tube.vertices + noise, tube.faces), TubeGrid(8, 16, Z_AXIS, 0.004), chords=True)
    assert "chords-refused" not in {w.code for w in fit.warnings}
    radii = np.hypot(*fit.surface.points(UV)[:, :2].T)
    assert np.abs(radii - RADIUS).mean() < 5e-6
