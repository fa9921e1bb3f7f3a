"""Limits of meshes and axes: an input just within passes, one just beyond does not.

The numbers are written out, so that a limit does not change unnoticed.
"""

import numpy as np
import pytest

from skin_calib_addon.common.errors import InvalidMesh, InvalidPlan
from skin_calib_addon.geometry import TubeGrid, fit_surface
from skin_calib_addon.geometry.grid.axis import FULL_TURN_ANGLES, axis_through, find_axis
from skin_calib_addon.geometry.grid.curved_axis import section_centres
from skin_calib_addon.geometry.grid.cut_planes import cut_normal
from skin_calib_addon.geometry.grid.grids import Across, Planes, PlanesGrid
from skin_calib_addon.geometry.mesh.shells import convex_hull, fraction_inside
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, check_size
from skin_calib_addon.geometry.mesh.units import likely_mistake
from skin_calib_addon.geometry.surface.footpoints import _cell_ends, _second_derivatives
from tests import shapes


def scaled(size):
    """A cylinder whose bounding box has this diagonal [m]."""
    mesh = shapes.cylinder()
    return TriangleMesh(mesh.vertices * size / mesh.size, mesh.faces)


@pytest.mark.parametrize("size", [2.1e-3, 4.9])
def test_links_have_2_mm_to_5_m(size):
    """Within a factor of 1.1 the size is a link; beyond it the message names it."""
    check_size(scaled(size), "m", "a.stl")
    with pytest.raises(InvalidMesh, match=r"a\.stl has a diameter of"):
        check_size(scaled(size * (1.1 if size > 1 else 1 / 1.1)), "m", "a.stl")


def test_links_in_a_plausible_unit_have_a_longest_side_of_5_mm_to_3_m():
    """A side beyond these limits has another unit."""
    assert likely_mistake(5.1e-3) is None and likely_mistake(2.9) is None
    assert likely_mistake(4.9e-3) == ("", 1.0) and likely_mistake(2.9e-3) == ("m", 1e3)
    assert likely_mistake(3.1) == ("cm", 1e-2)


def test_direction_within_5_degrees_of_an_axis_is_that_axis():
    """At 4.9 degrees the cut is square to the link frame, at 5.1 degrees it is oblique."""
    mesh = shapes.cylinder()
    for degrees, is_axis in ((4.9, True), (5.1, False)):
        direction = np.array((0, np.sin(np.deg2rad(degrees)), np.cos(np.deg2rad(degrees))))
        normal = cut_normal(mesh, np.zeros(3), direction)
        assert (np.abs(normal).max() == 1) == is_axis


def test_sections_of_an_axis_are_2_percent_of_the_mesh_apart():
    """Two points nearer to each other along the link give no direction."""
    mesh = shapes.cylinder()
    middle, apart = mesh.vertices.mean(axis=0), np.array((0, 0, 0.02 * mesh.size))
    axis_through(mesh, middle, middle + 1.1 * apart)
    with pytest.raises(InvalidPlan, match="too close to each other"):
        axis_through(mesh, middle, middle + 0.9 * apart)


def test_thin_sheet_has_a_thickness_below_15_percent_of_its_width():
    """A flat closed box is a tube at 16 % and a sheet with two sides at 14 %."""
    for ratio, is_sheet in ((0.16, False), (0.14, True)):
        mesh = shapes.box((0, 0, 0), (0.1 * ratio, 0.1, 0.2))
        if is_sheet:
            with pytest.raises(InvalidPlan, match="thin sheet"):
                find_axis(mesh)
        else:
            find_axis(mesh)


@pytest.mark.parametrize("degrees, is_part", [(59, True), (63, False), (74, False)])
def test_faces_up_to_61_degrees_from_the_normal_belong_to_a_grid(degrees, is_part):
    """The last 30 mm of a plate are a chamfer; 60 degrees are a usual one."""
    slope = np.tan(np.deg2rad(degrees))
    mesh = shapes.sheet(lambda x, y: -slope * np.maximum(x - 0.07, 0))
    along = Across(normal=(0, 0, 1), margin=0.0).parametrization(mesh)
    assert max(np.ptp(along.span), np.ptp(along.breadth)) == pytest.approx(0.1 if is_part else 0.08, abs=1e-9)


@pytest.mark.parametrize("degrees, is_warned", [(9, True), (11, False), (19, False)])
def test_planes_that_cross_at_less_than_10_degrees_give_a_warning(degrees, is_warned):
    """Planes across x, and others that are rotated by a few degrees from them about z."""
    a, steps = np.deg2rad(degrees), np.linspace(0.02, 0.08, 4)[:, None]
    along, across = np.array((1.0, 0, 0)), np.array((np.cos(a), np.sin(a), 0))
    u, v = (Planes(steps * normal, np.tile(normal, (4, 1))) for normal in (along, across))
    warnings = PlanesGrid(u, v, False).line_grid(shapes.dome()).warnings
    assert [warning.code for warning in warnings] == (["planes-nearly-parallel"] if is_warned else [])


@pytest.mark.parametrize("missed, is_complete", [(0, True), (3, True), (6, False)])
def test_sections_are_complete_if_less_than_a_twentieth_of_the_rays_misses(missed, is_complete):
    """Of 90 rays, some pass through a slot along a tube."""
    mesh = shapes.cylinder(around=360)
    slot = np.deg2rad(4 * missed)
    angles = np.arctan2(*mesh.triangles.mean(axis=1)[:, 1::-1].T) % (2 * np.pi)
    open_tube = TriangleMesh(mesh.vertices, mesh.faces[(angles - np.deg2rad(1.7)) % (2 * np.pi) >= slot])
    fan = np.column_stack((np.cos(FULL_TURN_ANGLES), np.sin(FULL_TURN_ANGLES), 0 * FULL_TURN_ANGLES))
    planes = Planes(np.array([(0, 0, 0.5 * shapes.LENGTH)]), np.array([(0, 0, 1.0)]))
    _, _, complete = section_centres(open_tube, planes, fan[None])
    assert complete.tolist() == [is_complete]


def test_fractions_inside_a_hull_have_steps_of_3_percent_of_a_side():
    """A square sheet moves into a cube, by twelve hundredths of its side."""
    sheet = TriangleMesh(np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0.0)]), np.array([(0, 1, 2), (0, 2, 3)]))
    corners = np.stack(np.meshgrid((0, 1), (-1, 2), (-1, 1)), axis=-1).reshape(-1, 3).astype(float)
    found = [fraction_inside(convex_hull(corners + (x, 0, 0)), sheet, np.arange(2)) for x in np.linspace(0.4, 0.52, 97)]
    assert 8 <= len(np.unique(np.round(found, 9))) <= 16
    assert np.abs(found - (1 - np.linspace(0.4, 0.52, 97))).max() < 0.03


def test_cells_of_a_surface_deviate_by_a_few_percent_of_their_side():
    """Around a tube; 5 % are allowed, and bounds of second derivatives exceed these derivatives."""
    surface = fit_surface(shapes.cylinder(around=96), TubeGrid(4, 4, shapes.Z_AXIS, 0.002)).surface
    (_, ends), _ = _cell_ends(surface, _second_derivatives(surface), 30)
    side = np.sqrt(2 * np.pi * shapes.RADIUS * (shapes.LENGTH - 0.004) / 30)
    deviations = []
    for start, stop in zip(ends[:-1], ends[1:]):
        points = surface.points(np.column_stack((np.full(41, 0.5), np.linspace(start, stop, 41))))
        chord = points[-1] - points[0]
        off = np.cross(points - points[0], chord / np.linalg.norm(chord))
        deviations.append(np.linalg.norm(off, axis=1).max())
    assert 0.022 < max(deviations) / side < 0.04
