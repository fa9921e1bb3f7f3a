"""A bent axis: found where a straight one does not serve, with planes that follow."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sample_scenes.shapes import tube_mesh
from skin_calib_addon.common.arrays import unit
from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.geometry import Axis, TubeGrid, fit_surface
from skin_calib_addon.geometry.grid import curved_axis
from skin_calib_addon.geometry.grid.curved_axis import CurvedAxis, curve_through
from skin_calib_addon.geometry.grid.parametrizations import TubeParametrization
from tests.shapes import Motion, cylinder, welded, wrist

BEND, RADIUS = 0.12, 0.03


def bent(angle, around=120, along=80):
    """A tube of three slight ridges on a circular arc in the x-z plane, thinner towards its end."""

    def point(a, height):
        radius, phi = RADIUS * (1 - 0.15 * height) * (1 + 0.03 * np.cos(3 * a)), angle * height
        centre = BEND * np.column_stack((1 - np.cos(phi), 0 * phi, np.sin(phi)))
        outward = np.column_stack((np.cos(phi), 0 * phi, -np.sin(phi)))
        return centre + radius[:, None] * (np.cos(a)[:, None] * outward + np.sin(a)[:, None] * (0, 1.0, 0))

    return welded(tube_mesh(point, around, along))


def test_planes_follow_a_bent_tube():
    """Nearly its whole length is covered, across the arc; the surface is as good as on a straight tube."""
    angle = np.deg2rad(120)
    fit = fit_surface(bent(angle), TubeGrid(16, 32))
    points, normals = fit.lines.planes_u.points, fit.lines.planes_u.normals
    assert 0.9 * BEND * angle < np.linalg.norm(np.diff(points, axis=0), axis=1).sum() < BEND * angle
    assert_allclose(np.hypot(points[:, 0] - BEND, points[:, 2]), BEND, atol=0.002)
    across = np.column_stack((points[:, 2], 0 * points[:, 0], BEND - points[:, 0])) / BEND
    slant = np.degrees(np.arccos(np.clip(np.abs((normals * across).sum(axis=1)), 0, 1)))
    assert slant.max() < 8
    assert fit.errors.surface_to_mesh.mean < 0.008e-3 and fit.errors.hausdorff < 0.04e-3
    assert fit.missing == 0 and fit.smallest_area > 0.3


def test_bent_axis_moves_along():
    """Turned, shifted, scaled: the surface goes with its mesh."""
    mesh, motion = bent(1.8, 60, 40), Motion(5, 0.7)
    here, there = (fit_surface(m, TubeGrid(8, 12)).surface for m in (mesh, motion.mesh(mesh)))
    assert_allclose(there.control_net, motion.points(here.control_net), rtol=0, atol=1e-9 * mesh.size)


@pytest.mark.parametrize("mesh", [cylinder(), wrist(), bent(0.5)], ids=["cylinder", "wrist", "slight bend"])
def test_straight_axis_serves_where_it_can(mesh):
    """No curve where a line stays near the centres."""
    parametrization = TubeGrid(8, 16).region.parametrization(mesh)
    assert isinstance(parametrization, TubeParametrization) and not isinstance(parametrization.frame, CurvedAxis)


def test_of_curves_that_alternate_the_one_nearest_to_its_centres_counts(monkeypatch):
    """The centres are 0.4 mm from the second curve, and 5 mm from those before and after it."""
    mesh, away = bent(np.pi / 2, 40, 30), iter((0.0, 5e-3, -0.4e-3, *10 * (-5e-3, 5e-3)))
    found, sections = [], curved_axis.section_centres

    def alternating(mesh, planes, fan):
        centres, radius, whole = sections(mesh, planes, fan)
        found.append(planes.points)
        step = next(away)
        return (planes.points[whole] + (0, step, 0) if step else centres), radius, whole

    monkeypatch.setattr(curved_axis, "section_centres", alternating)
    frame = TubeGrid(8, 16, Axis((0.02, 0.0, 0.0), (0.5, 0.0, 1.0))).region.parametrization(mesh).frame
    axis = curved_axis.find_curved_axis(mesh, frame)
    assert len(found) > 4 and np.abs(axis.points[:, 1] - 5e-3).max() < 1e-4


def test_given_straight_axis_is_kept_on_a_bent_tube():
    """Its planes stand across the axis of the author, and its lines start there, although a curve would fit better."""
    mesh, axis = bent(np.pi / 2, 40, 30), Axis((0.02, 0.0, 0.0), (0.5, 0.0, 1.0))
    assert isinstance(TubeGrid(8, 16).region.parametrization(mesh).frame, CurvedAxis)
    fit = fit_surface(mesh, TubeGrid(5, 12, axis, 0.04, "uniform"), max_deviation=0.05)
    assert_allclose(fit.lines.planes_u.normals, np.tile(unit(axis.direction), (5, 1)), atol=1e-12)
    arms = fit.lines.origins - axis.point
    assert_allclose(np.cross(arms, unit(axis.direction)), 0.0, atol=1e-12)


def test_margin_is_left_free_at_both_ends():
    """From the ends of the mesh inward; one that leaves nothing is refused."""
    mesh = bent(np.pi / 2)
    free, inset = (TubeGrid(8, 16, margin=margin).region.parametrization(mesh).span for margin in (0.002, 0.022))
    assert_allclose((inset[0] - free[0], free[1] - inset[1]), 0.02, rtol=1e-9)
    with pytest.raises(InvalidPlan, match="A margin of 100 mm at both ends leaves nothing along the axis"):
        TubeGrid(8, 16, margin=0.1).region.parametrization(mesh)


def test_frames_of_a_curve_turn_as_little_as_may_be():
    """Along a plane arc the axis across that plane stays the same; all frames are orthonormal, beyond the ends too."""
    phi = np.linspace(0, 2.0, 15)
    curved_axis = curve_through(np.column_stack((np.cos(phi), np.sin(phi), 0 * phi)), np.array((0.0, 0.0, 1.0)))
    s = np.linspace(-0.2, curved_axis.stations[-1] + 0.2, 9)
    fan = curved_axis.fan(s, np.array((0.0, np.pi / 2)))
    assert_allclose(fan[:, 0], np.tile((0.0, 0, 1), (9, 1)), atol=1e-12)
    e3 = curved_axis.planes(s).normals
    assert_allclose(np.cross(e3, fan[:, 0]), fan[:, 1], atol=1e-12)
    straight = curved_axis.planes(s[:1]).points[0] + 0.2 * e3[0]
    assert_allclose(straight, curved_axis.planes(np.zeros(1)).points[0], atol=1e-12)
