"""Boards that grow on from others."""

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.distance import pdist

from skin_calib_addon.geometry import AcrossGrid, TubeGrid, fit_surface
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh
from skin_calib_addon.plan.skins import BoardSkin
from skin_calib_addon.proposal.boards import boards_on
from skin_calib_addon.skin import HexLattice, lay_boards
from skin_calib_addon.skin.boards.front import grown
from skin_calib_addon.skin.boards.ground import MAX_GAP
from skin_calib_addon.skin.boards.layout import Layout
from tests.shapes import cylinder, quads, sheet

BOARD = HexLattice(0.006, 0.0)


@cache
def barrel(noise=0.0):
    """A barrel that bends in two directions, fitted: 30 mm wide at the ends and 100 mm in the middle."""
    z = np.linspace(0, 0.1, 40)
    radii = 0.015 + 0.035 * (1 - (20 * z - 1) ** 2)
    angles = np.arange(96) * 2 * np.pi / 96
    x, y = (np.multiply.outer(radii, of(angles)) for of in (np.cos, np.sin))
    mesh = quads(np.stack((x, y, np.broadcast_to(z[:, None], x.shape)), axis=-1), (False, True))
    moved = mesh.vertices + np.random.default_rng(1).normal(0, noise, mesh.vertices.shape)
    return fit_surface(TriangleMesh(moved, mesh.faces), TubeGrid(12, 24))


@cache
def tube():
    return fit_surface(cylinder(0.03, 0.05), TubeGrid(8, 24))


@cache
def plane():
    return fit_surface(sheet(lambda x, y: 0 * x), AcrossGrid(6, 6, (0, 0, 1), (1, 0, 0)))


def layout(fit, lattice=BOARD):
    return Layout.of(fit.error_field.surface, lattice, None, None, 0.0, fit, ())


@cache
def densest(fit):
    return layout(fit).densest()


def middles(boards):
    """Positions of boards in canonical order."""
    points = boards.surface.points(boards.uv)
    return points[np.lexsort(points.round(5).T)]


def test_more_boards_than_in_a_lattice_are_on_a_barrel():
    """At least a twentieth more, near the mesh and along it, without overlaps, each with coordinates of its own."""
    fit = barrel()
    lattice, _ = lay_boards(fit.error_field.surface, BOARD, "fill", None, None, fit=fit)
    boards = densest(fit)
    assert len(boards.cells) >= 1.05 * len(lattice.cells)
    assert not len(boards.overlaps()[0])
    distances, faces, _ = closest(fit.given_mesh, boards.points)
    assert distances.max() <= 1e-3
    assert np.abs((fit.given_mesh.face_normals[faces] * boards.normals).sum(axis=1)).min() >= np.cos(np.deg2rad(15))
    assert closest(fit.given_mesh, boards.corners().reshape(-1, 3))[0].max() <= MAX_GAP * BOARD.side
    assert len(set(map(tuple, boards.cells.tolist()))) == len(boards.cells)


def test_noise_of_a_nanometre_moves_no_board_by_a_tenth_of_a_millimetre():
    assert_allclose(middles(densest(barrel(1e-9))), middles(densest(barrel())), rtol=0, atol=1e-4)


def test_boards_keep_a_gap_that_is_stated():
    """All grow on from one; two boards lose a little that are inclined to each other."""
    lattice = HexLattice(0.008, 0.002)
    where = layout(barrel(), lattice)
    boards = grown(where.at_start[1][:1], where.fits)
    assert len(boards.cells) > 60 and pdist(boards.points).min() >= 0.97 * lattice.pitch


@pytest.mark.parametrize("made", [plane, tube])
def test_on_a_plane_and_a_tube_the_lattice_is_as_good(made):
    fit = made()
    lattice, _ = lay_boards(fit.error_field.surface, BOARD, "fill", None, None, fit=fit)
    boards = densest(fit)
    assert len(boards.cells) >= len(lattice.cells) and np.count_nonzero(boards.shifted) <= 0.1 * len(boards.cells)


@pytest.mark.parametrize("made", [barrel, tube])
def test_a_list_places_the_boards_again(made):
    """Within two micrometres, with the directions of their rows, from the rounded numbers of the plan."""
    fit = made()
    boards = densest(fit)
    skin, taxels = boards_on(BoardSkin("skin", BOARD, "fill"), fit)
    assert {cell[:2] for cell in skin.choice} == set(map(tuple, taxels.index.tolist()))
    assert [tuple(cell) for cell in taxels.index.tolist()] == [cell[:2] for cell in skin.choice]
    assert_allclose(taxels.positions_link, fit.error_field.surface.points(taxels.uv), rtol=0, atol=1e-9)
    assert_allclose(np.sort(pdist(taxels.positions_link)), np.sort(pdist(middles(boards))), rtol=0, atol=4e-6)
    assert any(len(cell) == 5 for cell in skin.choice) or not boards.shifted.any()
    assert not taxels.quality["overhang"].any()  # whatever the map of a list says, which starts elsewhere
