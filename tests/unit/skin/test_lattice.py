"""Flat lattices: cells and nodes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.skin import HexLattice, SheetLattice


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
