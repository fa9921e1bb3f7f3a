"""Taxels of placed sheets: frames, corners, areas, neighbours."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.calibration.model import fan_areas
from skin_calib_addon.skin import SheetLattice, sheet_taxels, wrap_sheet
from skin_calib_addon.skin.neighbours import neighbours
from tests.examples import examples
from tests.shapes import RADIUS, TURN, cone_surface, plane_surface, wrist_surface

SQUARE = (0.01, 0.01)


def wrapped(surface, shape=(4, 7), pitch=SQUARE, origin=None, direction=(0, 1, 0), **names):
    """Taxels of a sheet."""
    sheet = wrap_sheet(surface, SheetLattice(*shape, pitch), origin, direction)
    return sheet_taxels(sheet, **({"name": "s"} | names))


SHEETS = [
    pytest.param(wrapped(cone_surface(RADIUS, RADIUS), (6, 22)), id="cylinder"),
    pytest.param(wrapped(cone_surface(), (3, 9), direction=(0, 1, 1)), id="cone"),
    pytest.param(wrapped(wrist_surface(), (6, 22)), id="wrist"),
    pytest.param(wrapped(plane_surface(), (4, 5), origin=(0.03, 0.02, 0), direction=(1, 0.2, 0)), id="plane"),
]


@pytest.mark.parametrize("taxels", SHEETS)
def test_tangents_run_along_the_rows(taxels):
    """Frames are orthonormal; the next taxel of the row is along the tangent, the next row along normal x tangent."""
    normals, tangents = taxels.normals_link, taxels.tangents_link
    frames = np.stack((tangents, np.cross(normals, tangents), normals), axis=1)
    assert_allclose(frames @ frames.transpose(0, 2, 1), np.tile(np.eye(3), (len(frames), 1, 1)), atol=1e-12)
    frames = frames.reshape(-1, taxels.index[:, 1].max() + 1, 3, 3)
    places = taxels.positions_link.reshape(frames.shape[0], -1, 3)
    along, up = np.diff(places, axis=1), np.diff(places, axis=0)
    assert ((along * frames[:, :-1, 0]).sum(axis=2) > 0.97 * np.linalg.norm(along, axis=2)).all()
    assert ((up * frames[:-1, :, 1]).sum(axis=2) > 0.97 * np.linalg.norm(up, axis=2)).all()


@pytest.mark.parametrize("surface", [plane_surface(), wrist_surface()], ids=["plane", "wrist"])
def test_size_of_a_cell_is_along_the_row_and_across(surface):
    """The distances to the next cell of the row and to the next row, which are chords, to 2 %."""
    taxels = wrapped(surface, (4, 5), (0.006, 0.011))
    places = taxels.positions_link.reshape(4, 5, 3)
    size = taxels.quality["size"].reshape(4, 5, 2)
    along, across = (np.linalg.norm(np.diff(places, axis=axis), axis=2) for axis in (1, 0))
    assert_allclose((size[:, 1:, 0] + size[:, :-1, 0]) / 2, along, rtol=0.02)
    assert_allclose((size[1:, :, 1] + size[:-1, :, 1]) / 2, across, rtol=0.02)


@pytest.mark.parametrize("taxels", SHEETS)
def test_corners_are_counter_clockwise(taxels):
    """Corners are counter-clockwise seen from outside, from the beginning of the sheet; those of adjacent cells are
    identical.
    """
    arms = taxels.corners_link - taxels.positions_link[:, None]
    turn = (np.cross(arms, np.roll(arms, -1, axis=1)) * taxels.normals_link[:, None]).sum(axis=2)
    assert (turn > 0).all()
    across = np.cross(taxels.normals_link, taxels.tangents_link)
    assert ((arms[:, 0] * taxels.tangents_link).sum(axis=1) < 0).all() and ((arms[:, 0] * across).sum(axis=1) < 0).all()
    rows, columns = taxels.index.max(axis=0) + 1
    corners = taxels.corners_link.reshape(rows, columns, 4, 3)
    assert (corners[:, :-1, 1] == corners[:, 1:, 0]).all() and (corners[:, :-1, 2] == corners[:, 1:, 3]).all()
    assert (corners[:-1, :, 3] == corners[1:, :, 0]).all() and (corners[:-1, :, 2] == corners[1:, :, 1]).all()


def test_areas_are_those_of_the_cells():
    """Areas are exact on a plane and those of four chords on a cylinder; the strain changes the sum on the wrist."""
    assert_allclose(wrapped(plane_surface(), (4, 5), (0.012, 0.009)).areas, 0.012 * 0.009, rtol=1e-9)
    half = 0.005 / RADIUS / 2
    expected = 0.01**2 * np.sin(half) / half * np.cos(half) ** 0
    assert_allclose(wrapped(cone_surface(RADIUS, RADIUS), (6, 22)).areas, expected, rtol=1e-3)
    wrist = wrapped(wrist_surface(), (6, 22))
    stretch = (1 + wrist.quality["strain"][:, :2]).prod(axis=1)
    assert_allclose(wrist.areas, 0.01**2 * stretch, rtol=5e-3)


def test_fan_areas_of_polygons_are_theirs():
    """The areas of a unit square about its middle and of a hexagon are exact."""
    square = np.array([[(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]]) / 2
    assert_allclose(fan_areas(np.zeros((1, 3)), square), 1)
    angle = np.arange(6) * np.pi / 3
    hexagon = np.column_stack((np.cos(angle), np.sin(angle), 0 * angle))[None]
    assert_allclose(fan_areas(np.zeros((1, 3)), hexagon), 1.5 * np.sqrt(3))


def test_taxels_are_numbered_row_by_row():
    """Ids name patch, row and column; channels continue from the first; the index is that of the lattice."""
    taxels = wrapped(plane_surface(), (2, 3), name="palm", first_channel=40)
    assert taxels.ids == ("palm.0.0", "palm.0.1", "palm.0.2", "palm.1.0", "palm.1.1", "palm.1.2")
    assert taxels.channels.tolist() == list(range(40, 46))
    assert taxels.index.tolist() == [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]]


def test_uv_leads_to_the_position():
    """Parameters are in [0, 1) if the surface is closed, also for a sheet that crosses the seam more than once."""
    surface = cone_surface(RADIUS, RADIUS)
    taxels = wrapped(surface, (2, 50), origin=(-RADIUS, 0, 0.05))
    assert ((taxels.uv[:, 1] >= 0) & (taxels.uv[:, 1] < 1)).all()
    assert_allclose(surface.points(taxels.uv), taxels.positions_link, rtol=0, atol=1e-12)
    assert_allclose(surface.normals(taxels.uv), taxels.normals_link, rtol=0, atol=1e-12)


def lattice_neighbours(rows, columns, closed=False):
    """The pairs of cells with a common side."""
    pairs = {((i, j), (i + 1, j)) for i in range(rows - 1) for j in range(columns)}
    pairs |= {((i, j), (i, j + 1)) for i in range(rows) for j in range(columns - 1)}
    if closed:
        pairs |= {((i, columns - 1), (i, 0)) for i in range(rows)}
    return {frozenset(f"s.{i}.{j}" for i, j in pair) for pair in pairs}


def found_neighbours(taxels):
    """The pairs in the taxels; each must occur in both directions."""
    directed = {(a, b) for a, others in zip(taxels.ids, taxels.neighbours) for b in others}
    assert directed == {(b, a) for a, b in directed} and all(a != b for a, b in directed)
    assert all(list(others) == sorted(set(others), key=taxels.ids.index) for others in taxels.neighbours)
    return {frozenset(pair) for pair in directed}


@examples(20)
@given(
    rows=st.integers(1, 5),
    columns=st.integers(1, 6),
    pitch=st.tuples(st.floats(0.003, 0.012), st.floats(0.003, 0.012)),
    heading=st.floats(-0.3, 0.3),
)
def test_neighbours_have_a_common_side(rows, columns, pitch, heading):
    """Neighbours are those of the lattice, for cells up to four times as long as wide, on a plane and on a cylinder."""
    direction = (np.cos(heading), np.sin(heading), 0.0)
    flat = wrapped(plane_surface(0.15, 0.15), (rows, columns), pitch, direction=direction)
    assert found_neighbours(flat) == lattice_neighbours(rows, columns)
    bent = wrapped(cone_surface(RADIUS, RADIUS), (rows, columns), pitch, origin=(RADIUS, 0, 0.02))
    assert found_neighbours(bent) == lattice_neighbours(rows, columns)


@pytest.mark.parametrize("gap", [-0.0045, -0.003, 0.0, 0.003, 0.0045])
def test_neighbours_exist_across_the_seam(gap):
    """The first and the last cell of a closed row are neighbours, with a gap or an overlap of up to half a cell."""
    radius = (0.22 + gap) / TURN
    taxels = wrapped(cone_surface(radius, radius), (4, 22))
    assert found_neighbours(taxels) == lattice_neighbours(4, 22, closed=True)


def test_rows_that_end_far_apart_are_no_neighbours():
    """A gap of a whole cell is not a seam."""
    taxels = wrapped(cone_surface(RADIUS, RADIUS), (4, 20))
    assert found_neighbours(taxels) == lattice_neighbours(4, 20)


def test_cells_on_two_sides_of_a_thin_part_are_no_neighbours():
    """Cells at one position with opposite normals are not neighbours."""
    positions, normals = np.zeros((2, 3)), np.array(((0, 0, 1.0), (0, 0, -1.0)))
    corners = np.tile(0.005 * np.array(((1.0, -1, 0), (1, 1.0, 0), (-1.0, 1, 0), (-1, -1.0, 0))), (2, 1, 1))
    assert neighbours(("a", "b"), positions, normals, corners) == ((), ())
    assert neighbours(("a", "b"), positions, np.abs(normals), corners) == (("b",), ("a",))


@pytest.mark.parametrize("offset, are_neighbours", [(0.45, True), (0.55, False)])
def test_cells_of_shifted_rows_are_neighbours_up_to_half_a_cell(offset, are_neighbours):
    """The centre of one is ahead of the side of the other."""
    positions, normals = 0.01 * np.array(((0, 0, 0), (offset, 1.0, 0))), np.tile((0, 0, 1.0), (2, 1))
    square = 0.005 * np.array(((1.0, -1, 0), (1, 1.0, 0), (-1.0, 1, 0), (-1, -1.0, 0)))
    found = neighbours(("a", "b"), positions, normals, positions[:, None] + square)
    assert found == ((("b",), ("a",)) if are_neighbours else ((), ()))


def test_cells_of_different_size_are_neighbours():
    """A small cell ahead of the side of a large one is a neighbour in both directions."""
    sizes, positions = np.array((0.015, 0.004)), np.array(((0, 0, 0), (0.019, 0.005, 0)))
    normals = np.tile((0, 0, 1.0), (2, 1))
    square = np.array(((1.0, -1, 0), (1, 1.0, 0), (-1.0, 1, 0), (-1, -1.0, 0)))
    corners = positions[:, None] + sizes[:, None, None] * square
    assert neighbours(("large", "small"), positions, normals, corners) == (("small",), ("large",))


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1)])
def test_thin_sheets_have_taxels_too(shape):
    """Sheets of one cell, one row and one column work."""
    taxels = wrapped(cone_surface(), shape)
    assert len(taxels.ids) == shape[0] * shape[1]
    assert found_neighbours(taxels) == lattice_neighbours(*shape)


def clipped_area(corners):
    """Return the area of the part of a polygon (k, 2) with x > 0 (Sutherland and Hodgman)."""
    kept = []
    for a, b in zip(np.roll(corners, 1, axis=0), corners):
        if (a[0] > 0) != (b[0] > 0):
            kept.append(a + a[0] / (a[0] - b[0]) * (b - a))
        if b[0] > 0:
            kept.append(b)
    x, y = np.array(kept).T
    return abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2


@pytest.mark.parametrize(("x", "slope"), [(0.0023, 0.0), (0.004, 0.3), (0.006, 1.0), (0.0001, 0.7)])
def test_cells_end_at_the_rim(x, slope):
    """Corners beyond a straight rim: areas and outlines are those of the clipped squares, and overhangs are stated."""
    along = np.array((1, slope)) / np.hypot(1, slope)
    axes = np.stack((along, (-along[1], along[0])))
    sheet = wrap_sheet(plane_surface(0.1, 0.08), SheetLattice(4, 4, SQUARE), (x, 0.02, 0), (1, slope, 0), trim=True)
    taxels = sheet_taxels(sheet, "s")
    centres = (x, 0.02) + 0.01 * taxels.index[:, ::-1] @ axes
    squares = centres[:, None] + 0.005 * np.array(((-1, -1), (1, -1), (1, 1), (-1, 1))) @ axes
    expected = np.array([clipped_area(square) for square in squares])
    assert_allclose(taxels.areas, expected, rtol=1e-5)
    assert_allclose(fan_areas(taxels.positions_link, taxels.corners_link), expected, rtol=1e-5)
    least = np.maximum(-squares[..., 0].min(axis=1), 0)
    overhang = taxels.quality["overhang"]
    assert ((overhang > 0) == (least > 0)).all() and (overhang >= least - 1e-7).all()
    assert (overhang <= np.sqrt(2) * least + 1e-7).all()


def test_cells_across_a_seam_do_not_protrude():
    """Around a tube the parameters jump at the seam, and nothing ends there."""
    assert "overhang" not in wrapped(cone_surface(RADIUS, RADIUS), (6, 22)).quality
