"""A part is off its mesh: by a random field that the mesh does not have, or by noise that a scan has."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.common.arrays import unit
from skin_calib_addon.common.mesh_uncertainty import MeshUncertainty
from skin_calib_addon.geometry import TubeGrid, fit_surface
from skin_calib_addon.geometry.fit.mesh_uncertainty import with_mesh_uncertainty
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh
from tests.shapes import RADIUS, Z_AXIS, cylinder, round_tube

GRID = TubeGrid(10, 20, Z_AXIS, 0.004, "uniform")
UV = np.random.default_rng(0).uniform((0.05, 0), (0.95, 1), (1500, 2))


def random_field(points, length, seed):
    """Return a Gaussian random field of variance one at points (n, 3): plane waves with random amplitudes."""
    rng = np.random.default_rng(seed)
    phases = points @ rng.normal(0, np.sqrt(2) / length, (3, 300))
    a, b = rng.normal(0, 300**-0.5, (2, 300))
    return np.cos(phases) @ a + np.sin(phases) @ b


def test_variances_are_those_of_the_random_field():
    """Covariance exp(-(d / L)^2), and slopes of standard deviation sqrt(2) s / L, over 3000 fields."""
    stated, step = MeshUncertainty(0.3e-3, 8e-3), 1e-5
    x = np.column_stack(((0, step, 8e-3), np.zeros(3), np.zeros(3)))
    here, next_to, far = stated.standard_deviation * np.array([random_field(x, 8e-3, k) for k in range(3000)]).T
    assert here.var() == pytest.approx(stated.variance, rel=0.06)
    assert (here * far).mean() == pytest.approx(stated.variance / np.e, rel=0.15)
    assert ((next_to - here) / step).var() == pytest.approx(stated.slope, rel=0.06)


@pytest.mark.parametrize("net", [(10, 20), (20, 40)], ids=str)
@pytest.mark.parametrize("length", [4e-3, 8e-3, 15e-3], ids=lambda x: f"{x * 1e3:g} mm")
def test_correlated_noise_of_a_scan_is_covered(length, net):
    """Height and slopes of surfaces over three scans of a cylinder, with the noise that the plan states."""
    deviation, mesh, heights, turns = 2e-4, cylinder(around=120, along=50), [], []
    radial = unit(mesh.vertices * (1, 1, 0))
    for seed in range(3):
        noise = deviation * random_field(mesh.vertices, length, seed)[:, None] * radial
        fit = fit_surface(TriangleMesh(mesh.vertices + noise, mesh.faces), TubeGrid(*net, Z_AXIS, 0.004, "uniform"))
        field = with_mesh_uncertainty(fit, MeshUncertainty(deviation, length))
        height, slopes = field.at(UV)
        points, normals, r = field.surface.points(UV), field.surface.normals(UV), field.surface.derivatives(UV)
        heights.append((np.linalg.norm(points[:, :2], axis=1) - RADIUS) / np.sqrt(height))
        off = unit(points * (1, 1, 0)) - normals
        turns.append([(off * unit(by)).sum(axis=1) for by in (r[1, 0], r[0, 1])] / np.sqrt(slopes.T))
    for errors, scatter in ((np.abs(heights), 0.25), (np.abs(turns), 0.45)):
        assert np.sqrt((errors**2).mean()) == pytest.approx(1, rel=scatter)
        assert (errors < 2).mean() > 0.9


@pytest.mark.parametrize("length", [4e-3, 50e-3], ids=lambda x: f"{x * 1e3:g} mm")
def test_a_deviation_that_the_mesh_does_not_have_adds(length):
    """A CAD mesh of a cylinder: both variances, however short the deviation is."""
    fit, stated = fit_surface(cylinder(), GRID), MeshUncertainty(2e-4, length)
    before, after = fit.error_field.at(UV), with_mesh_uncertainty(fit, stated).at(UV)
    assert_allclose(after[0], before[0] + stated.variance, rtol=0.02)
    assert_allclose(after[1], before[1] + stated.slope, rtol=0.03)


@pytest.mark.parametrize("rough", [0.0, 2e-3], ids=["followed", "not followed"])
def test_the_default_adds_to_any_net(rough):
    """Four planes on a long tube have spans of 0.4 m; what they cannot follow is no noise of 0.2 mm."""

    def radius(angle, fraction):
        return RADIUS + rough * np.sin(40 * fraction) * np.cos(3 * angle)

    fit = fit_surface(round_tube(radius, 60, 120, 0.4), TubeGrid(4, 8, Z_AXIS, 0.004, "uniform"))
    before, after = fit.error_field.at(UV)[0], with_mesh_uncertainty(fit, MeshUncertainty()).at(UV)[0]
    assert (after > 0.99 * MeshUncertainty().variance).all() and (after > 0.9 * before).all()


def test_an_exact_mesh_adds_nothing():
    """A standard deviation of zero leaves the field of the fit."""
    fit = fit_surface(cylinder(), GRID)
    assert_allclose(with_mesh_uncertainty(fit, MeshUncertainty(0.0, 1e-3)).height, fit.error_field.height, rtol=0)


def coverage(mesh, grid, radius, uv=UV):
    """Return errors of the height over sigma, for a body about z with a radius by height."""
    field = fit_surface(mesh, grid).error_field
    x, y, z = field.surface.points(uv).T
    step = 1e-6
    lean = np.hypot(1, (radius(z + step) - radius(z - step)) / (2 * step))  # from along the ray to along the normal
    return np.abs(np.hypot(x, y) - radius(z)) / lean / np.sqrt(field.at(uv)[0])


@pytest.mark.parametrize("net", [(10, 20), (20, 40)], ids=str)
def test_long_facets_are_uncertain(net):
    """Five rows of 120 vertices on the outside of a torus: facets of 25 x 2 mm; two sigma held 60 %."""

    def radius(z):
        return 0.015 + np.sqrt(0.055**2 - (z - 0.05) ** 2)

    mesh = round_tube(lambda angle, f: radius(0.1 * f) + 0 * angle, 120, 5)
    errors = coverage(mesh, TubeGrid(*net, Z_AXIS, 0.004, "uniform"), radius)
    assert (errors < 2).mean() > 0.9 and errors.max() < 5


@pytest.mark.parametrize("lines", [20, 40])
def test_errors_near_a_pole_are_stated(lines):
    """A tube around a sphere that ends near its poles: the largest errors are between the sites."""

    def radius(z):
        return np.sqrt(np.maximum(0.05**2 - (z - 0.05) ** 2, 1e-12))

    heights = (1 - np.cos(np.linspace(0.02, np.pi - 0.02, 33))) / 2

    def at_heights(angle, fraction):
        return radius(0.1 * heights[np.rint(fraction * 32).astype(int)])

    tube = round_tube(at_heights, 64, 33)
    vertices = tube.vertices * (1, 1, 0) + np.column_stack(
        (*np.zeros((2, len(tube.vertices))), 0.1 * heights[np.rint(tube.vertices[:, 2] * 320).astype(int)])
    )
    grid = TubeGrid(lines // 2, lines, Z_AXIS, 0.004, "uniform")
    errors = coverage(TriangleMesh(vertices, tube.faces), grid, radius, UV * (0.06, 1))
    assert (errors < 2.2).mean() > 0.95
