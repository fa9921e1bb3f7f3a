"""The flat map of a surface: exact where the surface is developable."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.geometry import AcrossGrid, fit_surface
from skin_calib_addon.skin import SheetLattice, wrap_sheet
from skin_calib_addon.skin.boards.flat_map import flat_map
from skin_calib_addon.skin.sheet.strain import cell_strain
from tests.shapes import cone_surface, plane_surface, sheet, wrist_surface


def stretches(to_flat, uv):
    """Return the least and largest stretch of the map at parameters (k, 2), shape (k, 2)."""
    r = to_flat.surface.derivatives(uv)
    onto = np.linalg.pinv(np.stack((r[1, 0], r[0, 1]), axis=-1))
    return np.linalg.svd(to_flat.slopes(uv) @ onto, compute_uv=False)


def sites(surface, start):
    """Return parameters all over a surface."""
    uv = np.random.default_rng(0).random((200, 2))
    uv[:, 1] += start[1] - 0.5 if surface.closed[1] else 0.0
    return uv


@pytest.mark.parametrize(
    ("surface", "error"), [(plane_surface(), 1e-12), (cone_surface(0.04, 0.04), 1e-6), (cone_surface(), 1e-4)]
)
def test_developable_surfaces_keep_their_lengths(surface, error):
    """The map of a plane is exact, those of a cylinder and a cone to the arcs between nodes."""
    start = np.array((0.4, 0.3))
    to_flat = flat_map(surface, start, None, None, 0.007, 0.02)
    assert_allclose(stretches(to_flat, sites(surface, start)), 1, rtol=0, atol=error)


def test_start_and_direction_are_the_axes_of_the_plane():
    """The start is at zero, the given direction is x, and the plane is seen from outside."""
    surface, start = wrist_surface(), np.array((0.4, 0.3))
    direction = surface.derivatives(start[None])[:, :, 0]
    along = 0.3 * direction[1, 0] + direction[0, 1]
    to_flat = flat_map(surface, start, along, None, 0.007, 0.02)
    assert_allclose(to_flat(start[None]), 0, atol=1e-12)
    tangent = to_flat.directions(start[None], 0.0)[0]
    assert tangent @ along / np.linalg.norm(along) > 1 - 1e-9
    assert (np.linalg.det(to_flat.slopes(sites(surface, start))) > 0).all()


def test_inverse_finds_the_parameters():
    """Positions on the map, also beyond the cut of the tube, give back their parameters; others their distance."""
    surface, start = wrist_surface(), np.array((0.4, 0.3))
    to_flat = flat_map(surface, start, None, None, 0.007, 0.02)
    uv = sites(surface, start) + (0, 0.05)
    found, off = to_flat.inverse(to_flat(uv))
    assert_allclose(found, uv, rtol=0, atol=1e-9)
    assert off.max() < 1e-12
    middle = start * (0, 1)
    far = to_flat(middle[None]) + 0.01 * (to_flat(middle[None]) - to_flat(middle[None] + (0.01, 0))) / 1e-3
    assert to_flat.inverse(far)[1][0] > 1e-3


def test_boards_and_sheets_have_nearly_one_map():
    """In the same outline, a doubly curved plate, only Poisson's ratio differs: 0.17 mm at most."""
    mesh = sheet(lambda x, y: 0.02 - 6 * ((x - 0.05) ** 2 + (y - 0.04) ** 2) + 30 * (x - 0.05) * (y - 0.04) ** 2)
    surface = fit_surface(mesh, AcrossGrid(8, 8, (0, 0, 1), (1, 0, 0))).surface
    placed = wrap_sheet(surface, SheetLattice(14, 16, (0.01, 0.01)), None, (1, 0.3, 0), trim=True)
    places = (placed.lattice.index[:, ::-1] - (7.5, 6.5)) * 0.01
    to_flat = flat_map(surface, placed.uv[14, 16], (1, 0.3, 0), None, 0.004, 0.02)
    apart = np.linalg.norm(to_flat(placed.uv[1::2, 1::2].reshape(-1, 2)) - places, axis=1)[placed.inside]
    assert apart.mean() < 1.1e-4 and apart.max() < 1.7e-4
    assert len(apart) > 80 and np.abs(cell_strain(placed)[placed.inside]).max() > 0.01
