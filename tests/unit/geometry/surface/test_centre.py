"""The middle of a surface: where its shape has it, whatever planes and lines it was fitted along."""

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sample_scenes import shapes
from skin_calib_addon.geometry import (
    AcrossGrid,
    BSplineSurface,
    SectorGrid,
    TubeGrid,
    fit_surface,
)
from skin_calib_addon.geometry.surface.centre import length_fractions, surface_centre
from skin_calib_addon.geometry.surface.footpoints import footpoints
from skin_calib_addon.skin import SheetLattice, wrap_sheet
from tests.shapes import (
    LENGTH,
    RADIUS,
    Z_AXIS,
    Motion,
    cone_surface,
    plane_surface,
    round_tube,
    unevenly_divided,
    welded,
    with_hole,
    wrist,
    wrist_surface,
)

# A coarse net, one whose planes and lines go where they lower the error, a fine one.
NETS = ((7, 14, "uniform"), (12, 33, "auto"), (20, 60, "curvature"))


@cache
def bent():
    """A tube about a quarter of a circle, thicker on one side."""

    def point(angle, height):
        turn, radius = height * np.pi / 2, 0.03 * (1 + 0.15 * np.cos(angle - 0.7) - 0.1 * height)
        out = 0.1 + radius * np.cos(angle)
        return np.column_stack((out * np.cos(turn), radius * np.sin(angle), out * np.sin(turn)))

    return welded(shapes.tube_mesh(point, 90, 61))


def sole():
    """The sample of the underside of a foot."""
    return welded(shapes.sole())


CASES = {  # a mesh, and a grid from numbers of planes and lines and their spacing
    "tube": (wrist, lambda n, m, spacing: TubeGrid(n, m, margin=0.002, spacing=spacing)),
    "bent": (bent, lambda n, m, spacing: TubeGrid(n, m, spacing=spacing)),
    "sector": (wrist, lambda n, m, spacing: SectorGrid(n, m, -1.0, 2.0, margin=0.002, spacing=spacing)),
    "sole": (sole, lambda n, m, spacing: AcrossGrid(n, m, (0.0, 0.0, -1.0), margin=0.02, spacing=spacing)),
}


@pytest.mark.parametrize("case", CASES)
def test_middle_stays_where_it_is_when_planes_and_lines_move(case):
    """Along the surface within a hundredth of a millimetre; the middle of the parameters moves ten times as far."""
    mesh, grid = CASES[case]
    surfaces = [fit_surface(mesh(), grid(*net)).surface for net in NETS]
    fine = surfaces[-1]
    normal = fine.normals(surface_centre(fine))[0]

    def along(points):
        off = points - points[-1]
        return np.linalg.norm(off - (off @ normal)[:, None] * normal, axis=1).max()

    middles, of_parameters = (
        np.array([surface.points(at(surface))[0] for surface in surfaces])
        for at in (surface_centre, lambda _: (0.5, 0.5))
    )
    assert along(middles) < 1.5e-5
    assert along(of_parameters) > max(10 * along(middles), 2e-4)
    distance = footpoints(fine, middles)[1]
    assert np.abs((middles - middles[-1]) @ normal).max() <= distance.max() + 1.5e-5


def test_middle_is_next_to_the_point_of_the_mesh():
    """On a cylinder, for points of the mesh outside and inside of it; without one, half of the lengths."""
    plain = cone_surface(RADIUS, RADIUS)
    for angle, height in ((0.0, 1e-3), (1.0, 0.0), (-2.9, -4e-3)):
        out = np.array((np.cos(angle), np.sin(angle), 0))
        point = (RADIUS + height) * out + (0, 0, 0.4 * LENGTH)
        surface = BSplineSurface(plain.control_net, plain.knots_u, plain.knots_v, plain.degree, plain.closed, point)
        assert_allclose(surface.points(surface_centre(surface))[0], point - height * out, rtol=0, atol=2e-8)
    assert_allclose(surface_centre(plain), (0.5, 0.5), atol=1e-9)


def test_middle_over_a_hole_is_between_its_rims():
    """A cylinder has a hole of 5 mm half a turn from a ridge: its middle is near the cylinder, at half length."""
    ridged = round_tube(lambda a, _: 0.03 + 0.004 * np.exp(6 * (np.cos(a) - 1)), 180, 61)
    opened = with_hole(ridged, (-0.03, 0, 0.05), 0.005)
    for spacing in ("uniform", "auto"):
        surface = fit_surface(opened, TubeGrid(10, 30, Z_AXIS, 0.01, spacing)).surface
        assert_allclose(surface.points(surface_centre(surface))[0], (-0.03, 0, 0.05), rtol=0, atol=4e-4)


@pytest.mark.parametrize("case", ["tube", "bent", "sole"])
def test_middle_depends_on_the_shape_only(case):
    """Faces that are divided in one half of the mesh, and another net: within a hundredth and five of a millimetre."""
    mesh, grid = CASES[case]
    whole = mesh()
    nets = (whole, 10), (unevenly_divided(whole), 10), (whole, 20)
    surfaces = [fit_surface(m, grid(n, 2 * n, "auto")).surface for m, n in nets]
    here, again, fine = (surface.points(surface_centre(surface))[0] for surface in surfaces)
    assert np.linalg.norm(again - here) < 1e-6
    assert np.linalg.norm(fine - here) < 5e-5


def test_middle_of_a_stretched_net_is_that_of_its_lengths():
    """A plane whose parameters run slowly at first: half of its sides."""
    plane = plane_surface()
    net = plane.control_net.copy()
    net[..., 0] = 0.1 * (net[..., 0] / 0.1) ** 2
    stretched = BSplineSurface(net, plane.knots_u, plane.knots_v, plane.degree)
    assert_allclose(stretched.points(surface_centre(stretched))[0], (0.05, 0.04, 0), atol=1e-7)
    assert abs(surface_centre(stretched)[0] - 0.5) > 0.05


def test_middle_moves_with_the_mesh():
    """Turned and shifted: the same place on the link."""
    motion = Motion(3, 1.0)
    here, there = (fit_surface(mesh, TubeGrid(8, 16, margin=0.002)).surface for mesh in (wrist(), motion.mesh(wrist())))
    moved = motion.points(here.points(surface_centre(here)))
    assert_allclose(there.points(surface_centre(there)), moved, atol=1e-8)


def test_fractions_are_those_of_lengths_measured_along_the_line():
    """On a wrist, along and round it; beyond an edge the line goes on."""
    surface = wrist_surface()
    fine = np.linspace(0, 1, 20001)
    for axis in (0, 1):
        for at in (0.1, 0.62):
            uv = np.full((1, 2), 0.37)
            uv[0, axis] = at
            line = np.tile(uv, (len(fine), 1))
            line[:, axis] = fine
            done = np.append(0, np.cumsum(np.linalg.norm(np.diff(surface.points(line), axis=0), axis=1)))
            fraction, growth = length_fractions(surface, uv, axis)
            assert_allclose(fraction, np.interp(at, fine, done) / done[-1], rtol=0, atol=5e-5)
            assert_allclose(growth, np.gradient(done, fine)[int(at * 20000)] / done[-1], rtol=1e-3)
    beyond = length_fractions(surface, np.array([[-0.1, 0.2], [1.1, 0.2]]), 0)[0]
    assert beyond[0] < -0.05 and beyond[1] > 1.05


@pytest.mark.parametrize("direction", [(0, 1, 0), (0.3, 1, 0.2)])
def test_middle_of_a_centred_sheet_is_the_centre(direction):
    """The middle node of an even and of an odd sheet, to a tenth of a micrometre, for any direction of the rows."""
    surface = fit_surface(wrist(), TubeGrid(7, 14, margin=0.002)).surface
    for shape in ((5, 18), (4, 9)):
        uv = wrap_sheet(surface, SheetLattice(*shape, (0.01, 0.01)), None, direction).uv[shape]
        assert_allclose(surface.points(uv)[0], surface.points(surface_centre(surface))[0], rtol=0, atol=1e-7)
