"""Hexagonal boards on surfaces with known pitch, tilt and gaps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.geometry import TubeGrid, fit_surface
from skin_calib_addon.skin import HexLattice, board_taxels, lay_boards
from skin_calib_addon.skin.boards.board_taxels import board_at
from skin_calib_addon.skin.lattice import GAP, PORTS, SIDE
from tests.examples import examples, slow
from tests.shapes import Z_AXIS, cone_surface, cylinder, plane_surface, wrist_surface

TUM = HexLattice(SIDE, GAP)
BLOCK = np.array([(q, r) for r in range(-1, 3) for q in range(-2, 3)])


def placed(surface, cells=BLOCK, lattice=TUM, origin=None, direction=(0, 1, 0), **options):
    """Return the taxels of boards."""
    cells = [tuple(cell) for cell in np.asarray(cells).tolist()]
    return board_taxels(lay_boards(surface, lattice, cells, origin, direction, **options)[0], "b")


def pitches(taxels):
    """Distances along a cylinder about z between boards that are adjacent in the lattice [m]."""
    at = {tuple(cell): i for i, cell in enumerate(taxels.index.tolist())}
    pairs = [(i, at[q + a, r + b]) for (q, r), i in at.items() for a, b in PORTS[:3] if (q + a, r + b) in at]
    points = taxels.positions_link
    angle, radius = np.arctan2(points[:, 1], points[:, 0]), np.hypot(points[:, 0], points[:, 1])
    turns = [(angle[i] - angle[j] + np.pi) % (2 * np.pi) - np.pi for i, j in pairs]
    return np.array([np.hypot(radius[i] * turn, points[i, 2] - points[j, 2]) for (i, j), turn in zip(pairs, turns)])


@examples(10)
@given(heading=st.floats(-np.pi, np.pi), gap=st.floats(-0.001, 0.003))
def test_plane_is_the_identity(heading, gap):
    """Boards and corners keep their flat positions, without tilt, gap or collision."""
    lattice = HexLattice(0.006, gap)
    direction = np.array((np.cos(heading), np.sin(heading), 0))
    turn = np.stack((direction, np.cross((0, 0, 1), direction)))
    taxels = placed(plane_surface(0.2, 0.2), lattice=lattice, origin=(0.1, 0.1, 0), direction=direction)
    assert_allclose(taxels.positions_link, lattice.centres(BLOCK) @ turn + (0.1, 0.1, 0), rtol=0, atol=1e-12)
    expected = (lattice.centres(BLOCK)[:, None] + lattice.corners) @ turn + (0.1, 0.1, 0)
    assert_allclose(taxels.corners_link, expected, rtol=0, atol=1e-12)
    for name in ("gap", "tilt", "pitch_error", "collision"):
        assert_allclose(taxels.quality[name], 0, rtol=0, atol=1e-9)


def chord_error(radius, direction):
    """Return the largest shortening of the pitch by the chords of neighbours [m]."""
    heading = np.arctan2(direction[2], direction[1]) + np.deg2rad((0, 60, 120))
    around, along = TUM.pitch * np.cos(heading), TUM.pitch * np.sin(heading)
    return (TUM.pitch - np.hypot(2 * radius * np.sin(around / 2 / radius), along)).max()


@pytest.mark.parametrize("radius", [0.04, slow(0.06), slow(0.1)])
def test_pitch_is_kept_on_cylinders(radius):
    """The pitch is 27.75 mm along the surface within a tenth of a millimetre, on a fitted mesh, in any direction; the
    error through space is that of the chord.
    """
    surface = fit_surface(cylinder(radius, 0.3, 64, 20), TubeGrid(8, 32, Z_AXIS, margin=1e-4)).surface
    for direction in ((0, 1, 0), (0, 1, 0.5), (0, 0, 1)):
        taxels = placed(surface, origin=(radius, 0, 0.15), direction=direction)
        assert np.abs(pitches(taxels) - 0.02775).max() < 1e-4
        assert_allclose(taxels.quality["pitch_error"].max(), chord_error(radius, direction), rtol=0, atol=1e-5)


def test_tilt_and_gap_on_a_cylinder_are_those_of_tangent_planes():
    """With rows around it, neighbours in a row tilt by the angle of their arc; the gap of corners is that of the
    tangent.
    """
    radius = 0.06
    taxels = placed(cone_surface(radius, radius, 0.3), origin=(radius, 0, 0.15))
    assert_allclose(taxels.quality["tilt"], TUM.pitch / radius, rtol=0, atol=2e-5)
    extent = SIDE * np.cos(np.deg2rad(30))  # of the corners, around the cylinder
    assert_allclose(taxels.quality["gap"], np.hypot(radius, extent) - radius, rtol=1e-3)


def bent(rise):
    """Return a square of 0.2 m with the height ``rise`` (x - 0.1)^2 [m]."""
    flat = plane_surface(0.2, 0.2)
    net = flat.control_net.copy()
    net[..., 2] = rise * (net[..., 0] - 0.1) ** 2
    return type(flat)(net, flat.knots_u, flat.knots_v, (3, 3))


@pytest.mark.parametrize("rise", [2.0, -2.0])
def test_thick_boards_on_a_bend_do_not_collide(rise):
    """In a trough their upper faces would collide, on a ridge the lower ones. They move apart, thick ones more; those
    that cannot move far enough are an error.
    """
    flat = bent(0.0)
    wider = []
    for thickness in (0.0005, 0.002):
        taxels, even = (
            placed(s, origin=(0.1, 0.1, 0), direction=(1, 0, 0), offset=thickness) for s in (bent(rise), flat)
        )
        wider.append(np.ptp(taxels.positions_link[:, 0]) - np.ptp(even.positions_link[:, 0]))
        assert_allclose(taxels.quality["collision"], 0, atol=1e-12)
    assert wider[1] > wider[0]
    with pytest.raises(
        InvalidPlan, match=r"boards \[.*\] and \[.*\] overlap by \d\.\d\d mm at .* the worst of \d+ pairs"
    ):
        placed(bent(rise), origin=(0.1, 0.1, 0), direction=(1, 0, 0), offset=0.02)


@pytest.mark.parametrize("rise", [2.0, -2.0])
def test_gap_is_that_of_the_farthest_corner(rise):
    """In a trough the corners are below the surface, on a ridge above it; those on the middle line touch it."""
    surface, t = bent(rise), np.linspace(0, 1, 2001)
    x, _, z = surface.points(np.column_stack((t, np.full_like(t, 0.5)))).T
    middle, at_corner = np.interp((0.1, 0.1 + SIDE * np.cos(np.pi / 6)), x, z)
    (gap,) = placed(surface, np.array([(0, 0)]), origin=(0.1, 0.1, 0), direction=(1, 0, 0)).quality["gap"]
    assert_allclose(gap, middle - at_corner, rtol=0.01)


def test_board_at_a_point_continues_the_lattice():
    """Each board is found at its centre, and one that does not exist beyond the last one, also for turned rows."""
    taxels = placed(plane_surface(0.2, 0.2), origin=(0.1, 0.1, 0), direction=(1, 0.3, 0))
    for cell, point in zip(taxels.index.tolist(), taxels.positions_link):
        assert board_at(taxels, TUM, point) == (tuple(cell), True)
    e1 = np.array((1, 0.3, 0)) / np.hypot(1, 0.3)
    for cell in ((-5, 1), (1, 4), (-1, -3)):
        x, y = TUM.centres(np.array([cell]))[0]
        assert board_at(taxels, TUM, np.array((0.1, 0.1, 0)) + x * e1 + y * np.cross((0, 0, 1), e1)) == (cell, False)


def test_frames_are_right_handed_and_corners_lie_on_the_tangent_plane():
    """Vectors are unit to 1e-12, the tangent is along the rows, each board is flat and has the size of the lattice."""
    taxels = placed(wrist_surface(), BLOCK[(np.abs(BLOCK) <= 1).all(axis=1)])
    normals, tangents = taxels.normals_link, taxels.tangents_link
    assert np.abs(np.linalg.norm(np.stack((normals, tangents)), axis=2) - 1).max() < 1e-12
    assert np.abs((normals * tangents).sum(axis=1)).max() < 1e-12
    arms = taxels.corners_link - taxels.positions_link[:, None]
    assert np.abs((arms * normals[:, None]).sum(axis=2)).max() < 1e-15
    assert_allclose(np.linalg.norm(arms, axis=2), SIDE, rtol=1e-12)
    assert ((np.cross(arms, np.roll(arms, -1, axis=1)) * normals[:, None]).sum(axis=2) > 0).all()
    at = {tuple(cell): i for i, cell in enumerate(taxels.index.tolist())}
    step = taxels.positions_link[at[1, 0]] - taxels.positions_link[at[0, 0]]
    assert step @ tangents[at[0, 0]] > 0.8 * np.linalg.norm(step)


def test_ports_name_the_board_at_each_side():
    """Ports are the neighbours in the lattice, None without a board; the other board names this one at the opposite
    side.
    """
    taxels = placed(plane_surface(0.2, 0.2), origin=(0.1, 0.1, 0), direction=(1, 0, 0))
    cells = set(map(tuple, BLOCK.tolist()))
    for (q, r), ports, adjacent in zip(taxels.index.tolist(), taxels.ports, taxels.neighbours):
        expected = [f"b.{q + a}.{r + b}" if (q + a, r + b) in cells else None for a, b in PORTS]
        assert list(ports) == expected
        assert set(adjacent) == set(expected) - {None}


@pytest.mark.parametrize(
    "cells", [[(0, 0)], [(0, 0), (1, 0)], [(k, 0) for k in range(4)], [(-2, -1), (2, 2)], [(3, 0)]]
)
def test_few_boards_and_separate_boards_are_placed(cells):
    """One board, a chain and two islands without the root are exact on a plane, and keep the pitch along a cylinder."""
    lattice = HexLattice(0.006, 0.0)
    flat = placed(plane_surface(0.2, 0.2), np.array(cells), lattice, (0.1, 0.1, 0), (1, 0, 0))
    assert_allclose(flat.positions_link[:, :2], lattice.centres(np.array(cells)) + 0.1, rtol=0, atol=1e-12)
    assert_allclose(flat.tangents_link, np.broadcast_to((1, 0, 0), (len(cells), 3)), rtol=0, atol=1e-9)
    round_ = placed(cone_surface(0.04, 0.04), np.array(cells), lattice, (0.04, 0, 0.05), (0, 1, 0.2))
    assert np.abs(pitches(round_) - lattice.pitch).max(initial=0) < 1e-6


def test_offset_raises_the_boards_and_keeps_their_pitch_there():
    """Middle planes 0.2 mm above a cylinder have that distance, and the pitch along it."""
    taxels = placed(cone_surface(0.05, 0.05, 0.3), origin=(0.05, 0, 0.15), offset=0.0002)
    assert_allclose(np.linalg.norm(taxels.positions_link[:, :2], axis=1), 0.0502, rtol=0, atol=1e-6)
    assert np.abs(pitches(taxels) - TUM.pitch).max() < 1e-5


@pytest.mark.parametrize(("side", "gap"), [(0.0, 0.001), (-0.01, 0.1), (0.01, -0.02)])
def test_hexagons_without_area_or_pitch_are_refused(side, gap):
    """A side of zero, or sides longer than the pitch, are refused."""
    with pytest.raises(InvalidPlan, match=r"hexagons with sides of .* have no area or no pitch. Increase the side"):
        HexLattice(side, gap)


def test_listed_board_shifted_from_its_place():
    """Along the rows and to their left, and rotated, on a plane whose rows are rotated; the others stay."""
    turn, origin = 0.3, np.array((0.1, 0.1, 0.0))
    rows = np.array((np.cos(turn), np.sin(turn), 0.0))
    listed = [(0, 0), (2, -1, 0.004, 0.003, 0.1), (-2, 0, 0.0, 0.0, 0.0)]
    boards, _ = lay_boards(plane_surface(0.2, 0.2), TUM, listed, origin, rows)
    first, second, third = boards.points
    x, y = TUM.centres(np.array([(2, -1)]))[0] + (0.004, 0.003)
    assert_allclose(first, origin, atol=1e-9)
    assert_allclose(second, origin + x * rows + y * np.cross((0, 0, 1), rows), atol=1e-9)
    assert_allclose(boards.tangents[1], (np.cos(turn + 0.1), np.sin(turn + 0.1), 0), atol=1e-9)
    assert_allclose(third, origin - 2 * TUM.pitch * rows, atol=1e-9)
    assert boards.shifted.tolist() == [False, True, True]  # one that is shifted by zero stays if others move apart
