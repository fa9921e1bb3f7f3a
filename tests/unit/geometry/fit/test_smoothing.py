"""Noisy scans: the surface is as stiff as the data ask for, and clean meshes are fitted as before."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.geometry import TubeGrid, fit_surface, weld
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.surface.distance import surface_samples
from tests.shapes import Z_AXIS, subdivided, wrist


def scanned(mesh, noise, seed=0):
    """The mesh with its vertices moved along their normals by a normal error [m]."""
    normals = np.zeros_like(mesh.vertices)
    np.add.at(normals, mesh.faces.ravel(), np.repeat(mesh.face_normals, 3, axis=0))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    error = noise * np.random.default_rng(seed).standard_normal(len(normals))
    return weld(mesh.vertices + error[:, None] * normals, mesh.faces)


def distance_to(mesh, fit):
    """Mean distance from a surface to a mesh [m]."""
    uv, weights = surface_samples(fit.surface)
    return float(weights @ closest(mesh, fit.surface.points(uv))[0] / weights.sum())


@pytest.mark.parametrize(("noise", "error", "size"), [(1e-4, 0.03e-3, (20, 60)), (1e-3, 0.21e-3, (10, 20))])
def test_scan_noise_is_smoothed(noise, error, size):
    """A coarse and a fine net find the same shape under the noise; least squares alone are off by half of it."""
    fit = fit_surface(scanned(wrist(), noise), TubeGrid(*size, Z_AXIS, 0.002))
    assert distance_to(wrist(), fit) < error
    assert fit.noise == 0 or 0.5 * noise < fit.noise < 1.1 * noise
    assert (fit.noise > 0) or size == (10, 20)


@pytest.mark.parametrize("size", [(9, 20), (10, 20)])
def test_coarse_net_takes_a_sample_for_each_vertex_of_a_scan(size, monkeypatch):
    """Three sites per span leave out most vertices, and their noise is not averaged."""
    scan, grid = scanned(wrist(), 5e-4), TubeGrid(*size, Z_AXIS, 0.004, "uniform")
    fit = fit_surface(scan, grid)
    monkeypatch.setattr("skin_calib_addon.geometry.fit.fitting.sites_for_noise", lambda mesh, basis, samples: 3)
    few = fit_surface(scan, grid)
    assert few.residuals.size < 0.5 * fit.residuals.size
    assert distance_to(wrist(), fit) < 0.9 * distance_to(wrist(), few)
    assert fit_surface(wrist(), grid).residuals.shape == few.residuals.shape  # a clean mesh keeps three


def test_subdivided_scan_has_the_same_surface():
    """Vertices inside faces have no noise of their own: they neither start the smoothing nor add sample sites."""
    scan, grid = scanned(wrist(), 1e-3), TubeGrid(10, 20, Z_AXIS, 0.002)
    fit, again = fit_surface(scan, grid), fit_surface(subdivided(scan), grid)
    assert fit.residuals.shape == again.residuals.shape and fit.stiffness == again.stiffness
    assert_allclose(again.surface.control_net, fit.surface.control_net, rtol=0, atol=1e-6)


def test_scan_noise_is_smoothed_next_to_holes():
    """A tenth of the faces is missing too."""
    scan = scanned(wrist(), 3e-4)
    scan = weld(scan.vertices, scan.faces[np.random.default_rng(1).random(len(scan.faces)) > 0.1])
    fit = fit_surface(scan, TubeGrid(20, 60, Z_AXIS, 0.002))
    assert 0.05 < fit.missing < 0.15
    assert distance_to(wrist(), fit) < 0.08e-3


@pytest.mark.parametrize("size", [(5, 10), (20, 60)])
def test_clean_mesh_is_not_smoothed(size):
    """Neither where the net is too coarse for the shape nor where only facets are left."""
    assert fit_surface(wrist(), TubeGrid(*size, Z_AXIS, 0.002)).noise == 0


@pytest.mark.parametrize("size", [(5, 10), (6, 10)])
def test_what_a_coarse_net_leaves_is_no_noise(size):
    """It goes along from sample to sample, so that no more are taken; noise that rules it does not."""
    grid = TubeGrid(*size, Z_AXIS, 0.002, "uniform")
    clean, noisy = (fit_surface(mesh, grid) for mesh in (wrist(), scanned(wrist(), 2e-3)))
    assert clean.residuals.size < 1600 < noisy.residuals.size
