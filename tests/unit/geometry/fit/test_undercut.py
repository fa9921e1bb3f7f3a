"""Sections that fold back behind themselves: the part that the surface cannot follow is named."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

from skin_calib_addon.geometry import AcrossGrid, PlanesGrid, SectorGrid, TubeGrid, cut_cover, fit_surface, load_mesh
from skin_calib_addon.geometry.fit.auto import fit_grid
from skin_calib_addon.geometry.sampling.planes import Planes
from skin_calib_addon.geometry.surface.footpoints import footpoints
from skin_calib_addon.plan import load_plan
from tests.shapes import TURN, Z_AXIS, Motion, lobed, quads, u_planes, v_planes, wrist


def outline(swing, points=4000, lobes=5, depth=0.004):
    """Points of a curve with lobes; they lean over where ``swing`` is above one. Shape (k, 2) [m]."""
    t = TURN * np.arange(points) / points
    angle, radius = t + swing / lobes * np.sin(lobes * t), 0.035 + depth * np.cos(lobes * t + 1.2)
    return radius[:, None] * np.column_stack((np.cos(angle), np.sin(angle)))


def undercuts(fit):
    """The warnings with this code."""
    return [w for w in fit.warnings if w.code == "undercut"]


def folded(points, swing):
    """The points of the outline at angles that it has several times."""
    angle = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    crossings = np.zeros(len(points), int)
    for turn in (-TURN, 0, TURN):
        high, low = np.maximum(angle, np.roll(angle, -1)), np.minimum(angle, np.roll(angle, -1))
        inside = np.abs(high - low) < 1
        crossings += np.searchsorted(np.sort(low[inside]), angle + turn) - np.searchsorted(
            np.sort(high[inside]), angle + turn
        )
    return points[crossings > 1]


def test_undercut_is_a_warning_with_its_place():
    """Five lobes that lean over: the distance and the place are those of the folded part of the true outline."""
    motion = Motion(2)
    fit = fit_surface(motion.mesh(lobed(1.25)), TubeGrid(5, 20, motion.axis(Z_AXIS), 0.002))
    (warning,) = undercuts(fit)
    row = fit.surface.points(np.column_stack((np.full(5000, 0.5), np.arange(5000) / 5000)))
    row = (row - motion.shift) @ motion.rotation
    hidden = folded(outline(1.25), 1.25)
    off = cKDTree(row[:, :2]).query(hidden)[0]
    assert_allclose(warning.value, off.max(), rtol=0.1)
    assert warning.value > 4e-4  # and more lines do not help
    place = (np.array(warning.where.point) - motion.shift) @ motion.rotation
    assert cKDTree(row[:, :2]).query(place[:2])[0] > 0.9 * warning.value
    assert cKDTree(hidden).query(place[:2])[0] < 2e-4
    assert f"{warning.value * 1e3:.2f} mm" in warning.message and "half-plane at" in warning.message


@pytest.mark.parametrize("mesh", [lobed(0.95), wrist()])
def test_star_shaped_sections_have_no_undercut(mesh):
    """Lobes that do not lean over, and plain tubes."""
    fit = fit_surface(mesh, TubeGrid(5, 40, Z_AXIS, 0.002))
    assert not fit.samples.folds.any() and not undercuts(fit)


def test_undercut_in_fanned_planes_is_found():
    """Planes that are not parallel, through the same five lobes."""
    u = u_planes(np.linspace(0.01, 0.09, 5), np.array((-0.05, 0, 0.05, 0, -0.05)))
    fit = fit_surface(lobed(1.25), PlanesGrid(u, v_planes(15), True))
    (warning,) = undercuts(fit)
    surface = fit.surface.grid_points(np.linspace(0, 1, 161), np.arange(2000) / 2000).reshape(-1, 3)
    hidden = folded(outline(1.25, 2000), 1.25)
    heights = np.linspace(0.02, 0.08, 25)
    points = np.column_stack((np.tile(hidden, (25, 1)), np.repeat(heights, len(hidden))))
    assert_allclose(warning.value, cKDTree(surface).query(points)[0].max(), rtol=0.1)


def test_distance_of_an_undercut_is_that_from_the_surface():
    """In tilted sections the curve is farther than the surface."""
    u = Planes(np.linspace(0.025, 0.075, 5)[:, None] * (0, 0, 1.0), np.tile((0, 0.5, 1.0), (5, 1)))
    fit = fit_surface(lobed(1.25), PlanesGrid(u, v_planes(15), True))
    (warning,) = undercuts(fit)
    _, (distance,) = footpoints(fit.surface, np.array([warning.where.point]))
    assert_allclose(warning.value, distance, rtol=1e-6)


def test_undercut_outside_a_sector_is_not_named():
    """A sector between two of the lobes has no warning, one over two of them has."""
    angles = np.arctan2(*folded(outline(1.25), 1.25).T[::-1])
    start, stop = next((a, a + 0.3) for a in np.arange(-3, 3, 0.05) if not ((angles > a) & (angles < a + 0.3)).any())
    between = fit_surface(lobed(1.25), SectorGrid(5, 8, start, stop, Z_AXIS, 0.002))
    over = fit_surface(lobed(1.25), SectorGrid(5, 14, start, start + 1.5, Z_AXIS, 0.002))
    assert between.samples.folds.any() and not undercuts(between)
    assert undercuts(over)


def test_undercut_of_a_face_is_found():
    """A ridge on a sheet that leans over, below parallel lines."""
    x, y = np.meshgrid(np.linspace(0, 0.1, 201), np.linspace(0, 0.08, 9), indexing="ij")
    bump = np.exp(-(((x - 0.05) / 0.008) ** 2))
    mesh = quads(np.stack((x + 0.012 * bump, y, 0.01 * bump), axis=-1))
    fit = fit_surface(mesh, AcrossGrid(5, 30, (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 0.002))
    (warning,) = undercuts(fit)
    assert 2e-4 < warning.value < 0.01


def test_side_walls_of_a_sole_are_not_undercuts():
    """The sections of the sample sole run up its walls, behind the last rays; the fit is within 0.02 mm."""
    plan = load_plan(Path(__file__).parents[4] / "sample_scenes" / "sole.plan.json")
    fit = fit_grid(cut_cover(load_mesh(plan.mesh), plan.surface.cover), plan.surface.grid, plan.surface.degree)
    assert fit.samples.folds.any() and fit.errors.surface_to_mesh.max < 2e-5
    assert "undercut" not in [warning.code for warning in fit.warnings]
