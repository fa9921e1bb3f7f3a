"""Sheets placed on surfaces with a known unrolling."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import InvalidPlan, OutsideSurface, SkinCalibError
from skin_calib_addon.geometry import BSplineSurface
from skin_calib_addon.skin import SheetLattice, sheet_taxels, wrap_sheet
from skin_calib_addon.skin.sheet.constraints import pin_constraints, row_axis
from skin_calib_addon.skin.sheet.net import grid_net
from skin_calib_addon.skin.sheet.relax import relax
from skin_calib_addon.skin.sheet.strain import cell_strain
from skin_calib_addon.skin.sheet.wrap import WrappedSheet
from tests.examples import examples
from tests.shapes import LENGTH, RADIUS, cone_surface, plane_surface, wrist_surface

SQUARE = (0.01, 0.01)
# Error of a cell whose normal rotates by 17 degrees: the arcs between nodes are approximated by cubics.
CLOSE = 5e-7  # [m]


def centres(sheet):
    """Centres of the cells, shape (rows, columns, 3)."""
    return sheet_taxels(sheet, "s").positions_link.reshape(sheet.lattice.rows, sheet.lattice.columns, 3)


def flat(lattice, heading):
    """Flat positions of the cells relative to cell (0, 0), rows rotated by an angle: shape (rows, columns, 2)."""
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
    """The cells keep their flat positions on a plane, in any direction; the normal part of the direction is ignored."""
    lattice, origin = SheetLattice(*shape, pitch), np.array((0.03, 0.02, 0.001))
    sheet = wrap_sheet(plane_surface(), lattice, origin, (np.cos(heading), np.sin(heading), tilt))
    expected = flat(lattice, heading) + origin[:2]
    assert_allclose(centres(sheet)[..., :2], expected, rtol=0, atol=1e-11)
    assert np.abs(centres(sheet)[..., 2]).max() < 1e-15
    assert np.abs(cell_strain(sheet)).max() < 1e-9


@examples(25)
@given(heading=st.floats(-np.pi, np.pi), angle=st.floats(-3, 3), pitch=st.tuples(*2 * [st.floats(0.004, 0.012)]))
def test_cylinder_is_unrolled(heading, angle, pitch):
    """Arc lengths around the cylinder and heights along it are the flat positions, for rows in any direction."""
    lattice = SheetLattice(2, 4, pitch)
    normal, along = np.array((np.cos(angle), np.sin(angle), 0)), np.array((-np.sin(angle), np.cos(angle), 0))
    direction = np.cos(heading) * along + np.sin(heading) * np.array((0, 0, 1.0))
    sheet = wrap_sheet(cone_surface(RADIUS, RADIUS), lattice, RADIUS * normal + (0, 0, 0.05), direction)
    arc, height = np.moveaxis(flat(lattice, heading), -1, 0)
    turn = angle + arc / RADIUS
    expected = np.stack((RADIUS * np.cos(turn), RADIUS * np.sin(turn), 0.05 + height), axis=-1)
    assert_allclose(centres(sheet), expected, rtol=0, atol=CLOSE)
    assert np.abs(cell_strain(sheet)).max() < 1e-5


@examples(25)
@given(heading=st.floats(-np.pi, np.pi), angle=st.floats(-3, 3), ends=st.sampled_from(((0.045, 0.030), (0.03, 0.038))))
def test_cone_is_unrolled(heading, angle, ends):
    """A cone unrolls to a sector around its tip: distances from the tip and angles there are the flat ones."""
    lattice = SheetLattice(3, 4, SQUARE)
    slope = np.arctan((ends[0] - ends[1]) / LENGTH)  # positive if the cone narrows upwards
    start = ends[0] + (ends[1] - ends[0]) / 2
    tip = start / np.sin(slope)  # from the origin of the sheet along the cone; negative: below
    up = np.array((-np.sin(slope) * np.cos(angle), -np.sin(slope) * np.sin(angle), np.cos(slope)))
    along = np.array((-np.sin(angle), np.cos(angle), 0))
    origin = np.array((start * np.cos(angle), start * np.sin(angle), LENGTH / 2))
    sheet = wrap_sheet(cone_surface(*ends), lattice, origin, np.cos(heading) * along + np.sin(heading) * up)
    x, y = np.moveaxis(flat(lattice, heading), -1, 0)
    distance = np.sign(tip) * np.hypot(x, tip - y)
    turn = angle + np.arctan2(x, np.abs(tip - y)) / np.abs(np.sin(slope))
    radius = distance * np.sin(slope)
    height = LENGTH / 2 + (tip - distance) * np.cos(slope)
    expected = np.stack((radius * np.cos(turn), radius * np.sin(turn), height), axis=-1)
    assert_allclose(centres(sheet), expected, rtol=0, atol=CLOSE)


def test_whole_sheet_is_unrolled_over_the_seam():
    """The seam is not an edge for 6 x 22 cells that close around the cylinder, and for 40 columns in nearly two
    turns.
    """
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
def test_origin_is_the_centre_of_the_first_cell(surface, height):
    """The centre of cell (0, 0) is the surface point nearest to the origin, and its row begins in the given
    direction.
    """
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
    """On a cylinder the free lengths at both open edges are equal; on a plane those at all four edges."""
    heights = centres(wrap_sheet(cone_surface(RADIUS, RADIUS), SheetLattice(*shape, SQUARE), None, direction))[..., 2]
    assert_allclose(heights.min(), LENGTH - heights.max(), rtol=0, atol=1e-6)
    points = centres(wrap_sheet(plane_surface(0.2, 0.3), SheetLattice(*shape, SQUARE), None, direction)).reshape(-1, 3)
    assert_allclose((points.min(axis=0) + points.max(axis=0))[:2], (0.2, 0.3), rtol=0, atol=1e-6)


def barrel():
    """A closed, doubly curved surface, like an egg."""
    surface = cone_surface(RADIUS, RADIUS)
    z = surface.control_net[..., 2:] / LENGTH - 0.5
    net = surface.control_net * np.concatenate((1 - 0.5 * z**2, 1 - 0.5 * z**2, np.ones_like(z)), axis=2)
    return BSplineSurface(net, surface.knots_u, surface.knots_v, surface.degree, surface.closed)


def test_strain_is_how_much_longer_cells_are():
    """The strain on an egg agrees with lengths along dense curves on the surface through each cell."""
    sheet = wrap_sheet(barrel(), SheetLattice(5, 9, SQUARE), None, (0, 1, 0))
    assert 1e-4 < np.abs(cell_strain(sheet)).max() < 0.05

    def length(a, b):
        fraction = np.linspace(0, 1, 200)[:, None]
        return np.linalg.norm(np.diff(sheet.surface.points(a + fraction * (b - a)), axis=0), axis=1).sum()

    for (i, j), (along, across, _) in zip(sheet.lattice.index, cell_strain(sheet)):
        cell = sheet.uv[2 * i : 2 * i + 3, 2 * j : 2 * j + 3]
        assert_allclose((length(cell[1, 0], cell[1, 1]) + length(cell[1, 1], cell[1, 2])) / 0.01 - 1, along, atol=2e-5)
        assert_allclose((length(cell[0, 1], cell[1, 1]) + length(cell[1, 1], cell[2, 1])) / 0.01 - 1, across, atol=2e-5)


def test_strain_of_a_doubly_curved_surface_is_distributed():
    """Rows and columns both change their length (least squares), with both signs."""
    strain = cell_strain(wrap_sheet(barrel(), SheetLattice(7, 15, SQUARE), None, (0, 1, 0)))
    assert (strain[:, :2].min(axis=0) < -1e-4).all() and (strain[:, :2].max(axis=0) > 1e-4).all()
    assert np.abs(strain.mean(axis=0)).max() < 0.1 * np.abs(strain).max()


@given(map_=st.tuples(st.floats(0.95, 1.05), st.floats(0.95, 1.05), st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)))
def test_strain_of_a_linear_map_is_exact(map_):
    """A lattice on a plane, stretched and sheared by known amounts, has these strains in every cell."""
    lattice, surface = SheetLattice(3, 4, (0.008, 0.01)), plane_surface()
    stretch = np.array(((map_[0], map_[2]), (map_[3], map_[1])))
    a, b = lattice.node_shape
    y, x = np.meshgrid(np.arange(a) * 0.004, np.arange(b) * 0.005, indexing="ij")
    points = 0.02 + np.stack((x, y), axis=-1) @ stretch.T
    sheet = WrappedSheet(surface, 0.0, surface, lattice, points / (0.1, 0.08), np.ones(12, bool), lattice.node_lines)
    along, across, shear = cell_strain(sheet).T
    row, column = stretch.T
    assert_allclose(along, np.linalg.norm(row) - 1, rtol=0, atol=1e-12)
    assert_allclose(across, np.linalg.norm(column) - 1, rtol=0, atol=1e-12)
    assert_allclose(np.sin(shear), row @ column / np.linalg.norm(row) / np.linalg.norm(column), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("rows", "first"), [(5, None), (6, 5)])
def test_first_cell_off_the_surface_is_named(rows, first):
    """The error for rows along a cylinder names the first cell beyond the rim, its distance, and the number of such
    cells.
    """
    lattice, origin = SheetLattice(rows, 4, SQUARE), (RADIUS, 0, 0.0551)
    if first is None:
        wrap_sheet(cone_surface(RADIUS, RADIUS), lattice, origin, (0, 1, 0))
        return
    message = r"cell \(5, 0\) lies 5\.1 mm beyond the edge u = 1 of the surface, the first of 4; move the origin"
    with pytest.raises(OutsideSurface, match=message) as caught:
        wrap_sheet(cone_surface(RADIUS, RADIUS), lattice, origin, (0, 1, 0))
    assert (caught.value.numbers["row"], caught.value.numbers["column"]) == (5, 0)
    assert_allclose(caught.value.numbers["distance"], 0.0051, rtol=1e-4)


def test_first_cell_beyond_a_side_edge_is_named():
    """A row that leaves the plane at the other pair of edges is named, too."""
    with pytest.raises(
        OutsideSurface, match=r"cell \(0, 3\) lies 1\.0 mm beyond the edge v = 1 of the surface, .* of 3"
    ):
        wrap_sheet(plane_surface(), SheetLattice(1, 6, (0.03, 0.011)), (0.05, 0.048, 0), (0, 1, 0))


@pytest.mark.slow
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
    """The error is clear although the straight continuation of the surface narrows to a tip and folds."""
    with pytest.raises(SkinCalibError, match=r"cell \(\d+, \d+\) lies .* beyond the edge"):
        wrap_sheet(surface, SheetLattice(*shape, SQUARE), origin, direction)


@pytest.mark.parametrize("direction", [(1, 0, 0), (-2, 0.05, 0), (0, 0, 0)])
def test_perpendicular_direction_is_refused(direction):
    """A direction along the normal, or a zero vector, defines no rows."""
    with pytest.raises(InvalidPlan, match=r"The direction \(.*\) is perpendicular to the surface at the origin"):
        wrap_sheet(cone_surface(RADIUS, RADIUS), SheetLattice(2, 2, SQUARE), (RADIUS, 0, 0.05), direction)


def test_left_handed_sheet_is_the_mirror_image():
    """The next row is on the other side; cells, strains and areas equal those on a mirrored surface."""
    right = wrap_sheet(plane_surface(0.3, 0.3), SheetLattice(3, 5, (0.01, 0.02)), (0.15, 0.15, 0), (1, 0.2, 0))
    left = wrap_sheet(plane_surface(0.3, 0.3), SheetLattice(3, 5, (0.01, 0.02), "left"), (0.15, 0.15, 0), (1, -0.2, 0))
    assert_allclose(centres(left) - 0.15, (centres(right) - 0.15) * (1, -1, 1), rtol=0, atol=1e-12)
    taxels = sheet_taxels(left, "s")
    arms = taxels.corners_link - taxels.positions_link[:, None]
    assert (np.cross(arms, np.roll(arms, -1, axis=1))[..., 2] > 0).all()
    tangent, bound = taxels.tangents_link[0], arms[0, 0]
    assert (
        bound @ tangent < 0 and np.cross((0, 0, 1), tangent) @ bound > 0
    )  # the first corner is that of the beginning of the sheet
    assert taxels.neighbours == sheet_taxels(right, "s").neighbours


def test_trimmed_sheet_leaves_out_cells_outside_the_surface():
    """Cells with centres on a plane keep their positions, ids and channels."""
    lattice, plane = SheetLattice(9, 12, SQUARE), plane_surface()
    with pytest.raises(OutsideSurface):
        wrap_sheet(plane, lattice, (0.02, 0.03, 0), (1, 0, 0))
    taxels = sheet_taxels(wrap_sheet(plane, lattice, (0.02, 0.03, 0), (1, 0, 0), trim=True), "s", first_channel=7)
    expected = [(i, j) for i in range(9) for j in range(12) if 0.02 + 0.01 * j <= 0.1 and 0.03 + 0.01 * i <= 0.08]
    assert taxels.index.tolist() == [list(cell) for cell in expected]
    assert taxels.channels.tolist() == [7 + 12 * i + j for i, j in expected]
    points = [(0.02 + 0.01 * j, 0.03 + 0.01 * i, 0) for i, j in expected]
    assert_allclose(taxels.positions_link, points, rtol=0, atol=1e-9)


def test_trimmed_sheet_on_a_curved_surface_has_the_positions_of_a_whole_one():
    """The remaining cells of a sheet taller than an egg have the positions of a sheet that fits."""
    small = centres(wrap_sheet(barrel(), SheetLattice(7, 9, SQUARE), None, (0, 1, 0)))
    sheet = wrap_sheet(barrel(), SheetLattice(13, 9, SQUARE), None, (0, 1, 0), trim=True)
    kept = sheet_taxels(sheet, "s")
    assert 60 < len(kept.ids) < 117
    rows = kept.positions_link[np.isin(kept.index[:, 0], range(3, 10))].reshape(7, 9, 3)
    assert np.linalg.norm(rows - small, axis=2).max() < 1e-3


def test_sheet_is_the_same_from_any_first_guess():
    """Nodes displaced by up to a millimetre converge to the same positions."""
    surface, lattice = wrist_surface(), SheetLattice(5, 16, SQUARE)
    sheet = wrap_sheet(surface, lattice, (0.036, -0.004, 0.02), (0, 1, 0))
    net = grid_net(lattice.node_lines, lattice.step, (1, 1))
    uv, weights = sheet.uv.reshape(-1, 2), net.stiffness.sum(axis=1)
    constraints = pin_constraints(surface, net, uv, row_axis(surface, uv[net.pin], (0, 1, 0)))
    uv = relax(surface, net, uv, constraints, weights)
    rng = np.random.default_rng(0)
    for size in (1e-4, 1e-3):
        thrown = uv + rng.uniform(-1, 1, uv.shape) * size * (1 / 0.1, 1 / 0.22)
        thrown[net.pin] = uv[net.pin]
        again = relax(surface, net, thrown, constraints, weights)
        assert np.linalg.norm(surface.points(again) - surface.points(uv), axis=1).max() < 5e-5


@pytest.mark.parametrize("cells", [(3, 10), (6, 40), (6, 60), (24, 20)])
def test_pitch_does_not_move_a_sheet(cells):
    """Cells of other sizes on one outline, also long ones: common nodes are within 0.05 mm; they were 0.2 mm apart."""
    surface, reference = wrist_surface(), SheetLattice(6, 20, SQUARE)
    rows, columns = cells
    lattice = SheetLattice(rows, columns, (0.06 / rows, 0.2 / columns))
    placed = [wrap_sheet(surface, k, None, (0, 1, 0)) for k in (reference, lattice)]
    steps = [(2 * k.rows // 3, 2 * k.columns // 10) for k in (reference, lattice)]
    ends = [surface.points(s.uv[::a, ::b].reshape(-1, 2)) for s, (a, b) in zip(placed, steps)]
    assert len(ends[0]) == len(ends[1]) == 44
    assert np.linalg.norm(ends[1] - ends[0], axis=1).max() < 5e-5


def test_row_of_the_origin_has_the_given_direction():
    """It keeps it on a doubly curved surface with shear; the mean of all directions was 0.1 degrees off."""
    surface, direction = wrist_surface(), np.array((0, 1, 0.4))
    sheet = wrap_sheet(surface, SheetLattice(6, 20, (0.005, 0.005)), (0.036, -0.004, 0.02), direction)
    before, here, after = surface.points(sheet.uv[1, :3])
    normal = surface.normals(sheet.uv[1, 1][None])[0]
    wanted, found = (np.cross(normal, k) / np.linalg.norm(np.cross(normal, k)) for k in (direction, after - before))
    assert np.linalg.norm(np.cross(wanted, found)) < np.deg2rad(0.04)
