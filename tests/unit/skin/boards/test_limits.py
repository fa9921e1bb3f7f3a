"""Limits of boards: an input just within passes, one just beyond does not.

The numbers are written out, so that a limit does not change unnoticed.
"""

from dataclasses import replace

import numpy as np
import pytest

from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.geometry import AcrossGrid, fit_surface
from skin_calib_addon.skin import HexLattice
from skin_calib_addon.skin.boards.ground import Ground
from skin_calib_addon.skin.boards.layout import Layout
from tests.shapes import plane_surface, sheet

SIDE = 0.01
FLOOR = plane_surface(0.1, 0.08)
UP = np.array((0.0, 0.0, 1.0))
MIDDLE = np.array(((0.5, 0.5),))


@pytest.fixture(scope="module")
def plate():
    """The fit of a flat plate that faces up."""
    return fit_surface(sheet(lambda x, y: 0 * x), AcrossGrid(6, 6, UP, (1, 0, 0)))


def above(plate, height, degrees=0.0):
    """The ground of a surface that is higher than the middle of the plate, and turned about it."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    middle = np.array((0.05, 0.04, 0.0))
    net = (FLOOR.control_net - middle) @ np.array(((c, 0, s), (0, 1, 0), (-s, 0, c))) + middle + height * UP
    return Ground(replace(FLOOR, control_net=net), plate, (), SIDE)


@pytest.mark.parametrize(
    ("height", "degrees", "carries"),
    [(0.99e-3, 0, True), (-1.01e-3, 0, False), (0, 14.9, True), (0, 15.1, False), (0, -15.1, False)],
)
def test_boards_are_within_1_mm_and_15_degrees_of_the_faces(plate, height, degrees, carries):
    """On both sides of the mesh; in the middle of the plate, which the turned surface touches."""
    assert above(plate, height, degrees).carries(MIDDLE).tolist() == [carries]


@pytest.mark.parametrize(
    ("aside", "height", "is_over"),
    [(0, 0.29, True), (0, 0.31, False), (0, -0.31, False), (0.1, 0.2, True), (0.102, 0.2, False)],
)
def test_points_of_boards_are_over_the_mesh(plate, aside, height, is_over):
    """Within three tenths of a side, and beyond an edge of the mesh by half of the height; in sides."""
    point = np.array(((0.05 + (aside > 0) * 0.05 + aside * SIDE, 0.04, height * SIDE),))
    assert above(plate, 0.0).is_over_mesh(point, UP[None]).tolist() == [is_over]


def test_surface_around_which_50000_boards_fit_is_refused():
    """On the circle about this plate, 51 600 are possible: they mean wrong units."""
    with pytest.raises(InvalidPlan, match="extends too far"):
        Layout.of(FLOOR, HexLattice(3.1e-4, 0.0), None, None, 0.0, None, ())
