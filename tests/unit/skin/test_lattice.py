"""Flat lattices: cells and nodes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.skin import HexLattice, SheetLattice
from skin_calib_addon.skin.lattice import PORTS


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


def test_boards_are_linked_to_those_at_their_six_sides():
    """A flower has six links from its middle and six around it, each once and as long as the pitch."""
    lattice, cells = HexLattice(0.01, 0.001), np.array([(0, 0), *PORTS])
    pairs = lattice.linked(cells)
    assert len({frozenset(pair) for pair in pairs.tolist()}) == len(pairs) == 12
    ends = lattice.centres(cells)[pairs]
    np.testing.assert_allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), lattice.pitch)
