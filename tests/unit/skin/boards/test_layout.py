"""Choice of boards on a surface: as many as fit, all at a given position, or those of the author."""

import pathlib

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

from skin_calib_addon.common.errors import InvalidPlan, OutsideSurface, millimetres
from skin_calib_addon.geometry import AcrossGrid, TubeGrid, cut_cover, fit_grid, fit_surface, load_mesh
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh
from skin_calib_addon.plan import load_plan
from skin_calib_addon.skin import HexLattice, Zone, lay_boards
from skin_calib_addon.skin.boards.ground import MAX_GAP
from skin_calib_addon.skin.lattice import GAP, SIDE
from tests.examples import slow
from tests.shapes import Z_AXIS, cone_surface, cylinder, keep, plane_surface, sheet, with_hole, wrist_surface

SAMPLES = pathlib.Path(__file__).resolve().parents[4] / "sample_scenes"
SMALL, TIGHT, TUM = HexLattice(0.006, 0.0), HexLattice(0.0163, 0.0), HexLattice(SIDE, GAP)
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


def test_boards_without_a_gap_fit_on_a_dome():
    """No development of a dome is exact, so that neighbours overlap a little: the lattice is stretched, and few boards
    are left out.
    """
    mesh, lattice = sheet(lambda x, y: 0.02 - 4 * ((x - 0.05) ** 2 + (y - 0.04) ** 2)), HexLattice(0.003, 0.0)
    surface = fit_surface(mesh, AcrossGrid(8, 8, (0, 0, 1), (1, 0, 0))).surface
    flat, _ = lay_boards(FLOOR, lattice, "all", None, (1, 0, 0))
    boards, _ = lay_boards(surface, lattice, "all", None, (1, 0, 0))
    assert len(boards.cells) > 0.9 * len(flat.cells)
    assert not len(boards.overlaps()[0])


def test_boards_avoid_holes_edges_and_zones():
    """No outline is above a notch, a hole or an excluded zone of a plate, nor where a zone overlaps a hole."""
    mesh = sheet(lambda x, y: 0 * x, cells=(50, 40))
    mesh = with_hole(keep(mesh, lambda c: (c[:, 0] < 0.07) | (c[:, 1] < 0.05)), (0.03, 0.03, 0), 0.008)
    fit, zones = flat_fit(mesh), (Zone((0.08, 0.02, 0.001), 0.007), Zone((0.036, 0.03, 0), 0.008))
    for choice in ("fill", "all"):
        boards, _ = lay_boards(fit.surface, SMALL, choice, None, (1, 0, 0), fit=fit, excluded=zones)
        outlines = corners(boards, SMALL)
        fraction = np.linspace(0, 1, 20)[:, None, None, None]
        points = (outlines + fraction * (np.roll(outlines, -1, axis=1) - outlines)).reshape(-1, 2)
        assert not ((points[:, 0] > 0.0705) & (points[:, 1] > 0.0505)).any()
        for centre, radius in (((0.03, 0.03), 0.006), ((0.08, 0.02), 0.007 - 1e-6), ((0.036, 0.03), 0.008 - 1e-6)):
            assert np.linalg.norm(points - centre, axis=1).min() > radius
            assert np.linalg.norm(outlines.mean(axis=1) - centre, axis=1).min() > radius
    bare, _ = lay_boards(fit.surface, SMALL, "all", None, (1, 0, 0), fit=fit)
    assert set(map(tuple, boards.cells.tolist())) < set(map(tuple, bare.cells.tolist()))


def test_zone_beyond_the_edge_adds_no_area():
    """A zone across the rim removes boards; its part outside adds none."""
    zone = Zone((0.1, 0.04, 0), 0.015)
    boards, _ = lay_boards(FLOOR, SMALL, "all", (0.05, 0.04, 0), (1, 0, 0), excluded=(zone,))
    found = corners(boards, SMALL)
    assert (found < np.array((0.1, 0.08)) + 1e-9).all()
    assert np.linalg.norm(found.reshape(-1, 2) - (0.1, 0.04), axis=1).min() > 0.015


@pytest.mark.parametrize(
    ("point", "radius"), [slow((0.015, 0, 0.07), 0.025), ((0.015, 0, 0.07), 0.034), slow((0.002, 0, 0.07), 0.03)]
)
def test_zone_of_a_tube_goes_around_it(point, radius):
    """No board is nearer to the point than the radius, beyond a quarter turn and where the point is inside the tube."""
    fit = fit_surface(cylinder(0.015, 0.14), TubeGrid(8, 12, Z_AXIS, margin=1e-3))
    boards, _ = lay_boards(
        fit.surface, HexLattice(0.004, 0.0), "all", None, None, fit=fit, excluded=(Zone(point, radius),)
    )
    assert len(boards.cells) > 40
    assert np.linalg.norm(boards.corners() - point, axis=2).min() > radius - 1e-4


@pytest.mark.parametrize(("radius", "around"), [(0.0366, 8), slow(0.04, 9), slow(0.05, 11), slow(0.06, 13)])
@pytest.mark.parametrize("choice", ["all", "fill"])
def test_rows_close_around_a_tube(radius, around, choice):
    """With rows around it, a tube has five closed rings: boards of width w on its tangent planes touch at an angle of
    2 atan(w / 2 R). No ring has a seam, and no two boards overlap.
    """
    assert around == int(np.pi / np.arctan(np.sqrt(0.75) * 0.0163 / radius))
    fit = fit_surface(cylinder(radius, 0.15, 96, 26), TubeGrid(8, 24, Z_AXIS, margin=1e-3))
    boards, overhang = lay_boards(fit.surface, TIGHT, choice, (radius, 0, 0.075), (0, 1, 0), fit=fit)
    assert len(boards.cells) >= 5 * around and not overhang.any()
    assert_no_overlap(boards)
    if choice == "all":
        points = fit.surface.points(boards.uv)
        _, counts = np.unique(points[:, 2].round(4), return_counts=True)
        assert counts.tolist() == [around] * 5


def assert_no_overlap(boards, depth=1e-3):
    """Assert that the shadows of boards on the plane between two of them are apart, edge by edge."""
    normals, points = boards.surface.normals(boards.uv), boards.surface.points(boards.uv)
    axes = np.stack((boards.tangents, np.cross(normals, boards.tangents)), axis=1)
    outlines = points[:, None] + boards.lattice.corners @ axes
    for i, j in cKDTree(points).query_pairs(2 * boards.lattice.side):
        view = normals[i] + normals[j]
        plane = np.linalg.svd(view[None])[2][1:]
        first, second = outlines[i] @ plane.T, outlines[j] @ plane.T
        edges = np.concatenate([np.roll(outline, -1, axis=0) - outline for outline in (first, second)])
        across = np.column_stack((-edges[:, 1], edges[:, 0])) / np.linalg.norm(edges, axis=1)[:, None]
        one, other = first @ across.T, second @ across.T
        gaps = np.maximum(other.min(axis=0) - one.max(axis=0), one.min(axis=0) - other.max(axis=0))
        assert gaps.max() > -1.1 * depth * boards.lattice.side


@pytest.mark.slow
@pytest.mark.parametrize("offset", [0.0, 0.001])
@pytest.mark.parametrize("choice", ["all", "fill"])
def test_boards_on_a_doubly_curved_surface_do_not_overlap(choice, offset):
    """A flat lattice overlaps itself there; boards move apart or are left out, thick ones too."""
    boards, _ = lay_boards(wrist_surface(), HexLattice(0.008, 0.0), choice, None, (0, 1, 0), offset=offset)
    assert len(boards.cells) > 60
    assert_no_overlap(boards)
    assert boards.overlaps()[0].size == 0


def test_boards_that_overlap_are_an_error():
    """Around a tube, the board after a whole turn is on the first one. The message names both, and the depth."""
    surface = cone_surface(0.04, 0.04, 0.1)
    lay_boards(surface, TIGHT, [(q, 0) for q in range(-4, 5)], (0.04, 0, 0.05), (0, 1, 0))
    with pytest.raises(
        InvalidPlan,
        match=r"boards \[-4, 0\] and \[5, 0\] overlap by \d+\.\d\d mm at \(.*\) mm, the worst of 1 pairs; leave one",
    ) as error:
        lay_boards(surface, TIGHT, [(q, 0) for q in range(-4, 6)], (0.04, 0, 0.05), (0, 1, 0))
    assert millimetres(error.value.numbers["place"].point) in str(error.value)


def test_boards_are_on_the_mesh():
    """A step of 3 mm and a groove: each centre is within a millimetre of the mesh, and 15 degrees of its faces. Corners
    are within the stated distance.
    """

    def height(x, y):
        return 0.003 * (x > 0.06) - 0.004 * (np.abs(y - 0.03) < 0.002)

    mesh = sheet(height, cells=(100, 80))
    fit = fit_surface(mesh, AcrossGrid(12, 12, (0, 0, 1), (1, 0, 0)))
    boards, _ = lay_boards(fit.surface, SMALL, "fill", None, (1, 0, 0), fit=fit)
    points, normals = fit.surface.points(boards.uv), fit.surface.normals(boards.uv)
    distances, faces, _ = closest(mesh, points)
    assert distances.max() <= 1e-3
    assert (mesh.face_normals[faces] * normals).sum(axis=1).min() >= np.cos(np.deg2rad(15))
    assert closest(mesh, boards.corners().reshape(-1, 3))[0].max() <= MAX_GAP * SMALL.side
    assert fit.is_trusted(boards.uv).all() and len(points) > 5


@pytest.mark.parametrize(("radius", "most"), [(0.036, 3e-3), (0.03, MAX_GAP * TUM.side)])
def test_boards_whose_corners_need_a_warning_are_taken_only_where_there_are_no_others(radius, most):
    """Around 72 mm rows along the tube keep the corners within 3 mm; around 60 mm no pose does."""
    fit = fit_surface(cylinder(radius, 0.09), TubeGrid(8, 16))
    boards, _ = lay_boards(fit.surface, TUM, "fill", None, None, fit=fit)
    gaps = radius - np.linalg.norm(boards.corners()[..., :2], axis=2)
    assert np.abs(gaps).max() <= most and (np.abs(gaps).max() > 3e-3) == (most > 3e-3)
    assert len(boards.cells) > 15
    root = int(np.flatnonzero((boards.cells == 0).all(axis=1))[0])
    origin, direction = fit.surface.points(boards.uv[[root]])[0], boards.tangents[root]
    again, _ = lay_boards(fit.surface, TUM, boards.cells, origin, direction, fit=fit)
    assert_allclose(fit.surface.points(again.uv), fit.surface.points(boards.uv), rtol=0, atol=1e-6)


def test_no_board_is_over_a_vertex_that_the_fit_leaves_out():
    """It may be noise, or a screw: the boards around it are within 1 mm and 15 degrees of the mesh as it is given."""
    mesh, lattice = sheet(lambda x, y: 0 * x), HexLattice(0.004, 0.0)
    vertices = mesh.vertices.copy()
    highest = int(np.linalg.norm(vertices - vertices.mean(axis=0), axis=1).argmin())
    vertices[highest, 2] += 0.004
    fit = flat_fit(TriangleMesh(vertices, mesh.faces))
    assert [warning.code for warning in fit.outliers] == ["outlier-vertices"]
    boards, _ = lay_boards(fit.surface, lattice, "all", mesh.vertices[highest], (1, 0, 0), fit=fit)
    distances, faces, _ = closest(fit.given_mesh, fit.surface.points(boards.uv))
    assert len(boards.cells) > 100 and distances.max() < 1e-3
    assert fit.given_mesh.face_normals[faces][:, 2].min() > np.cos(np.deg2rad(15))
    assert not (boards.cells == 0).all(axis=1).any()


def test_given_boards_are_placed_and_their_overhang_returned():
    """The named boards are placed in their order; the overhang of one beyond the rim is returned."""
    cells = ((0, 0), (3, 0), (4, 0))
    boards, overhang = lay_boards(FLOOR, SMALL, cells, (0.05, 0.04, 0), (1, 0, 0))
    assert boards.cells.tolist() == [[0, 0], [3, 0], [4, 0]]
    protrusion = 0.05 + 4 * SMALL.pitch + SMALL.pitch / 2 - 0.1  # of its flat side
    assert_allclose(overhang, (0, 0, max(protrusion, 0)), rtol=0, atol=1e-9)
    with pytest.raises(
        OutsideSurface, match=r"board \[9, 0\] lies \d+\.\d mm beyond the edge u = 1 of the surface, the first of 1"
    ) as error:
        lay_boards(FLOOR, SMALL, ((0, 0), (9, 0)), (0.05, 0.04, 0), (1, 0, 0))
    assert_allclose(error.value.numbers["place"].point, (0.1, 0.04, 0), rtol=0, atol=1e-9)  # on the edge


def test_no_board_fits():
    """The message for boards wider than the length of a tube is clear, and has its perimeter."""
    words = r"no board with sides of 40 mm fits completely in the region, which is 37\d\.\d x 50\.\d mm over all"
    with pytest.raises(InvalidPlan, match=words + ".* its corners within 12 mm"):
        lay_boards(cone_surface(0.06, 0.06, 0.05), HexLattice(0.04, 0.0), "fill", None, (0, 1, 0))


@pytest.fixture(scope="module")
def sole():
    """Return the fit of the sample sole."""
    plan = load_plan(SAMPLES / "sole.plan.json")
    cover = cut_cover(load_mesh(plan.mesh, plan.unit), plan.surface.cover)
    return fit_grid(cover, plan.surface.grid, plan.surface.degree)


@pytest.mark.parametrize(("direction", "choice"), [((-0.49, -0.872, 0), "all"), ((1, 1, 0), [(0, 0), (1, 0), (0, 1)])])
def test_row_of_the_root_keeps_its_direction_on_a_wavy_surface(sole, direction, choice):
    """The surface of a sole is an extrapolation outside its outline; it does not change the direction of the row."""
    boards, _ = lay_boards(sole.surface, TIGHT, choice, None, direction, fit=sole)
    vector = boards.tangents[np.flatnonzero(~boards.cells.any(axis=1))[0], :2]
    turned = np.arctan2(vector[1], vector[0]) - np.arctan2(direction[1], direction[0])
    assert abs((turned + np.pi) % (2 * np.pi) - np.pi) < np.deg2rad(0.3)


def test_removed_board_leaves_the_others_in_place_on_a_narrow_sole(sole):
    """Without the middle board two parallel links remain, which shear with no pitch error; the other boards stay."""
    surface, lattice = sole.error_field.surface, HexLattice(0.0163, -0.000482428)
    boards, _ = lay_boards(surface, lattice, "fill", None, None, fit=sole)
    points, cells = surface.points(boards.uv), boards.cells.tolist()
    root, around = cells.index([0, 0]), {(1, 0), (0, 1), (-1, 1), (-1, 0), (0, -1), (1, -1)}
    assert around <= set(map(tuple, cells))
    rest = np.delete(np.arange(len(cells)), root)
    listed = [tuple(cell) for cell in boards.cells[rest].tolist()]
    after, _ = lay_boards(surface, lattice, listed, points[root], boards.tangents[root], fit=sole)
    assert after.cells.tolist() == boards.cells[rest].tolist()
    assert_allclose(surface.points(after.uv), points[rest], atol=1e-5)
