"""Flat lattices: cells and nodes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.skin import HexLattice, SheetLattice
from skin_calib_addon.skin.lattice import CENTRE, CORNERS, EDGES

lattices = st.builds(
    SheetLattice, st.integers(1, 7), st.integers(1, 7), st.tuples(st.floats(1e-3, 0.1), st.floats(1e-3, 0.1))
)


def flat_nodes(lattice):
    """Positions of the nodes of the flat lattice: x along the rows, y from row to row, the first corner at the
    origin.
    """
    a, b = lattice.node_shape
    y, x = np.meshgrid(np.arange(a) * lattice.step[0], np.arange(b) * lattice.step[1], indexing="ij")
    return np.stack((x, y), axis=-1)


@given(lattice=lattices)
def test_lattice_lists_its_cells_row_by_row(lattice):
    """Every cell occurs once, in the order of the channels."""
    expected = [[i, j] for i in range(lattice.rows) for j in range(lattice.columns)]
    assert lattice.index.tolist() == expected


@given(lattice=lattices)
def test_lattice_centres_are_half_a_pitch_in(lattice):
    """The centre of cell (k, l) is at (k + 1/2, l + 1/2) pitches, not at a corner."""
    centres = lattice.at_cells(flat_nodes(lattice), CENTRE)[:, 0]
    expected = (lattice.index[:, ::-1] + 0.5) * lattice.pitch[::-1]
    np.testing.assert_allclose(centres, expected, rtol=1e-14)


@given(lattice=lattices)
def test_lattice_corners_are_counter_clockwise(lattice):
    """Corners are counter-clockwise around the centre and enclose a whole cell; edges are between corners."""
    nodes = flat_nodes(lattice)
    centres, corners, edges = (lattice.at_cells(nodes, offsets) for offsets in (CENTRE, CORNERS, EDGES))
    x, y = corners[..., 0], corners[..., 1]
    area = (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1) / 2
    np.testing.assert_allclose(area, lattice.pitch[0] * lattice.pitch[1], rtol=1e-9)
    np.testing.assert_allclose(corners.mean(axis=1), centres[:, 0], rtol=1e-12)
    middles = (corners + np.roll(corners, -1, axis=1)) / 2
    np.testing.assert_allclose(edges, np.roll(middles, -1, axis=1), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    ("rows", "columns", "pitch"),
    [(0, 3, (0.01, 0.01)), (3, -1, (0.01, 0.01)), (3, 3, (0.0, 0.01)), (3, 3, (0.01, -0.01))],
)
def test_lattice_without_area_is_refused(rows, columns, pitch):
    """The message for no rows, no columns or no width has the numbers."""
    with pytest.raises(InvalidPlan, match=rf"a sheet of {rows} x {columns} cells with pitch \[.*\] has no area"):
        SheetLattice(rows, columns, pitch)


@given(st.integers(-30, 30), st.integers(-30, 30), st.floats(0, 0.49), st.floats(0, 2 * np.pi))
def test_point_belongs_to_the_cell_with_the_nearest_centre(q, r, away, turn):
    """A point within half a pitch of a centre belongs to its cell, with any gap."""
    lattice = HexLattice(0.0163, -0.0005)
    place = lattice.centres(np.array([[q, r]]))[0] + away * lattice.pitch * np.array((np.cos(turn), np.sin(turn)))
    assert lattice.cell_at(place) == (q, r)
