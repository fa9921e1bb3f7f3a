"""Folds of sheets: cells that are turned over, and cells that are in one place."""

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import make_lsq_spline
from scipy.spatial.distance import pdist

from skin_calib_addon.common.errors import InvalidPlan, SkinCalibError, millimetres
from skin_calib_addon.geometry import BSplineSurface
from skin_calib_addon.geometry.surface.bspline import clamped_knots, greville
from skin_calib_addon.skin import Landmark, SheetLattice, sheet_taxels, wrap_sheet
from skin_calib_addon.skin.sheet.folds import check_folds, turned_over
from skin_calib_addon.skin.sheet.wrap import WrappedSheet
from tests.shapes import cone_surface, plane_surface

BEND, ARM, WIDTH = 0.008, 0.09, 0.2  # radius of the bend, length of the plane parts, width of the plate [m]
QUARTER = BEND * np.pi / 2
SQUARE = (0.008, 0.008)


def on_plate(arc, y, concave):
    """Return the points of a plate with a bend of 90 degrees, at the arc length across the bend and along it."""
    turn = np.clip((arc - ARM) / BEND, 0, np.pi / 2)
    after = np.maximum(arc - ARM - QUARTER, 0)
    x, drop = np.minimum(arc, ARM) + BEND * np.sin(turn), BEND * (1 - np.cos(turn)) + after
    return np.stack(np.broadcast_arrays(x, y, drop if concave else -drop), axis=-1)


@cache
def bent_plate(concave, spans=80, density=8.0):
    """Return a surface on the plate whose lines are denser in the bend, as those that follow the curvature."""
    arc = np.linspace(0, 2 * ARM + QUARTER, 8001)
    weight = 1 + (density - 1) / 2 * (np.tanh((arc - ARM) / 0.004) - np.tanh((arc - ARM - QUARTER) / 0.004))
    t = np.append(0, np.cumsum(weight[1:] + weight[:-1]))
    knots, side = clamped_knots(spans, 3), clamped_knots(6, 3)
    profile = make_lsq_spline(t / t[-1], on_plate(arc, 0.0, concave)[:, [0, 2]], knots, k=3).c
    net = np.empty((spans, 6, 3))
    net[..., 0], net[..., 1], net[..., 2] = profile[:, :1], WIDTH * greville(side, 3), profile[:, 1:]
    return BSplineSurface(net, knots, side, (3, 3), (False, False))


@pytest.mark.parametrize(("shape", "concave", "u", "heading"), [
    ((9, 5), False, 0.516, 0.0),
    ((9, 5), True, 0.506, 0.0),
    ((5, 9), False, 0.509, np.pi / 2),
    ((5, 9), True, 0.476, np.pi / 2),
    ((5, 9), True, 0.585, 0.88),
    ((5, 9), False, 0.679, -2.14),
])  # fmt: skip
def test_sheet_around_a_bend_is_the_unrolling(shape, concave, u, heading):
    """The radius of the bend is that of a cell. Each cell is where the flat plate has it; none is in the place of
    another one.
    """
    surface = bent_plate(concave)
    lattice, start = SheetLattice(*shape, SQUARE), surface.points([[u, 0.5]])[0]
    r = surface.derivatives([[u, 0.5]])[:, :, 0]
    across, side = (part / np.linalg.norm(part) for part in (r[1, 0], r[0, 1]))
    sheet = wrap_sheet(surface, lattice, start, np.cos(heading) * across + np.sin(heading) * side)
    positions = sheet_taxels(sheet, "s").positions_link
    arcs = np.linspace(0, 2 * ARM + QUARTER, 200001)
    origin = arcs[np.linalg.norm(on_plate(arcs, start[1], concave) - start, axis=1).argmin()]
    i, j = lattice.index.T
    x, y = j * SQUARE[1], i * SQUARE[0]
    c, s = np.cos(heading), np.sin(heading)
    truth = on_plate(origin + c * x - s * y, start[1] + s * x + c * y, concave)
    assert np.linalg.norm(positions - truth, axis=1).max() < 1e-4
    assert pdist(positions).min() > 0.9 * SQUARE[0]


def test_sheet_on_waves_starts_from_a_guess_without_a_fold():
    """Geodesics through every node cross each other in the hollows; longer steps follow the waves less."""
    knots = clamped_knots(24, 3)
    x, y = np.meshgrid(0.2 * greville(knots, 3), 0.2 * greville(knots, 3), indexing="ij")
    z = 0.018 * np.sin(40 * np.pi * x) * np.sin(40 * np.pi * y)
    surface = BSplineSurface(np.stack((x, y, z), axis=-1), knots, knots, (3, 3), (False, False))
    sheet = wrap_sheet(surface, SheetLattice(4, 5, (0.01, 0.01)), None, (0.88, 0.48, 0))
    assert not turned_over(sheet.layer, sheet.lattice, sheet.uv).any()


def on_plane(lattice, place, extent=1.0):
    """Return a plane surface, and the parameters of nodes that ``place`` moves from their flat positions."""
    surface = plane_surface(extent, extent)
    a, b = lattice.node_shape
    y, x = np.meshgrid(np.arange(a) * lattice.step[0], np.arange(b) * lattice.step[1], indexing="ij")
    return surface, np.stack(place(x, y), axis=-1) / extent


def checked(lattice, place, inside=None):
    """Check the folds of a sheet on a plane."""
    inside = np.ones(lattice.rows * lattice.columns, bool) if inside is None else inside
    surface, uv = on_plane(lattice, place)
    check_folds(surface, lattice, uv, inside)
    return turned_over(surface, lattice, uv)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_reflected_part_of_a_sheet_is_turned_over(hand):
    """A fold along a line has no strain: the cells behind it are turned over, and those on it in part."""
    lattice = SheetLattice(4, 7, (0.01, 0.02), hand)
    at = 0.2 if hand == "right" else 0.3

    def folded(line):
        return lambda x, y: (0.2 + np.where(x > line, 2 * line - x, x), at + y)

    checked(lattice, folded(1.0))
    with pytest.raises(
        InvalidPlan, match=r"cell \(0, 4\) at \(.*\) mm is turned over, the first of 12: the sheet"
    ) as e:
        checked(lattice, folded(0.08))
    assert (e.value.numbers["row"], e.value.numbers["column"], e.value.numbers["count"]) == (0, 4, 12)
    assert millimetres(e.value.numbers["place"].point) in str(e.value)
    surface, uv = on_plane(lattice, folded(0.09))  # in the middle of column 4: one of its halves is turned over
    assert np.flatnonzero(turned_over(surface, lattice, uv)).tolist() == [
        7 * i + j for i in range(4) for j in (4, 5, 6)
    ]
    kept = lattice.index[:, 1] < 4  # cells outside the surface, that a trimmed sheet leaves out
    checked(lattice, folded(0.08), kept)
    mirrored = on_plane(SheetLattice(4, 7, (0.01, 0.02), "left" if hand == "right" else "right"), folded(1.0))[1]
    assert turned_over(surface, lattice, mirrored).all()


@pytest.mark.parametrize("corner", [(-1, -1), (-1, 1), (1, -1), (1, 1)])
def test_one_half_of_a_cell_is_turned_over(corner):
    """A corner that is pulled beyond the diagonal of its quarter turns over half of it."""
    lattice = SheetLattice(3, 3, (0.01, 0.01))
    for pull, folded in ((0.4, False), (0.6, True)):
        surface, uv = on_plane(lattice, lambda x, y: (0.2 + x, 0.2 + y))
        node = 3 + corner[0], 3 + corner[1]
        uv[node] += pull * (uv[3, 3] - uv[node])
        found = turned_over(surface, lattice, uv)
        assert found[4] == folded and not found[[0, 2, 6, 8]].all()


def test_parts_that_are_not_adjacent_may_not_be_in_one_place():
    """A sheet bent in its plane by more than a turn keeps its orientation everywhere, but meets itself."""
    lattice = SheetLattice(3, 40, (0.01, 0.01))

    def ring(turn):
        def place(x, y):
            angle = x / 0.4 * turn
            return 0.5 + (0.1 - y) * np.sin(angle), 0.5 - (0.1 - y) * np.cos(angle)

        return place

    assert not checked(lattice, ring(6.0)).any()
    with pytest.raises(
        InvalidPlan, match=r"cells \(0, 0\) and \(0, 3[67]\) are both at \(.*\) mm: the sheet overlaps"
    ) as e:
        checked(lattice, ring(6.8))
    assert millimetres(e.value.numbers["place"].point) in str(e.value)
    without_end = lattice.index[:, 1] < 36
    checked(lattice, ring(6.8), without_end)


def test_several_turns_around_a_tube_are_no_fold():
    """Cells over others, one turn later, are an overlap where the sheet closes, which the plan may allow."""
    sheet = wrap_sheet(cone_surface(0.02, 0.02), SheetLattice(3, 30, (0.01, 0.01)), None, (0, 1, 0))
    assert isinstance(sheet, WrappedSheet) and sheet.uv[..., 1].max() - sheet.uv[..., 1].min() > 2


def test_landmarks_that_mirror_the_sheet_are_refused():
    """Three landmarks in the order of a left-handed sheet turn a right-handed one over; a left-handed one fits."""
    cells = [(0, 0), (0, 7), (4, 0), (4, 7)]
    marks = [Landmark((i, j), (0.06 + 0.01 * j, 0.12 - 0.01 * i, 0.0)) for i, j in cells]
    surface = plane_surface(0.2, 0.2)
    with pytest.raises(SkinCalibError, match=r"is turned over|are both at|did not converge"):
        wrap_sheet(surface, SheetLattice(5, 8, (0.01, 0.01)), None, (1, 0, 0), landmarks=marks)
    left = wrap_sheet(surface, SheetLattice(5, 8, (0.01, 0.01), "left"), None, (1, 0, 0), landmarks=marks)
    assert_allclose(sheet_taxels(left, "s").positions_link[-1], marks[-1].point, rtol=0, atol=1e-7)


def test_trimmed_sheet_around_a_bend_has_no_fold():
    """The part of a sheet on the surface is checked, the part beyond its edges is not."""
    sheet = wrap_sheet(bent_plate(False), SheetLattice(12, 30, SQUARE), None, (1, 0, 0), trim=True)
    assert 0 < sheet.inside.sum() < 360
    assert not (turned_over(sheet.layer, sheet.lattice, sheet.uv) & sheet.inside).any()
    assert pdist(sheet_taxels(sheet, "s").positions_link).min() > 0.9 * SQUARE[0]
