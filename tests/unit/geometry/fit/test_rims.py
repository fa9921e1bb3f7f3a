"""Planes and lines exactly on the rims of a mesh: all four sides of every kind of grid."""

import numpy as np
import pytest

from skin_calib_addon.geometry import (
    AcrossGrid,
    CoverSpec,
    Cut,
    PlanesGrid,
    SectorGrid,
    TubeGrid,
    cut_cover,
    fit_surface,
)
from skin_calib_addon.geometry.mesh.triangle_mesh import weld
from skin_calib_addon.geometry.sampling.planes import Planes
from tests.shapes import LENGTH, TURN, Z_AXIS, Motion, cone, cylinder, dome, keep, together, u_planes, v_planes

HALF = np.deg2rad(90.0)
PLANES = PlanesGrid(u_planes(np.linspace(0, LENGTH, 6)), v_planes(10), True)  # from rim to rim


def half_tube():
    """Half of a tube, with straight rims exactly at 90 degrees on both sides of the x axis."""
    return keep(cylinder(), lambda centres: centres[:, 0] > 0)


def single_precision(mesh):
    """The mesh as most files store it: its rims are no longer exactly plane."""
    return weld(mesh.vertices.astype(np.float32), mesh.faces)


def assert_is_complete(fit, error=2e-5):
    """Every sample ray hits the mesh, and the surface is on it up to its edges."""
    assert fit.missing == 0
    assert not fit.warnings
    assert fit.errors.surface_to_mesh.max < error


@pytest.mark.parametrize(
    ("mesh", "turned"), [(cylinder(), None), (cone(0.03, 0.045), 3), (single_precision(cylinder()), 3)]
)
def test_tube_without_margin_is_fitted_up_to_its_rims(mesh, turned):
    """The first and the last plane are on the rims; in the z direction, in any other, and in single precision."""
    motion = Motion.none() if turned is None else Motion(turned)
    fit = fit_surface(motion.mesh(mesh), TubeGrid(6, 20, motion.axis(Z_AXIS), 0.0))
    assert_is_complete(fit)
    ends = motion.points(np.array(((0, 0, 0), (0, 0, LENGTH))))
    along = motion.directions((0, 0, 1.0))
    for edge, end in zip((fit.surface.points(np.array(((0, 0.3),))), fit.surface.points(np.array(((1, 0.3),)))), ends):
        assert abs((edge[0] - end) @ along) < 1e-7


def test_sector_is_fitted_up_to_all_four_rims():
    """Half a tube, without a margin, to the angles of its straight rims."""
    assert_is_complete(fit_surface(half_tube(), SectorGrid(6, 12, -HALF, HALF, Z_AXIS, 0.0)))


@pytest.mark.parametrize("turned", [None, 6])
def test_face_is_fitted_up_to_all_four_rims(turned):
    """A dome on a rectangle, without a margin."""
    motion = Motion.none() if turned is None else Motion(turned)
    grid = AcrossGrid(8, 8, tuple(motion.directions((0, 0, 1.0))), tuple(motion.directions((1.0, 0, 0))), 0.0)
    assert_is_complete(fit_surface(motion.mesh(dome()), grid), 5e-5)


@pytest.mark.parametrize("direction", [(0.0, 0.0, 1.0), (0.3, -0.2, 1.0)])
def test_planes_on_the_rims_of_cuts_pass(direction):
    """The cover between two cuts, straight or tilted, with the outer planes in the planes of the cuts."""
    normal = np.array(direction) / np.linalg.norm(direction)
    low, high = np.array((0, 0, 0.025)), np.array((0, 0, 0.075))
    cuts = Cut(tuple(low), tuple(normal)), Cut(tuple(high), tuple(-normal))
    mesh = cut_cover(cylinder(), CoverSpec(cuts=cuts))
    points = low + np.linspace(0, 1, 6)[:, None] * (high - low)
    grid = PlanesGrid(Planes(points, np.tile(normal, (6, 1))), PLANES.v, True)
    assert_is_complete(fit_surface(mesh, grid), 4e-5)


def test_rim_next_to_a_longer_part_is_found():
    """The rim of the cover is on the plane where a shaft inside goes on beyond it."""
    mesh = together(cylinder(), cylinder(radius=0.01, length=0.15, around=24))
    assert_rim_is_found(fit_surface(mesh, PLANES))


def assert_rim_is_found(fit):
    """Check that the last section of a tube of 35 mm is round."""
    assert fit.missing == 0
    radius = np.hypot(*fit.surface.points(np.column_stack((np.ones(20), np.arange(20) / 20)))[:, :2].T)
    assert abs(radius - 0.035).max() < 1e-4


def test_closed_ends_are_rims_too():
    """A tube with lids: the planes of the lids give the edges of the lids, as its open ends do."""
    tube, turn = cylinder(), TURN / 96 * np.arange(96)
    ring = 0.035 * np.column_stack((np.cos(turn), np.sin(turn), 0 * turn))
    fan = np.column_stack((np.zeros(96, int), 1 + np.arange(96), 1 + (np.arange(96) + 1) % 96))
    lids = [weld(np.vstack(((0, 0, 0), ring)) + (0, 0, z), fan[:, :: (1 if z else -1)]) for z in (0, LENGTH)]
    assert_rim_is_found(fit_surface(together(tube, *lids), PLANES))
