"""Laws of any placement: it moves with the link, and depends on the surface, not on the method of its fit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.geometry import BSplineSurface, TubeGrid, fit_surface
from skin_calib_addon.skin import HexLattice, SheetLattice, sheet_taxels, wrap, wrap_sheet
from tests.examples import examples
from tests.shapes import LENGTH, RADIUS, Z_AXIS, Motion, cone_surface, cylinder, wrist, wrist_surface

seeds = st.integers(0, 2**32 - 1)
SHEET = SheetLattice(6, 22, (0.01, 0.01))
SMALL = SheetLattice(3, 5, (0.01, 0.008))


def taxels(surface, lattice=SHEET, origin=None, direction=(0, 1, 0)):
    """Return the taxels of a sheet."""
    return sheet_taxels(wrap_sheet(surface, lattice, origin, direction), "s")


def scaled(lattice, scale):
    """Return a sheet of larger cells."""
    return SheetLattice(lattice.rows, lattice.columns, (lattice.pitch[0] * scale, lattice.pitch[1] * scale))


@examples(5)
@given(seed=seeds, scale=st.floats(0.3, 3), centred=st.booleans())
def test_moving_the_mesh_moves_the_taxels(seed, scale, centred):
    """Positions, normals, tangents and corners move with the mesh; neighbours and strain are unchanged."""
    motion, mesh = Motion(seed, scale), wrist()
    grid = TubeGrid(8, 16, margin=0.002)
    nearest = mesh.vertices[np.argmin(np.linalg.norm(mesh.vertices - (0.036, -0.004, 0.03), axis=1))]
    origin, direction = None if centred else nearest, (0.1, 1, 0.1)
    lattice = SHEET if centred else SMALL
    here = taxels(fit_surface(mesh, grid).surface, lattice, origin, direction)
    moved = fit_surface(motion.mesh(mesh), TubeGrid(8, 16, margin=0.002 * scale)).surface
    there = taxels(
        moved, scaled(lattice, scale), None if centred else motion.points(origin), motion.directions(direction)
    )
    assert_allclose(there.positions_link, motion.points(here.positions_link), rtol=0, atol=1e-8 * scale)
    assert_allclose(there.corners_link, motion.points(here.corners_link), rtol=0, atol=1e-8 * scale)
    assert_allclose(there.normals_link, motion.directions(here.normals_link), rtol=0, atol=1e-6)
    assert_allclose(there.tangents_link, motion.directions(here.tangents_link), rtol=0, atol=1e-6)
    assert_allclose(there.areas, here.areas * scale**2, rtol=1e-5)
    assert_allclose(there.quality["strain"], here.quality["strain"], rtol=0, atol=1e-6)
    assert there.neighbours == here.neighbours


def mirrored(surface):
    """Return the surface with x reversed; v is reversed, too, so that the normals still point outward."""
    net, centre = surface.control_net[:, ::-1] * (-1, 1, 1), surface.centre * (-1, 1, 1)
    return BSplineSurface(net, surface.knots_u, surface.knots_v, surface.degree, surface.closed, centre)


def test_mirrored_surface_has_the_mirrored_sheet():
    """Rows run in the mirrored direction; the next row is on the left, so that the rows of the sheet are in reverse
    order.
    """
    here, there = taxels(wrist_surface()), taxels(mirrored(wrist_surface()))
    swap = np.arange(132).reshape(6, 22)[::-1].ravel()
    assert_allclose(there.positions_link[swap], here.positions_link * (-1, 1, 1), rtol=0, atol=1e-7)
    assert_allclose(there.normals_link[swap], here.normals_link * (-1, 1, 1), rtol=0, atol=1e-6)
    assert_allclose(there.quality["strain"][swap, :2], here.quality["strain"][:, :2], rtol=0, atol=1e-6)


def test_sheet_does_not_depend_on_the_parametrization():
    """With the seam at another position, under the sheet, the sheet is the same."""
    surface = cone_surface(0.045, 0.035)
    rolled = np.roll(surface.control_net[:, :64], 20, axis=1)
    turned = BSplineSurface(
        np.concatenate((rolled, rolled[:, :3]), axis=1),
        surface.knots_u,
        surface.knots_v,
        surface.degree,
        surface.closed,
    )
    for origin, direction in (((0.04, 0.0, 0.03), (0, 1, 0.2)), ((-0.03, 0.028, 0.06), (1, 1, -0.3))):
        places = [taxels(s, SMALL, origin, direction).positions_link for s in (surface, turned)]
        assert_allclose(*places, rtol=0, atol=1e-8)


@examples(8)
@given(angle=st.floats(-3, 3), height=st.floats(0.03, 0.06))
def test_turned_sheet_is_the_same_sheet(angle, height):
    """With reversed rows from the opposite corner, each cell has the position and the strain of its opposite cell."""
    surface, lattice = wrist_surface(), SheetLattice(3, 3, (0.01, 0.01))
    origin = surface.points([[height / LENGTH, angle / 7 % 1]])[0]
    here = taxels(
        surface, lattice, origin, np.cross(surface.normals([[height / LENGTH, angle / 7 % 1]])[0], (0, 0, -1))
    )
    far = here.positions_link[-1]
    there = taxels(surface, lattice, far, -here.tangents_link[-1])
    assert_allclose(there.positions_link[::-1], here.positions_link, rtol=0, atol=2e-4)
    assert_allclose(there.quality["strain"][::-1], here.quality["strain"], rtol=0, atol=1e-2)


@pytest.mark.parametrize("around", [48, 96, 192])
def test_taxels_have_no_larger_error_than_the_surface(around):
    """On the mesh of a cylinder, the error of every taxel has the size of the sagitta of the facets."""
    mesh = cylinder(around=around)
    sagitta = RADIUS * (1 - np.cos(np.pi / around))
    found = taxels(fit_surface(mesh, TubeGrid(8, 24, Z_AXIS)).surface, SMALL, (RADIUS, 0, 0.04))
    turn, height = found.index[:, 1] * 0.008 / RADIUS, 0.04 + 0.01 * found.index[:, 0]
    truth = np.column_stack((RADIUS * np.cos(turn), RADIUS * np.sin(turn), height))
    assert np.linalg.norm(found.positions_link - truth, axis=1).max() < 2 * sagitta + 1e-6


def test_finer_fit_moves_the_taxels_by_no_more_than_its_error():
    """The mean movement is below the maximum error of the coarse fit, the largest movement below twice of it.

    An error of the radius also changes the lengths between the origin and a cell.
    """
    fits = [fit_surface(wrist(), TubeGrid(n, lines, margin=0.002)) for n, lines in ((6, 12), (10, 20), (16, 32))]
    places = [taxels(fit.surface, SMALL, (0.036, -0.004, 0.03), (0, 1, 0)).positions_link for fit in fits]
    for coarse, before, after in zip(fits, places, places[1:]):
        moved = np.linalg.norm(after - before, axis=1)
        assert moved.mean() < coarse.errors.hausdorff
        assert moved.max() < 2 * coarse.errors.hausdorff


def test_finer_lattice_of_the_same_sheet_agrees():
    """With cells of half the pitch, corners, edges and centres of the large cells are corners of small ones."""
    surface = wrist_surface()
    coarse, fine = (
        surface.points(wrap_sheet(surface, lattice, None, (0, 1, 0)).uv.reshape(-1, 2)).reshape(*lattice.node_shape, 3)
        for lattice in (SheetLattice(3, 5, (0.01, 0.01)), SheetLattice(6, 10, (0.005, 0.005)))
    )
    assert np.linalg.norm(coarse - fine[::2, ::2], axis=2).mean() < 1e-4


@examples(4)
@given(seed=seeds, scale=st.floats(0.3, 3))
def test_moving_the_surface_moves_the_boards(seed, scale):
    """The boards move with the surface, with the same quality."""
    motion, surface = Motion(seed, scale), wrist_surface()
    moved = BSplineSurface(
        motion.points(surface.control_net), surface.knots_u, surface.knots_v, surface.degree, surface.closed
    )
    origin, direction = surface.points([[0.5, 0.3]])[0], (0.1, 1, 0.1)
    here = wrap(surface, HexLattice(0.008, 0.0), origin, direction, cells="all")
    there = wrap(
        moved, HexLattice(0.008 * scale, 0.0), motion.points(origin), motion.directions(direction), cells="all"
    )
    assert here.ids == there.ids and here.neighbours == there.neighbours
    assert_allclose(there.positions_link, motion.points(here.positions_link), rtol=0, atol=2e-7 * scale)
    assert_allclose(there.normals_link, motion.directions(here.normals_link), rtol=0, atol=1e-5)
    assert_allclose(there.corners_link, motion.points(here.corners_link), rtol=0, atol=1e-6 * scale)
    for name in ("gap", "pitch_error"):
        assert_allclose(there.quality[name], here.quality[name] * scale, rtol=0, atol=1e-6 * scale)


def test_mirrored_surface_has_the_mirrored_boards():
    """With rows along the mirror, each board has its image on the other side of the row of the root."""
    origin = wrist_surface().points([[0.5, 0.3]])[0]
    here, there = (
        wrap(surface, HexLattice(0.008, 0.0), origin * sign, (0, 1, 0), cells="all")
        for surface, sign in ((wrist_surface(), (1, 1, 1)), (mirrored(wrist_surface()), (-1, 1, 1)))
    )
    image = {(q + r, -r): i for i, (q, r) in enumerate(here.index.tolist())}
    order = [image[tuple(cell)] for cell in there.index.tolist()]
    assert sorted(order) == list(range(len(here.ids)))
    assert_allclose(there.positions_link, here.positions_link[order] * (-1, 1, 1), rtol=0, atol=1e-6)
