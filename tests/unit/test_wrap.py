"""Sheets wrapped on surfaces whose unrolling is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.errors import InvalidPlan, OutsideSurface, SkinCalibError
from skin_calib_addon.geometry import BSplineSurface
from skin_calib_addon.skin import SheetLattice, sheet_taxels, wrap_sheet
from skin_calib_addon.skin.strain import cell_strain
from skin_calib_addon.skin.wrap import WrappedSheet
from tests.shapes import LENGTH, RADIUS, cone_surface, plane_surface, wrist_surface

SQUARE = (0.01, 0.01)
# The arcs between nodes are taken for cubics: so much of a cell they are off where a surface bends by 17 degrees.
CLOSE = 5e-7  # [m]


def centres(sheet):
    """Centres of the cells, shape (rows, columns, 3)."""
    return sheet_taxels(sheet, "s").positions_link.reshape(sheet.lattice.rows, sheet.lattice.columns, 3)


def flat(lattice, heading):
    """Flat places of the cells from that of cell (0, 0), rows turned by an angle: shape (rows, columns, 2)."""
    i, j = np.meshgrid(np.arange(lattice.rows), np.arange(lattice.columns), indexing="ij")
    x, y = j * lattice.pitch[1], i * lattice.pitch[0]
    c, s = np.cos(heading), np.sin(heading)
    return np.stack((c * x - s * y, s * x + c * y), axis=-1)


@given(
    heading=st.floats(-0.35, 0.35),
    pitch=st.tuples(st.floats(0.004, 0.012), st.floats(0.004, 0.012)),
    shape=st.tuples(st.integers(1, 4), st.integers(1, 4)),
    tilt=st.floats(-3, 3),
)
def test_plane_is_the_identity(heading, pitch, shape, tilt):
    """Cells lie on the plane as they lie in the lattice, in any direction; what of it leaves the plane is ignored."""
    lattice, origin = SheetLattice(*shape, pitch), np.array((0.03, 0.02, 0.001))
    sheet = wrap_sheet(plane_surface(), lattice, origin, (np.cos(heading), np.sin(heading), tilt))
    expected = flat(lattice, heading) + origin[:2]
    assert_allclose(centres(sheet)[..., :2], expected, rtol=0, atol=1e-11)
    assert np.abs(centres(sheet)[..., 2]).max() < 1e-15
    assert np.abs(cell_strain(sheet)).max() < 1e-9


@settings(max_examples=25)
@given(heading=st.floats(-np.pi, np.pi), angle=st.floats(-3, 3), pitch=st.tuples(*2 * [st.floats(0.004, 0.012)]))
def test_cylinder_is_unrolled(heading, angle, pitch):
    """Arc lengths round the cylinder and heights along it are the flat places, for rows in any direction."""
    lattice = SheetLattice(2, 4, pitch)
    normal, along = np.array((np.cos(angle), np.sin(angle), 0)), np.array((-np.sin(angle), np.cos(angle), 0))
    direction = np.cos(heading) * along + np.sin(heading) * np.array((0, 0, 1.0))
    sheet = wrap_sheet(cone_surface(RADIUS, RADIUS), lattice, RADIUS * normal + (0, 0, 0.05), direction)
    arc, height = np.moveaxis(flat(lattice, heading), -1, 0)
    turn = angle + arc / RADIUS
    expected = np.stack((RADIUS * np.cos(turn), RADIUS * np.sin(turn), 0.05 + height), axis=-1)
    assert_allclose(centres(sheet), expected, rtol=0, atol=CLOSE)
    assert np.abs(cell_strain(sheet)).max() < 1e-5


@settings(max_examples=25)
@given(heading=st.floats(-np.pi, np.pi), angle=st.floats(-3, 3), ends=st.sampled_from(((0.045, 0.030), (0.03, 0.038))))
def test_cone_is_unrolled(heading, angle, ends):
    """A cone unrolls to a sector about its tip: distances from the tip and angles there are the flat ones."""
    lattice = SheetLattice(3, 4, SQUARE)
    slope = np.arctan((ends[0] - ends[1]) / LENGTH)  # positive where the cone narrows upwards
    start = ends[0] + (ends[1] - ends[0]) / 2
    tip = start / np.sin(slope)  # from the origin of the sheet along the cone; below where negative
    up = np.array((-np.sin(slope) * np.cos(angle), -np.sin(slope) * np.sin(angle), np.cos(slope)))
    along = np.array((-np.sin(angle), np.cos(angle), 0))
    origin = np.array((start * np.cos(angle), start * np.sin(angle), LENGTH / 2))
    sheet = wrap_sheet(cone_surface(*ends), lattice, origin, np.cos(heading) * along + np.sin(heading) * up)
    x, y = np.moveaxis(flat(lattice, heading), -1, 0)
    reach = np.sign(tip) * np.hypot(x, tip - y)
    turn = angle + np.arctan2(x, np.abs(tip - y)) / np.abs(np.sin(slope))
    radius = reach * np.sin(slope)
    height = LENGTH / 2 + (tip - reach) * np.cos(slope)
    expected = np.stack((radius * np.cos(turn), radius * np.sin(turn), height), axis=-1)
    assert_allclose(centres(sheet), expected, rtol=0, atol=CLOSE)


def test_whole_sheet_is_unrolled_round_the_seam():
    """6 x 22 cells that close round the cylinder, and 40 columns that wind nearly twice: the seam is no edge."""
    for columns in (22, 40):
        lattice = SheetLattice(6, columns, SQUARE)
        sheet = wrap_sheet(cone_surface(RADIUS, RADIUS), lattice, (-RADIUS, 0, 0.02), (0, -1, 0))
        turn = np.pi + 0.01 * np.arange(columns) / RADIUS
        expected = np.stack(np.broadcast_arrays(
            RADIUS * np.cos(turn), RADIUS * np.sin(turn), 0.02 + 0.01 * np.arange(6)[:, None]
        ), axis=-1)  # fmt: skip
        assert_allclose(centres(sheet), expected, rtol=0, atol=CLOSE)


@pytest.mark.parametrize("surface", [plane_surface(0.3, 0.3), cone_surface(), wrist_surface()])
@pytest.mark.parametrize("height", [0.0, 0.002])
def test_origin_stays(surface, height):
    """The centre of cell (0, 0) lies on the surface point nearest to the origin, and its row sets off as told."""
    start = np.array((0.4, 0.3))
    point, normal = surface.points(start)[0], surface.normals(start)[0]
    side = np.cross(normal, (0.3, 0.5, 0.8))
    sheet = wrap_sheet(surface, SheetLattice(3, 4, SQUARE), point + height * normal, side + 0.3 * normal)
    assert_allclose(centres(sheet)[0, 0], point, rtol=0, atol=1e-9)
    taxels = sheet_taxels(sheet, "s")
    assert_allclose(taxels.tangents_link[0], side / np.linalg.norm(side), rtol=0, atol=2e-3)


@pytest.mark.parametrize("shape", [(3, 7), (4, 6)])
@pytest.mark.parametrize("direction", [(0, 1, 0), (0, -1, 0.2)])
def test_centred_sheet_leaves_both_edges_as_free(shape, direction):
    """On a cylinder: as far from one open edge as from the other; on a plane from all four."""
    heights = centres(wrap_sheet(cone_surface(RADIUS, RADIUS), SheetLattice(*shape, SQUARE), None, direction))[..., 2]
    assert_allclose(heights.min(), LENGTH - heights.max(), rtol=0, atol=1e-6)
    places = centres(wrap_sheet(plane_surface(0.2, 0.3), SheetLattice(*shape, SQUARE), None, direction)).reshape(-1, 3)
    assert_allclose((places.min(axis=0) + places.max(axis=0))[:2], (0.2, 0.3), rtol=0, atol=1e-6)


def barrel():
    """A closed surface bent both ways, like an egg."""
    surface = cone_surface(RADIUS, RADIUS)
    z = surface.control_net[..., 2:] / LENGTH - 0.5
    net = surface.control_net * np.concatenate((1 - 0.5 * z**2, 1 - 0.5 * z**2, np.ones_like(z)), axis=2)
    return BSplineSurface(net, surface.knots_u, surface.knots_v, surface.degree, surface.closed)


def test_strain_is_how_much_longer_cells_are():
    """On an egg, against lengths measured along dense curves on the surface through each cell."""
    sheet = wrap_sheet(barrel(), SheetLattice(5, 9, SQUARE), None, (0, 1, 0))
    assert 1e-4 < np.abs(cell_strain(sheet)).max() < 0.05

    def length(a, b):
        share = np.linspace(0, 1, 200)[:, None]
        return np.linalg.norm(np.diff(sheet.surface.points(a + share * (b - a)), axis=0), axis=1).sum()

    for (i, j), (along, across, _) in zip(sheet.lattice.index, cell_strain(sheet)):
        cell = sheet.uv[2 * i : 2 * i + 3, 2 * j : 2 * j + 3]
        assert_allclose((length(cell[1, 0], cell[1, 1]) + length(cell[1, 1], cell[1, 2])) / 0.01 - 1, along, atol=2e-5)
        assert_allclose((length(cell[0, 1], cell[1, 1]) + length(cell[1, 1], cell[2, 1])) / 0.01 - 1, across, atol=2e-5)


def test_strain_of_a_doubly_curved_surface_is_shared():
    """Least squares: neither rows nor columns keep their length at the cost of the other, and both signs occur."""
    strain = cell_strain(wrap_sheet(barrel(), SheetLattice(7, 15, SQUARE), None, (0, 1, 0)))
    assert (strain[:, :2].min(axis=0) < -1e-4).all() and (strain[:, :2].max(axis=0) > 1e-4).all()
    assert np.abs(strain.mean(axis=0)).max() < 0.1 * np.abs(strain).max()


@given(map_=st.tuples(st.floats(0.95, 1.05), st.floats(0.95, 1.05), st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)))
def test_strain_of_a_linear_map_is_exact(map_):
    """A lattice laid on a plane stretched and sheared by known amounts, in every cell the same."""
    lattice, surface = SheetLattice(3, 4, (0.008, 0.01)), plane_surface()
    stretch = np.array(((map_[0], map_[2]), (map_[3], map_[1])))
    a, b = lattice.node_shape
    y, x = np.meshgrid(np.arange(a) * 0.004, np.arange(b) * 0.005, indexing="ij")
    places = 0.02 + np.stack((x, y), axis=-1) @ stretch.T
    sheet = WrappedSheet(surface, 0.0, surface, lattice, places / (0.1, 0.08), np.ones(12, bool))
    along, across, shear = cell_strain(sheet).T
    row, column = stretch.T
    assert_allclose(along, np.linalg.norm(row) - 1, rtol=0, atol=1e-12)
    assert_allclose(across, np.linalg.norm(column) - 1, rtol=0, atol=1e-12)
    assert_allclose(np.sin(shear), row @ column / np.linalg.norm(row) / np.linalg.norm(column), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("rows", "first"), [(5, None), (6, 5)])
def test_first_cell_off_the_surface_is_named(rows, first):
    """Rows that climb a cylinder: the first cell beyond its rim, how far, and how many."""
    lattice, origin = SheetLattice(rows, 4, SQUARE), (RADIUS, 0, 0.0551)
    if first is None:
        wrap_sheet(cone_surface(RADIUS, RADIUS), lattice, origin, (0, 1, 0))
        return
    message = r"cell \(5, 0\) lies 5\.1 mm beyond the edge u = 1 of the surface, the first of 4; move the origin"
    with pytest.raises(OutsideSurface, match=message) as caught:
        wrap_sheet(cone_surface(RADIUS, RADIUS), lattice, origin, (0, 1, 0))
    assert (caught.value.numbers["row"], caught.value.numbers["column"]) == (5, 0)
    assert_allclose(caught.value.numbers["distance"], 0.0051, rtol=1e-4)


def test_first_cell_beside_an_open_surface_is_named():
    """Beyond the other kind of edge: a row that leaves the plane sideways."""
    with pytest.raises(
        OutsideSurface, match=r"cell \(0, 3\) lies 1\.0 mm beyond the edge v = 1 of the surface, .* of 3"
    ):
        wrap_sheet(plane_surface(), SheetLattice(1, 6, (0.03, 0.011)), (0.05, 0.048, 0), (0, 1, 0))


@pytest.mark.parametrize(
    ("surface", "shape", "origin", "direction"),
    [
        (cone_surface(), (60, 22), None, (0, 1, 0)),
        (cone_surface(), (60, 22), (0.04, 0, 0.05), (1, 1, 1)),
        (wrist_surface(), (60, 22), None, (0, 1, 0)),
        (wrist_surface(), (40, 40), (0.04, 0, 0.05), (1, 1, 1)),
        (wrist_surface(), (2, 200), None, (0, 1, 1)),
    ],
)
def test_sheet_much_larger_than_the_surface_is_refused(surface, shape, origin, direction):
    """One clear line, though the surface's straight continuation narrows to a tip and folds."""
    with pytest.raises(SkinCalibError, match=r"cell \(\d+, \d+\) lies .* beyond the edge"):
        wrap_sheet(surface, SheetLattice(*shape, SQUARE), origin, direction)


@pytest.mark.parametrize("direction", [(1, 0, 0), (-2, 0.05, 0), (0, 0, 0)])
def test_upright_direction_is_refused(direction):
    """A direction along the normal, or none at all, says nothing of the rows."""
    with pytest.raises(InvalidPlan, match=r'"direction" \[.*\] stands upright on the surface at the origin'):
        wrap_sheet(cone_surface(RADIUS, RADIUS), SheetLattice(2, 2, SQUARE), (RADIUS, 0, 0.05), direction)
