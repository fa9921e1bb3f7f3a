"""Surfaces over facets that are chords of them."""

import numpy as np
from numpy.testing import assert_allclose

from skin_calib_addon.geometry import SectorGrid, TubeGrid, fit_surface, weld
from skin_calib_addon.geometry.fit.chords import chord_gaps, heights_over, largest_sagittas
from skin_calib_addon.geometry.sampling.samples import SampleRows
from tests.shapes import LENGTH, RADIUS, Z_AXIS, box, cylinder, plane_surface, wrist


def test_height_over_a_cylinder_is_the_distance_to_it():
    """Aside of the parameters, and beyond all edges: there to some hundredths of how far the cylinder falls off."""
    fine = cylinder(around=960, along=4)
    surface = fit_surface(fine, SectorGrid(4, 12, -0.5, 1.0, Z_AXIS, 0.01)).surface
    rng = np.random.default_rng(0)
    angle, z, height = (rng.uniform(-x, x, 300) + y for x, y in ((1.5, 0.25), (LENGTH / 2, LENGTH / 2), (1e-4, 0)))
    radius = RADIUS + height
    points = np.column_stack((radius * np.cos(angle), radius * np.sin(angle), z))
    uv = np.column_stack(((z - 0.01) / (LENGTH - 0.02), (1.0 - angle) / 1.5)).clip(0, 1)
    found, normals = heights_over(surface, points, uv + rng.uniform(-0.05, 0.05, (300, 2)))
    beyond = np.maximum(np.abs(angle - 0.25) - 0.75, 0)
    assert beyond.max() > 0.7
    assert (np.abs(found - height) < 1e-6 + 0.03 * RADIUS * (1 - np.cos(beyond))).all()
    assert (np.abs(normals[:, 2]) < 1e-6).all()


def test_height_over_a_plane_is_exact():
    """Wherever the parameters start, beyond the edges too."""
    rng = np.random.default_rng(1)
    points = rng.uniform((-0.02, -0.02, -0.01), (0.12, 0.1, 0.01), (100, 3))
    found, normals = heights_over(plane_surface(), points, rng.uniform(0, 1, (100, 2)))
    assert_allclose(found, points[:, 2], rtol=0, atol=1e-15)
    assert_allclose(normals, np.tile((0, 0, 1.0), (100, 1)), rtol=0, atol=1e-15)


def test_gaps_end_where_the_surface_meets_the_corners():
    """Over a mesh of the surface's own points the gaps equal the residuals: the iterations end there."""
    fit = fit_surface(wrist(), TubeGrid(10, 20, Z_AXIS, 0.004))
    u, v = np.linspace(0, 1, 17), np.arange(23) / 23
    corners = fit.surface.points(np.column_stack((np.repeat(u, 23), np.tile(v, 17))))
    i, j = (x.ravel() for x in np.indices((16, 23)))
    p, q = 23 * i + j, 23 * i + (j + 1) % 23
    mesh = weld(corners, np.concatenate((np.column_stack((p, p + 23, q + 23)), np.column_stack((p, q + 23, q)))))
    samples = SampleRows.of(mesh, fit.lines, fit.basis).cast(
        fit.basis.blend(fit.offsets[..., None] * fit.lines.directions)
    )
    met = ~np.isnan(samples.residuals)
    gaps = chord_gaps(mesh, fit.surface, samples)
    assert met.mean() > 0.9 and np.abs(samples.residuals[met]).mean() > 1e-4
    assert_allclose(gaps[met], -samples.residuals[met], rtol=0, atol=3e-7)  # of half a millimetre, by one Newton step
    assert (gaps[~met] == 0).all()


def test_gap_is_zero_next_to_a_sharp_edge():
    """All faces of a box have one."""
    assert (largest_sagittas(box((0, 0, 0), (0.1, 0.1, 0.1))) == 0).all()
