"""Choice of boards on a surface: as many as fit, all at a given position, or those of the author."""

import pathlib

import numpy as np
import pytest
from matplotlib.path import Path
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import InvalidPlan, OutsideSurface
from skin_calib_addon.geometry import AcrossGrid, TubeGrid, cut_cover, fit_grid, fit_surface, load_mesh
from skin_calib_addon.plan import load_plan
from skin_calib_addon.skin import HexLattice, Zone, lay_boards
from skin_calib_addon.skin.boards.fill import fill
from skin_calib_addon.skin.boards.region import Region
from tests.shapes import Z_AXIS, cone_surface, cylinder, keep, plane_surface, sheet, with_hole, wrist_surface

SAMPLES = pathlib.Path(__file__).resolve().parents[4] / "sample_scenes"
SMALL = HexLattice(0.006, 0.0)
FLOOR = plane_surface(0.1, 0.08)


def corners(boards, lattice):
    """Corners of flat boards that face up, shape (n, 6, 2)."""
    axes = np.stack((boards.tangents, np.cross((0, 0, 1), boards.tangents)), axis=1)
    return boards.surface.points(boards.uv)[:, None, :2] + (lattice.corners @ axes)[..., :2]


def flat_fit(mesh):
    """Return a surface on a flat mesh that faces up."""
    return fit_surface(mesh, AcrossGrid(6, 6, (0, 0, 1), (1, 0, 0)))


def test_all_keeps_the_origin_and_the_direction():
    """Exactly the boards that fit are placed on a rectangle, by the corners of a large lattice."""
    origin, turn = np.array((0.047, 0.041)), 0.2
    boards, overhang = lay_boards(FLOOR, SMALL, "all", (*origin, 0), (np.cos(turn), np.sin(turn), 0))
    many = np.array([(q, r) for q in range(-15, 16) for r in range(-15, 16)])
    axes = np.array(((np.cos(turn), np.sin(turn)), (-np.sin(turn), np.cos(turn))))
    places = origin + (SMALL.centres(many)[:, None] + SMALL.corners) @ axes
    fits = ((places > 0) & (places < (0.1, 0.08))).all(axis=(1, 2))
    assert set(map(tuple, boards.cells.tolist())) == set(map(tuple, many[fits].tolist()))
    assert_allclose(overhang, 0)
    assert_allclose(np.sort(corners(boards, SMALL).ravel()), np.sort(places[fits].ravel()), rtol=0, atol=1e-9)


def test_fill_gives_at_least_as_many_boards_as_any_given_pose():
    """Free offset and rotation never give fewer boards than any tested origin and direction; the root is near the
    origin.
    """
    boards, _ = lay_boards(FLOOR, SMALL, "fill", (0.05, 0.04, 0), (1, 0, 0))
    found = corners(boards, SMALL)
    assert (found > -1e-8).all() and (found < np.array((0.1, 0.08)) + 1e-8).all()
    rng = np.random.default_rng(0)
    for _ in range(20):
        turn, origin = rng.uniform(0, np.pi / 3), rng.uniform((0.045, 0.035), (0.055, 0.045))
        tried, _ = lay_boards(FLOOR, SMALL, "all", (*origin, 0), (np.cos(turn), np.sin(turn), 0))
        assert len(tried.cells) <= len(boards.cells)
    away = np.linalg.norm(FLOOR.points(boards.uv)[:, :2] - (0.05, 0.04), axis=1)
    assert boards.cells[away.argmin()].tolist() == [0, 0]
    assert (np.lexsort(boards.cells.T) == np.arange(len(boards.cells))).all()  # by r, then q


def test_boards_avoid_holes_edges_and_zones():
    """No outline is above a notch, a hole or an excluded zone of a plate."""
    mesh = sheet(lambda x, y: 0 * x, cells=(50, 40))
    mesh = with_hole(keep(mesh, lambda c: (c[:, 0] < 0.07) | (c[:, 1] < 0.05)), (0.03, 0.03, 0), 0.008)
    fit, screw = flat_fit(mesh), Zone((0.08, 0.02, 0.001), 0.007)
    for choice in ("all", "fill"):
        boards, _ = lay_boards(fit.surface, SMALL, choice, None, (1, 0, 0), fit=fit, excluded=(screw,))
        outlines = corners(boards, SMALL)
        fraction = np.linspace(0, 1, 20)[:, None, None, None]
        points = (outlines + fraction * (np.roll(outlines, -1, axis=1) - outlines)).reshape(-1, 2)
        assert not ((points[:, 0] > 0.0705) & (points[:, 1] > 0.0505)).any()
        for centre, radius in (((0.03, 0.03), 0.006), ((0.08, 0.02), 0.007 - 1e-6)):
            assert np.linalg.norm(points - centre, axis=1).min() > radius
            assert np.linalg.norm(outlines.mean(axis=1) - centre, axis=1).min() > radius
    bare, _ = lay_boards(fit.surface, SMALL, "all", None, (1, 0, 0), fit=fit)
    kept, _ = lay_boards(fit.surface, SMALL, "all", None, (1, 0, 0), fit=fit, excluded=(screw,))
    assert set(map(tuple, kept.cells.tolist())) < set(map(tuple, bare.cells.tolist()))


def test_zone_beyond_the_edge_adds_no_area():
    """A zone across the rim removes boards; its part outside adds none."""
    zone = Zone((0.1, 0.04, 0), 0.015)
    boards, _ = lay_boards(FLOOR, SMALL, "all", (0.05, 0.04, 0), (1, 0, 0), excluded=(zone,))
    found = corners(boards, SMALL)
    assert (found < np.array((0.1, 0.08)) + 1e-9).all()
    assert np.linalg.norm(found.reshape(-1, 2) - (0.1, 0.04), axis=1).min() > 0.015


def test_zone_over_a_hole_does_not_close_it():
    """Holes and zones add up where they overlap: no board is in either."""
    hole = 0.006 * np.array([(np.cos(a), np.sin(a)) for a in np.linspace(0, 2 * np.pi, 40, endpoint=False)]) + 0.03
    plate = np.array(((0, 0), (0.06, 0), (0.06, 0.06), (0, 0.06)))
    zones = tuple(hole + shift for shift in ((0.003, 0.0), (0.0, 0.004), (0.031, 0.0)))
    region = Region((plate, hole), zones)
    points = np.random.default_rng(0).uniform(-0.01, 0.07, (20000, 2))
    free = ((points > 0) & (points < 0.06)).all(axis=1)
    for loop in (hole, *zones):
        free &= ~Path(loop).contains_points(points)
    clear = region.distances(points).min(axis=1) > 1e-4
    assert (region.contains(points) == free)[clear].all()
    assert (region.distances(points[free]).min(axis=1) > 0).all()
    boards = fill(region, HexLattice(0.002, 0.0), np.zeros(2), 0.0)
    for loop in (hole, *zones):
        assert not Path(loop).contains_points(boards.corners.reshape(-1, 2), radius=-1e-9).any()


def test_boards_on_a_tube_end_at_a_seam():
    """Opposite of the root no board overlaps another or is beyond the rims, and the pitch is kept."""
    fit = fit_surface(cylinder(0.05, 0.2, 96, 30), TubeGrid(6, 24, Z_AXIS, margin=1e-3))
    boards, overhang = lay_boards(fit.surface, HexLattice(0.01, 0.0), "all", (0.05, 0, 0.1), (0, 1, 0), fit=fit)
    places = fit.surface.points(boards.uv)
    assert len(places) > 60 and overhang.max() <= 5e-4
    distance = np.linalg.norm(places[:, None] - places, axis=2) + np.eye(len(places))
    assert distance.min() > 0.99 * HexLattice(0.01, 0.0).pitch
    assert places[:, 2].min() > 0.008 and places[:, 2].max() < 0.192


def test_given_boards_are_placed_and_their_overhang_returned():
    """The named boards are placed in their order; the overhang of one beyond the rim is returned."""
    cells = ((0, 0), (3, 0), (4, 0))
    boards, overhang = lay_boards(FLOOR, SMALL, cells, (0.05, 0.04, 0), (1, 0, 0))
    assert boards.cells.tolist() == [[0, 0], [3, 0], [4, 0]]
    protrusion = 0.05 + 4 * SMALL.pitch + SMALL.pitch / 2 - 0.1  # of its flat side
    assert_allclose(overhang, (0, 0, max(protrusion, 0)), rtol=0, atol=1e-9)
    with pytest.raises(OutsideSurface, match=r"board \[9, 0\] lies beyond the edge of the surface, the first of 1"):
        lay_boards(FLOOR, SMALL, ((0, 0), (9, 0)), (0.05, 0.04, 0), (1, 0, 0))


def test_curved_surface_is_filled_within_its_edges():
    """Boards on a doubly curved wrist that protrude by more than half a millimetre are left out."""
    boards, overhang = lay_boards(wrist_surface(), HexLattice(0.008, 0.0), "fill", None, None)
    assert len(boards.cells) > 50 and overhang.max() <= 5e-4


def test_no_board_fits():
    """The message for boards wider than the length of the cone is clear."""
    with pytest.raises(InvalidPlan, match="no board with sides of 40 mm fits completely in the region"):
        lay_boards(cone_surface(0.06, 0.06, 0.05), HexLattice(0.04, 0.0), "fill", None, (0, 1, 0))


@pytest.mark.parametrize("direction", [(1, 1, 0), (-0.49, -0.872, 0), (0.3, -1, 0)])
@pytest.mark.parametrize("choice", ["all", [(0, 0), (1, 0), (0, 1)]])
def test_row_of_the_root_keeps_its_direction_on_a_wavy_surface(direction, choice):
    """The surface of a sole is an extrapolation outside its outline; it does not change the direction of the row."""
    plan = load_plan(SAMPLES / "sole.plan.json")
    cover = cut_cover(load_mesh(plan.mesh, plan.unit), plan.cover)
    fit = fit_grid(cover, plan.grid, plan.degree)
    boards, _ = lay_boards(fit.surface, HexLattice(0.0163, 0.0), choice, None, direction, fit=fit)
    vector = boards.tangents[np.flatnonzero(~boards.cells.any(axis=1))[0], :2]
    turned = np.arctan2(vector[1], vector[0]) - np.arctan2(direction[1], direction[0])
    assert abs((turned + np.pi) % (2 * np.pi) - np.pi) < np.deg2rad(0.3)


def test_removed_board_leaves_the_others_in_place_on_a_narrow_sole():
    """Without the middle board two parallel links remain, which shear with no pitch error; the other boards stay."""
    plan, lattice = load_plan(SAMPLES / "sole.plan.json"), HexLattice(0.0163, -0.000482428)
    fit = fit_grid(cut_cover(load_mesh(plan.mesh, plan.unit), plan.cover), plan.grid, plan.degree)
    surface = fit.error_field.surface
    boards, _ = lay_boards(surface, lattice, "fill", None, None, fit=fit)
    points, cells = surface.points(boards.uv), boards.cells.tolist()
    root, around = cells.index([0, 0]), {(1, 0), (0, 1), (-1, 1), (-1, 0), (0, -1), (1, -1)}
    assert around <= set(map(tuple, cells))
    rest = np.delete(np.arange(len(cells)), root)
    listed = [tuple(cell) for cell in boards.cells[rest].tolist()]
    after, _ = lay_boards(surface, lattice, listed, points[root], boards.tangents[root], fit=fit)
    assert after.cells.tolist() == boards.cells[rest].tolist()
    assert_allclose(surface.points(after.uv), points[rest], atol=1e-5)
