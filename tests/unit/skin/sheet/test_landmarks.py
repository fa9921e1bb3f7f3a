"""Sheets with landmarks: cells that the author fixes to points of the mesh."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.skin import Landmark, SheetLattice, sheet_taxels, wrap_sheet
from skin_calib_addon.skin.sheet.strain import cell_strain
from tests.examples import examples
from tests.shapes import RADIUS, cone_surface, plane_surface, wrist_surface

LATTICE = SheetLattice(5, 8, (0.01, 0.01))
WIDE = plane_surface(0.2, 0.2)


def centres(surface, landmarks, direction=(1, 0, 0), lattice=LATTICE, **options):
    """Centres of the cells of a sheet with landmarks, shape (rows, columns, 3), and its strain."""
    sheet = wrap_sheet(surface, lattice, None, direction, landmarks=landmarks, **options)
    return sheet_taxels(sheet, "s").positions_link.reshape(lattice.rows, lattice.columns, 3), cell_strain(sheet)


def flat(i, j, scale=(1.0, 1.0), turn=0.0, start=(0.05, 0.06)):
    """Position of cell (i, j) on the plane, stretched along its rows and across, and rotated."""
    x, y = 0.01 * j * scale[0], 0.01 * i * scale[1]
    return start[0] + np.cos(turn) * x - np.sin(turn) * y, start[1] + np.sin(turn) * x + np.cos(turn) * y, 0.0


def pins(cells, **place):
    """Landmarks for some cells."""
    return tuple(Landmark(cell, flat(*cell, **place)) for cell in cells)


def test_one_landmark_replaces_the_origin():
    """Any cell can have it, not only the first."""
    found, _ = centres(WIDE, pins([(2, 3)]))
    expected = np.array([[flat(i, j) for j in range(8)] for i in range(5)])
    assert_allclose(found, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("cells", [[(1, 2)], [(1, 0), (3, 7)], [(0, 0), (0, 7), (4, 0), (4, 7)]])
def test_landmarks_of_oblong_cells_are_met_without_strain(cells):
    """Cells of 12 mm along the rows and 7 mm across, with landmarks where a flat sheet has them."""

    def place(i, j):
        return 0.03 + 0.012 * j, 0.05 + 0.007 * i, 0.0

    lattice = SheetLattice(5, 8, (0.007, 0.012))
    marks = tuple(Landmark(cell, place(*cell)) for cell in cells)
    found, strain = centres(WIDE, marks, (1, 0.1, 0) if len(cells) > 1 else (1, 0, 0), lattice)
    assert_allclose(found, np.array([[place(i, j) for j in range(8)] for i in range(5)]), rtol=0, atol=1e-7)
    assert np.abs(strain).max() < 1e-6


@examples(15)
@given(turn=st.floats(-0.5, 0.5), longer=st.floats(0.9, 1.1))
def test_two_landmarks_turn_the_sheet_and_do_not_stretch_it(turn, longer):
    """The first is met exactly, the second as far as a sheet without strain can."""
    found, strain = centres(WIDE, pins([(1, 0), (3, 7)], turn=turn, scale=(longer, longer)))
    first = np.array(flat(1, 0, (longer, longer), turn))
    rest = np.array([[flat(i - 1, j, turn=turn, start=first[:2]) for j in range(8)] for i in range(5)])
    assert_allclose(found, rest, rtol=0, atol=1e-7)
    assert np.abs(strain).max() < 1e-6


@examples(10)
@given(turn=st.floats(-0.4, 0.4), scale=st.tuples(st.floats(0.96, 1.06), st.floats(0.96, 1.06)))
def test_landmarks_of_an_even_stretch_are_met(turn, scale):
    """A dozen cells of a plane sheet are moved apart evenly: all landmarks are met, and the other cells are stretched
    equally.
    """
    cells = [(i, j) for i in (0, 2, 4) for j in (0, 2, 5, 7)]
    found, strain = centres(WIDE, pins(cells, turn=turn, scale=scale))
    for cell in cells:
        assert_allclose(found[cell], flat(*cell, scale, turn), rtol=0, atol=1e-9)
    wanted = np.array(scale) - 1
    assert_allclose(strain[:, :2].mean(axis=0), wanted, rtol=0, atol=0.5 * np.abs(wanted).max() + 1e-9)
    expected = np.array([[flat(i, j, scale, turn) for j in range(8)] for i in range(5)])
    assert np.linalg.norm(found - expected, axis=2).max() < 0.02 * np.abs(wanted).max() + 1e-9


@pytest.mark.parametrize("surface", [cone_surface(RADIUS, RADIUS), wrist_surface()])
def test_stretch_to_a_landmark_is_smooth(surface):
    """One of four landmarks is 1 mm off: all are met, and the strain is distributed over many cells."""
    free = sheet_taxels(wrap_sheet(surface, LATTICE, None, (0, 1, 0)), "s")
    places = free.positions_link.reshape(5, 8, 3)
    moved = places[2, 4] + 0.001 * free.tangents_link.reshape(5, 8, 3)[2, 4]
    corners = ((0, 0), (0, 7), (4, 0))
    held = (*(Landmark(c, tuple(places[c])) for c in corners), Landmark((2, 4), tuple(moved)))
    found, strain = centres(surface, held, (0, 1, 0))
    assert np.linalg.norm(found[2, 4] - moved) < 5e-5  # the point is not quite on the surface
    added = np.abs(strain - free.quality["strain"]).max(axis=1)
    assert added.max() < 0.06 and (added > 0.1 * added.max()).mean() > 0.3


def test_landmarks_across_a_seam_and_from_a_rough_direction():
    """Landmarks on both sides of a seam are met, from a direction 40 degrees off."""
    surface, turns = cone_surface(RADIUS, RADIUS), np.array((0.0, 0.07, 0.15)) / RADIUS + 2.5
    cells = ((0, 0), (2, 7), (0, 15))
    heights = (0.04, 0.06, 0.04)
    held = tuple(Landmark(c, (RADIUS * np.cos(t), RADIUS * np.sin(t), h)) for c, t, h in zip(cells, turns, heights))
    lattice = SheetLattice(3, 16, (0.01, 0.01))
    along = (-np.sin(2.5), np.cos(2.5), 0.8)
    found, strain = centres(surface, held, along, lattice)
    for landmark in held:
        assert_allclose(found[landmark.cell], landmark.point, rtol=0, atol=1e-6)
    assert np.abs(strain).max() < 1e-3


@pytest.mark.parametrize(
    "held",
    [
        (Landmark((0, 0), (0.05, 0.05, 0)), Landmark((0, 0), (0.06, 0.05, 0))),
        (Landmark((0, 0), (0.05, 0.05, 0)), Landmark((0, 1), (0.06, 0.05, 0)), Landmark((2, 1), (0.05, 0.05, 0))),
    ],
)
def test_landmarks_of_one_cell_or_one_point_are_refused(held):
    """The error names the two landmarks."""
    with pytest.raises(InvalidPlan, match="landmarks 0 and [12] have the same cell or the same point"):
        centres(WIDE, held)


@pytest.mark.parametrize("distance", [0.0052, 0.1, 50.0])
def test_points_far_from_the_surface_are_refused_with_their_distance(distance):
    """Origins and landmarks 5 mm above a plane are accepted; farther ones, metres included, are errors."""
    lattice, surface = SheetLattice(2, 2, (0.01, 0.01)), plane_surface()
    text = rf"is {distance * 1e3:.1f} mm from the surface"
    near, far = (0.03, 0.03, 0.0049), (0.03, 0.03, -distance)
    wrap_sheet(surface, lattice, near, (1, 0, 0))
    with pytest.raises(InvalidPlan, match=f"The origin, .*{text}") as caught:
        wrap_sheet(surface, lattice, far, (1, 0, 0))
    assert caught.value.numbers["distance"] == pytest.approx(distance)
    assert caught.value.numbers["place"].point == far
    with pytest.raises(InvalidPlan, match=f"Landmark 0, .*{text}"):
        wrap_sheet(surface, lattice, None, (1, 0, 0), landmarks=(Landmark((0, 0), far),))
    with pytest.raises(InvalidPlan, match=f"Landmark 1, .*{text}"):
        wrap_sheet(surface, lattice, None, (1, 0, 0), landmarks=(Landmark((0, 0), near), Landmark((1, 1), far)))
