"""Gaps and overlaps where a sheet closes around the link, against the developed plane."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration import Patch
from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.skin import SheetLattice, sheet_taxels, wrap_sheet
from skin_calib_addon.skin.sheet.closure import Closure, closure, shortest_paths
from skin_calib_addon.skin.warnings import check_overlap
from tests.shapes import LENGTH, RADIUS, cone_surface, plane_surface, wrist_surface

SQUARE = (0.01, 0.01)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_closure_of_a_helix_has_a_step(hand):
    """The beginning of an inclined row is 33 mm to the side of its end, along one arc; the sheet is 20 mm wide."""
    climb, around = 0.15, 2 * np.pi * RADIUS
    lattice = SheetLattice(2, 21, SQUARE, hand)
    origin = (RADIUS, 0, 0.03)
    sheet = wrap_sheet(cone_surface(RADIUS, RADIUS), lattice, origin, (0, np.cos(climb), np.sin(climb)))
    found = closure(sheet)
    ahead, aside = around * np.cos(climb) - 0.21, around * np.sin(climb)
    gaps = np.hypot(ahead, aside - np.array((0.01, 0.02)))
    assert_allclose(found.gaps, gaps[::-1] if hand == "right" else gaps, rtol=0, atol=1e-5)
    sign = 1 if hand == "right" else -1
    assert_allclose(found.steps, -sign * aside, rtol=0, atol=3e-5)


@pytest.mark.parametrize("climb", [0.0, 0.04, -0.04])
def test_place_of_the_largest_overlap_has_cells_of_both_ends(climb):
    """Of an inclined row, one end is on another row, and the other end is free."""
    heading = (0, np.cos(climb), np.sin(climb))
    sheet = wrap_sheet(cone_surface(RADIUS, RADIUS), SheetLattice(2, 24, SQUARE), (RADIUS, 0, 0.05), heading)
    found, taxels = closure(sheet), sheet_taxels(sheet, "skin")
    assert found.overlap > 0.01
    near = taxels.index[np.linalg.norm(taxels.positions_link - found.place, axis=1) < 0.0075, 1]
    assert near.min() < 4 and near.max() > 19


def test_closure_of_columns_and_of_a_short_sheet():
    """With rows along the axis, the columns close. On a cone the gap grows with the radius; a short sheet has none."""
    sheet = wrap_sheet(cone_surface(RADIUS, RADIUS), SheetLattice(21, 4, SQUARE), None, (0, 0, 1))
    assert closure(sheet).of == "columns"
    assert_allclose(closure(sheet).gaps, 2 * np.pi * RADIUS - 0.21, rtol=0, atol=5e-6)
    assert closure(wrap_sheet(cone_surface(), SheetLattice(3, 9, SQUARE), None, (0, 1, 0))) is None
    assert closure(wrap_sheet(plane_surface(), SheetLattice(3, 4, SQUARE), None, (1, 0, 0))) is None


def test_long_paths_are_those_of_the_developed_cone():
    """Up to four fifths of a turn and 20 cm: lengths and headings are those of a straight line in the plane."""
    surface, rng = cone_surface(0.02, 0.05, 0.1), np.random.default_rng(0)
    start = rng.uniform(0.1, 0.9, (40, 2))
    end = np.clip(start + rng.uniform(-0.8, 0.8, (40, 2)), 0.02, 0.98)
    lengths, headings, _ = shortest_paths(surface, start, end)
    sine = 0.3 / 1.09**0.5  # of half of the angle at the apex
    (r, from_z), (s, to_z) = ((np.hypot(*p[:, :2].T) / sine, p[:, 2]) for p in map(surface.points, (start, end)))
    apart = 2 * np.pi * (end - start)[:, 1] * sine
    straight = np.sqrt(r * r + s * s - 2 * r * s * np.cos(apart))
    assert_allclose(lengths, straight, rtol=0, atol=4e-5)
    along = (s * np.cos(apart) - r) / straight  # of the heading, away from the apex
    upwards = np.array((1.0, 0.3)) / 1.09**0.5  # of a line of the cone: along z, outwards
    out = surface.points(start)[:, :2] / np.hypot(*surface.points(start)[:, :2].T)[:, None]
    found = headings[:, 2] * upwards[0] + (headings[:, :2] * out).sum(axis=1) * upwards[1]
    assert_allclose(found, along, rtol=0, atol=8e-3)


@pytest.mark.parametrize("cells, is_refused", [(0.07, False), (0.15, True), (1.15, True)])
def test_overlap_of_a_tenth_of_a_cell_is_refused(cells, is_refused):
    """The message names the columns that are too many: one for 0.15 cells, two for 1.15."""
    sheet = wrap_sheet(cone_surface(RADIUS, RADIUS), SheetLattice(3, 22, SQUARE), None, (0, 1, 0))
    lapped = Closure("rows", np.arange(3), -cells * np.array((0.0, 0.01, 0.005)), np.zeros(3), np.ones(3))
    patch = Patch("skin", "sheet", "s", (3, 22), SQUARE, sheet_taxels(sheet, "skin"))
    if not is_refused:
        return check_overlap(patch, lapped)
    with pytest.raises(InvalidPlan, match=f"Use {np.ceil(cells):.0f} fewer columns") as error:
        check_overlap(patch, lapped)
    assert error.value.numbers["place"].point == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("heading", np.deg2rad([-60, -30, 0, 5, 45, 90]))
def test_gap_of_a_cylinder_is_that_of_the_developed_plane(heading):
    """For rows in any direction, the smallest gap is the distance of the flat rectangle to itself one turn later."""
    radius, lattice = 0.025, SheetLattice(4, 9, (0.008, 0.01))
    around = 2 * np.pi * radius
    surface = cone_surface(radius, radius, 0.4)
    sheet = wrap_sheet(surface, lattice, (radius, 0, 0.2), (0, np.cos(heading), np.sin(heading)))
    found = closure(sheet)
    size = np.array((0.09, 0.032))
    covered = size @ np.abs((np.cos(heading), np.sin(heading))) / around
    if covered < 0.5:
        assert found is None
        return
    offset = around * np.abs((np.cos(heading), np.sin(heading)))
    truth = np.linalg.norm(np.maximum(offset - size, 0))
    assert (offset > size).any()
    assert_allclose(found.gaps.min(), truth, rtol=0, atol=5e-5)


@pytest.mark.parametrize(("columns", "rows", "heading", "of", "overlap"), [
    (22, 8, 45, "columns", 0.0),  # along the rows the sheet is 109 mm too long, but it passes itself 47 mm aside
    (22, 12, 45, "columns", 0.12 - 0.157080 * 0.70711),
    (17, 3, 0, "rows", 0.17 - 0.157080),
    (3, 17, 90, "columns", 0.17 - 0.157080),
    (19, 6, 20, "columns", 0.06 - 0.157080 * 0.34202),
])  # fmt: skip
def test_overlap_of_a_cylinder_is_what_the_lines_are_too_long(columns, rows, heading, of, overlap):
    """Rows or columns are selected: the ones that lose the smaller fraction of their length."""
    heading = np.deg2rad(heading)
    lattice = SheetLattice(rows, columns, (0.008, 0.01) if rows == 8 else SQUARE)
    sheet = wrap_sheet(
        cone_surface(0.025, 0.025, 0.6), lattice, (0.025, 0, 0.25), (0, np.cos(heading), np.sin(heading))
    )
    found = closure(sheet)
    assert found.of == of
    assert_allclose(found.overlap, overlap, rtol=0, atol=5e-5)
    if overlap == 0:
        assert_allclose(found.gaps.min(), 0.157080 * 0.70711 - 0.064, rtol=0, atol=5e-5)


def test_trimmed_sheet_closes_between_the_cells_that_remain():
    """Rows beyond the rim have no gap; the others have that of the circumference."""
    surface = cone_surface(RADIUS, RADIUS)
    sheet = wrap_sheet(surface, SheetLattice(14, 20, SQUARE), (RADIUS, 0, 0.055), (0, 1, 0), trim=True)
    found = closure(sheet)
    assert found.of == "rows" and found.lines.tolist() == [0, 1, 2, 3, 4] and LENGTH == 0.1
    assert_allclose(found.gaps, 2 * np.pi * RADIUS - 0.2, rtol=0, atol=5e-6)


def test_part_of_a_turn_on_a_link_has_a_large_gap():
    """A sheet over more than half of an irregular link ends far from itself: its rows and the gap are the perimeter."""
    surface = wrist_surface()
    sheet = wrap_sheet(surface, SheetLattice(1, 14, SQUARE), None, (0, 1, 0))
    found = closure(sheet)
    v = np.linspace(0, 1, 4001)
    u = np.interp(v % 1, *np.array(sorted((b % 1, a) for a, b in sheet.uv[1])).T, period=1)
    ring = np.linalg.norm(np.diff(surface.points(np.column_stack((u, v))), axis=0), axis=1).sum()
    assert found.of == "rows" and abs(found.gaps[0] - (ring - 0.14)) < 0.002 and found.overlap == 0
