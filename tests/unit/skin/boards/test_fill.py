"""Boards on flat plates: never fewer than a dense search finds, all inside, and the tightest board has clearance."""

import numpy as np
import pytest

from skin_calib_addon.geometry import AcrossGrid, fit_surface, weld
from skin_calib_addon.skin import HexLattice, lay_boards
from skin_calib_addon.skin.boards.layout import MAX_PROTRUSION, OUTLINE_SAMPLES
from tests.examples import slow
from tests.oracles import all_offsets, boards_inside, most_boards
from tests.shapes import keep, sheet, with_hole

SIDE = 0.0163
TIGHT = HexLattice(SIDE, 0.0)
TRIMMED = HexLattice(SIDE, 0.02775 - np.sqrt(3) * SIDE)  # those of the thesis, with a negative gap
SMALL = HexLattice(0.011, 0.0)


def disc(radius, rings=12, sectors=72):
    """Return a flat disc with a round rim; normals point up."""
    angle, r = np.meshgrid(2 * np.pi * np.arange(sectors) / sectors, radius * np.arange(1, rings + 1) / rings)
    points = np.column_stack((r.ravel() * np.cos(angle).ravel(), r.ravel() * np.sin(angle).ravel(), 0 * r.ravel()))
    i, j = (k.ravel() for k in np.indices((rings - 1, sectors)))
    a, b = i * sectors + j, i * sectors + (j + 1) % sectors
    fan = np.column_stack((np.full(sectors, len(points)), np.arange(sectors), (np.arange(sectors) + 1) % sectors))
    faces = np.concatenate((np.column_stack((a, a + sectors, b)), np.column_stack((b, a + sectors, b + sectors)), fan))
    return weld(np.append(points, np.zeros((1, 3)), axis=0), faces)


PLATE = sheet(lambda x, y: 0 * x, (0.2, 0.15), (80, 60))
PLATES = {
    "rectangle": PLATE,
    "disc": disc(0.07),
    "corner": keep(PLATE, lambda c: (c[:, 0] < 0.09) | (c[:, 1] < 0.08)),
    "cross": keep(PLATE, lambda c: (np.abs(c[:, 0] - 0.1) < 0.05) | (np.abs(c[:, 1] - 0.075) < 0.04)),
    "wedge": keep(PLATE, lambda c: c[:, 1] < 0.06 + 0.4 * c[:, 0]),
    "hole": with_hole(PLATE, (0.1, 0.06, 0), 0.012),
}


def rim(mesh):
    """Return the edges with one face, shape (e, 2, 2)."""
    edges = np.sort(np.concatenate((mesh.faces[:, :2], mesh.faces[:, 1:], mesh.faces[:, ::2])), axis=1)
    found, times = np.unique(edges, axis=0, return_counts=True)
    return mesh.vertices[found[times == 1]][:, :, :2]


def filled(mesh, lattice):
    """Return boards on a plate, and their centres and corners in its plane."""
    fit = fit_surface(mesh, AcrossGrid(8, 8, (0, 0, 1), (1, 0, 0), margin=1e-7))
    boards, _ = lay_boards(fit.surface, lattice, "fill", None, None, fit=fit)
    along = boards.tangents[0, :2]
    return boards, fit.surface.points(boards.uv)[:, :2], lattice.corners @ ((along), (-along[1], along[0]))


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "lattice"),
    [
        ("disc", TIGHT),
        ("corner", TRIMMED),
        *(slow(name, lattice) for name in PLATES for lattice in (TIGHT, TRIMMED, SMALL)),
    ],
)
def test_dense_search_gives_no_more_boards(name, lattice):
    """All offsets in steps of two millimetres, all angles in steps of two degrees, every board with every edge. Boards
    found are inside, apart from the corners of the border between two nodes. A right angle can protrude by half of the
    distance between two samples of a side more.
    """
    boards, centres, corners = filled(PLATES[name], lattice)
    edges = rim(PLATES[name])
    most = most_boards(edges, lattice, all_offsets(lattice, 2e-3), np.deg2rad(np.arange(0, 60, 2)))
    assert len(boards.cells) >= most
    assert boards_inside(centres, (1 - MAX_PROTRUSION - 0.5 / OUTLINE_SAMPLES) * corners, edges).all()


@pytest.mark.parametrize(("width", "height", "rows"), [(9, 8, [9, 8, 9, 8, 9]), (2, 3.5, [2, 1])])
def test_boards_that_fill_a_rectangle_to_its_edges_are_found(width, height, rows):
    """The boards touch all four sides, so that no step of a search meets the single pose."""
    mesh = sheet(lambda x, y: 0 * x, (np.sqrt(3) * SIDE * width, SIDE * height), (30, 20))
    assert len(filled(mesh, TIGHT)[0].cells) == sum(rows)


def test_boards_are_in_the_middle_where_they_are_tight():
    """The free widths at both sides of a strip of boards are equal."""
    _, centres, _ = filled(sheet(lambda x, y: 0 * x, (0.2, 0.036), (40, 8)), TIGHT)
    assert abs(centres[:, 1].mean() - 0.018) < 1e-4
