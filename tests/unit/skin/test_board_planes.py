"""Rigid boards with several taxels: their planes from positions, and the normals of imported taxels."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration.exchange.icub import read_icub
from skin_calib_addon.calibration.exchange.taxel_set import finished
from skin_calib_addon.skin import SheetLattice, sheet_taxels, wrap_sheet
from skin_calib_addon.skin.board_planes import board_planes
from skin_calib_addon.skin.imported import imported_taxels
from tests.examples import slow
from tests.shapes import Motion, cone_surface, plane_surface, wrist_surface
from tests.unit.skin.test_imported import taxel_set

PITCH = 0.0065
# A triangle of ten taxels, relative to its centre, as the boards of the iCub have them.
TRIANGLE = PITCH * np.array([(j - i / 2, 0.75**0.5 * (i - 2)) for i in range(4) for j in range(i + 1)])
ROUNDING = 1e-6  # [m] of files with six decimals


def boards_around(radius, count=7, rings=3, tilt=0.06, seed=0):
    """Return taxels of flat boards around a tube about z, the normals of the boards, and their numbers.

    Each board is tilted against the tube by a random angle, as boards on a link are.
    """
    rng = np.random.default_rng(seed)
    points, normals = [], []
    for k in range(count * rings):
        angle, height = 2 * np.pi * (k + 0.5 * (k // count)) / count, 0.03 + 0.03 * (k // count)
        out = np.array((np.cos(angle), np.sin(angle), 0.0)) + rng.uniform(-tilt, tilt, 3)
        out /= np.linalg.norm(out)
        x = np.cross((0, 0, 1.0), out)
        x /= np.linalg.norm(x)
        centre = radius * np.array((np.cos(angle), np.sin(angle), 0)) + (0, 0, height)
        points.append(centre + TRIANGLE @ np.stack((x, np.cross(out, x))))
        normals.append(np.tile(out, (10, 1)))
    positions = np.round(np.concatenate(points) / ROUNDING) * ROUNDING
    return positions, np.concatenate(normals), np.repeat(np.arange(count * rings), 10)


def degrees(a, b):
    """Return the angles between unit vectors [degrees]."""
    return np.rad2deg(2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=1) / 2, 0, 1)))


@pytest.mark.parametrize("stated", [True, False])
def test_taxels_of_boards_have_the_normals_of_their_planes(stated):
    """With stated boards or without, every normal is that of its board, outwards. The surface is degrees off."""
    positions, truth, board = boards_around(0.04)
    surface = cone_surface(0.039, 0.039, 0.13)
    taxels = taxel_set(positions, boards=board if stated else None)
    found = imported_taxels(taxels, surface, "s").taxels
    assert degrees(found.normals_link, truth).max() < 0.05
    assert np.percentile(degrees(surface.normals(found.uv), truth), 90) > 5
    assert np.abs((found.normals_link * found.tangents_link).sum(axis=1)).max() < 1e-12
    heights = ((positions - surface.points(found.uv)) * surface.normals(found.uv)).sum(axis=1)
    assert_allclose(found.quality["gap"], heights, rtol=0, atol=1e-12)
    snapped = imported_taxels(taxels, surface, "s", snap=True).taxels  # bent onto the surface: no board is left
    assert_allclose(snapped.normals_link, surface.normals(snapped.uv), rtol=0, atol=1e-12)


def test_boards_do_not_depend_on_order_and_frame():
    """Shuffled taxels in another frame have the same planes."""
    positions, truth, board = boards_around(0.04, seed=3)
    motion, order = Motion(5), np.random.default_rng(1).permutation(len(positions))
    found, normals = board_planes(motion.points(positions)[order])
    wanted = motion.directions(truth)[order]
    assert (found >= 0).all()
    assert degrees(normals * np.sign((normals * wanted).sum(axis=1))[:, None], wanted).max() < 0.05
    assert len({(a, b) for a, b in zip(found.tolist(), board[order].tolist())}) == len(np.unique(board))


@pytest.mark.parametrize("distance, count", [(1.6, 1), (1.8, 2)])
def test_boards_in_one_plane_are_joined_up_to_a_distance(distance, count):
    """Two boards in a plane, 1.6 or 1.8 times as far apart as their taxels."""
    points = np.append(TRIANGLE, np.zeros((10, 1)), axis=1)
    shift = np.array((0.0, 2 * TRIANGLE[:, 1].max() + distance * PITCH, 0.0))
    board = board_planes(np.concatenate((points, points * (1, -1, 1) + shift)))[0]
    assert len(set(board.tolist())) == count and (board >= 0).all()


def rolled(kind, radius, cone=0.0):
    """Return taxels of a flexible sheet around a tube or a cone about z, in squares or triangles."""
    i, j = (k.ravel() for k in np.indices((10, 16)))
    x, y = PITCH * j, PITCH * i
    if kind != "square":
        x, y = PITCH * (j + 0.5 * (i % 2)), PITCH * 0.75**0.5 * i
        x, y = (x, y) if kind == "rows around" else (y, x)
    r = radius + cone * y
    return np.round(np.column_stack((r * np.cos(x / radius), r * np.sin(x / radius), y)), 6)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["square", "rows around", "rows along"])
@pytest.mark.parametrize("radius, cone", [slow(0.02, 0), (0.035, 0), slow(0.1, 0), slow(0.3, 0), (0.05, 0.2)])
def test_a_flexible_sheet_has_no_boards(kind, radius, cone):
    """Two columns along a cylinder are in a plane exactly, but on two lines: their plane is not that of the cells."""
    positions = rolled(kind, radius, cone)
    assert (board_planes(positions)[0] == -1).all()


def test_a_sheet_on_a_doubly_curved_surface_has_no_boards():
    """On an irregular wrist and on a sphere, each taxel keeps the normal of the surface."""
    sheet = sheet_taxels(wrap_sheet(wrist_surface(), SheetLattice(8, 24, (0.006, 0.006)), None, (0, 1, 0)), "s")
    assert (board_planes(np.round(sheet.positions_link, 6))[0] == -1).all()
    rng = np.random.default_rng(0)
    globe = rng.normal(size=(300, 3))
    assert (board_planes(0.04 * globe / np.linalg.norm(globe, axis=1, keepdims=True))[0] == -1).all()


def test_stated_boards_that_are_bent_have_the_normals_of_the_surface():
    """Twelve taxels of a round fingertip are no plane, four on a line have none; three are not enough."""
    ring, tip = rolled("square", 0.012)[:12], rolled("square", 0.012)[np.r_[0:4, 16:20, 32:36]]
    positions = np.concatenate((ring, tip))
    assert (board_planes(positions, np.arange(24) // 12)[0] == -1).all()
    line = np.column_stack((np.arange(8) * PITCH, np.zeros(8), np.zeros(8)))
    assert (board_planes(line, np.zeros(8, int))[0] == -1).all() and (board_planes(line)[0] == -1).all()
    assert (board_planes(positions[:3], np.zeros(3, int))[0] == -1).all()
    assert (board_planes(np.zeros((5, 3)))[0] == -1).all()


def test_flat_sole_is_one_plane_up_to_its_rim():
    """Where the surface is rounded off, taxels of a flat sole keep the normal of the sole."""
    i, j = (k.ravel() for k in np.indices((12, 14)))
    positions = np.column_stack((0.008 + PITCH * j, 0.004 + PITCH * i, np.full(len(i), 0.001)))
    surface = plane_surface()
    net = surface.control_net.copy()
    net[..., 2] -= 8.0 * np.maximum(np.abs(net[..., 0] - 0.05) - 0.02, 0) ** 2
    rounded = type(surface)(net, surface.knots_u, surface.knots_v, surface.degree, surface.closed)
    found = imported_taxels(taxel_set(positions), rounded, "s").taxels
    assert degrees(rounded.normals(found.uv), np.array((0, 0, 1.0))).max() > 10
    assert_allclose(found.normals_link, np.tile((0, 0, 1.0), (len(i), 1)), rtol=0, atol=1e-9)


def test_a_board_across_the_surface_keeps_the_normals_of_the_surface():
    """A plane that stands upright on the surface gives no sign."""
    positions = np.column_stack((0.05 + TRIANGLE[:, 0], np.full(10, 0.04), 0.02 + TRIANGLE[:, 1]))
    found = imported_taxels(taxel_set(positions), plane_surface(), "s").taxels
    assert_allclose(found.normals_link, np.tile((0, 0, 1.0), (10, 1)), rtol=0, atol=1e-9)


def test_twelve_rows_of_an_icub_file_are_a_board():
    """Rows of zeros count: the third board begins at row 24, also if taxels of the first are missing."""
    rows = ["0.01 0.02 0.03 1 0 0"] * 36
    for k in (0, 6, 10, *range(12, 24)):
        rows[k] = "0 0 0 0 0 0"
    rows = [row.replace("0.03", f"0.03{k:02}") if row[:4] == "0.01" else row for k, row in enumerate(rows)]
    taxels, _ = finished(read_icub("name arm\n[calibration]\n" + "\n".join(rows) + "\n"))
    assert taxels.boards.tolist() == [0] * 9 + [2] * 12
    few, _ = finished(read_icub("name arm\n[calibration]\n" + "\n".join(rows) + "\n"), "2?")
    assert few.boards.tolist() == [2] * 6
