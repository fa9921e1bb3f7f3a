"""Skins with a thickness: parallel surfaces, and sheets that keep their lengths there."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import InvalidPlan, millimetres
from skin_calib_addon.geometry import AcrossGrid, TubeGrid, fit_surface
from skin_calib_addon.skin import SheetLattice, sheet_taxels, wrap_sheet
from skin_calib_addon.skin.sheet.offset import offset_surface
from tests.shapes import RADIUS, cone_surface, plane_surface, sheet, wrist, wrist_surface

UV = np.random.default_rng(0).random((2000, 2))


@pytest.mark.parametrize("distance", [-0.002, 0.0005, 0.004])
@pytest.mark.parametrize("degree", [(3, 3), (2, 4), (5, 2)])
def test_parallel_surface_lies_at_the_distance(distance, degree):
    """The distance along the normals of a wrist is exact to two hundredths at equal parameters; the orientation is the
    same.
    """
    surface = fit_surface(wrist(), TubeGrid(12, 40, margin=0.002), degree).surface
    layer = offset_surface(surface, distance)
    expected = surface.points(UV) + distance * surface.normals(UV)
    assert np.linalg.norm(layer.points(UV) - expected, axis=1).max() < 0.02 * abs(distance)
    assert (layer.normals(UV) * surface.normals(UV)).sum(axis=1).min() > np.cos(np.deg2rad(1))
    assert layer.closed == surface.closed and layer.degree == surface.degree


def test_parallel_of_a_plane_and_of_a_cylinder_is_one():
    """The parallel surface is exact where a spline can be."""
    assert_allclose(offset_surface(plane_surface(), 0.003).points(UV)[:, 2], 0.003, rtol=0, atol=1e-15)
    tube = offset_surface(cone_surface(RADIUS, RADIUS), 0.003).points(UV)
    assert_allclose(np.linalg.norm(tube[:, :2], axis=1), RADIUS + 0.003, rtol=0, atol=1e-7)


def test_no_offset_is_the_surface_itself():
    """A zero offset makes no new fit."""
    assert offset_surface(wrist_surface(), 0.0) is wrist_surface()


@pytest.mark.parametrize(("distance", "sign"), [(-0.04, "-40"), (-0.2, "-200")])
def test_offset_beyond_the_radius_is_refused(distance, sign):
    """Inside a tube of 35 mm the parallel surface turns inside out; the error names the position."""
    with pytest.raises(InvalidPlan, match=rf"a skin {sign} mm above the surface folds near \(.*\) mm") as error:
        offset_surface(cone_surface(RADIUS, RADIUS), distance)
    assert millimetres(error.value.numbers["place"].point) in str(error.value)


@pytest.mark.parametrize("offset", [-0.001, 0.0005, 0.002])
def test_sheet_keeps_its_lengths_at_its_neutral_layer(offset):
    """The sheet is unrolled at the radius of its layer: half a millimetre of offset moves cells by more than a
    millimetre.
    """
    lattice = SheetLattice(3, 22, (0.01, 0.01))
    surface = cone_surface(RADIUS, RADIUS)
    taxels = sheet_taxels(wrap_sheet(surface, lattice, (RADIUS, 0, 0.03), (0, 1, 0), offset=offset), "s")
    turn = 0.01 * taxels.index[:, 1] / (RADIUS + offset)
    radius, height = RADIUS + offset, 0.03 + 0.01 * taxels.index[:, 0]
    expected = np.column_stack((radius * np.cos(turn), radius * np.sin(turn), height))
    assert_allclose(taxels.positions_link, expected, rtol=0, atol=5e-6)
    bare = sheet_taxels(wrap_sheet(surface, lattice, (RADIUS, 0, 0.03), (0, 1, 0)), "s")
    if offset == 0.0005:
        assert np.linalg.norm(taxels.positions_link - bare.positions_link, axis=1).mean() > 1.2e-3


@pytest.mark.parametrize("surface", [wrist_surface(), cone_surface()])
def test_taxels_stand_exactly_above_their_parameters(surface):
    """Position = surface point + offset x normal, to rounding, and the normal is that of the surface."""
    sheet = wrap_sheet(surface, SheetLattice(4, 7, (0.01, 0.01)), None, (0, 1, 0), offset=0.0015)
    taxels = sheet_taxels(sheet, "s")
    expected = surface.points(taxels.uv) + 0.0015 * surface.normals(taxels.uv)
    assert_allclose(taxels.positions_link, expected, rtol=0, atol=1e-12)
    assert_allclose(taxels.normals_link, surface.normals(taxels.uv), rtol=0, atol=1e-12)


def test_offset_below_a_narrow_dome_is_accepted_up_to_its_radius():
    """A strip of a sphere, whose parameters are five times as long along u as along v: only the radius counts."""
    mesh = sheet(lambda x, y: np.sqrt(0.1**2 - (x - 0.05) ** 2 - (y - 0.01) ** 2), (0.1, 0.02), (40, 8))
    surface = fit_surface(mesh, AcrossGrid(8, 5, (0, 0, 1.0), (1.0, 0, 0))).surface
    layer = offset_surface(surface, -0.06)
    assert_allclose(np.linalg.norm(layer.points(UV) - (0.05, 0.01, 0), axis=1), 0.04, atol=1e-3)
    with pytest.raises(InvalidPlan, match="the radius of curvature there is smaller than the offset"):
        offset_surface(surface, -0.12)
