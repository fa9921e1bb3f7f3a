"""The lines of the control points, for every kind of grid."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.geometry import (
    AcrossGrid,
    AutoGrid,
    Axis,
    CoverSpec,
    Cut,
    Planes,
    PlanesGrid,
    SectorGrid,
    TubeGrid,
    cut_cover,
    fit_surface,
    weld,
)
from skin_calib_addon.geometry.sampling.frames import link_direction
from tests.examples import examples
from tests.shapes import (
    LENGTH,
    Z_AXIS,
    Motion,
    box,
    cone,
    cylinder,
    dome,
    even_spans,
    keep,
    sheet,
    u_planes,
    v_planes,
    wrist,
)

seeds = st.integers(0, 2**32 - 1)
SPAN = (0.02, 0.08)


def author_planes(count=8, lines=8, tilts=0.0):
    """A closed grid of planes one by one."""
    return PlanesGrid(u_planes(np.linspace(*SPAN, count), tilts), v_planes(lines), True)


def flat_planes(n=5, m=4):
    """An open grid across the sheet of tests.shapes."""
    u, v = np.linspace(0.01, 0.09, n), np.linspace(0.01, 0.07, m)
    return PlanesGrid(
        Planes(u[:, None] * (1.0, 0, 0), np.tile((1.0, 0, 0), (n, 1))),
        Planes(v[:, None] * (0, 1.0, 0), np.tile((0, 1.0, 0), (m, 1))),
        False,
    )


def rolls(surface, count):
    """The net without its repeated columns, from each of its lines on: a closed net may start anywhere."""
    return [np.roll(surface.control_net[:, :count], k, axis=1) for k in range(count)]


GRIDS = [
    pytest.param(cylinder(), TubeGrid(6, 9), id="tube"),
    pytest.param(wrist(), TubeGrid(6, 9, margin=0.01), id="wrist"),
    pytest.param(wrist(), TubeGrid(6, 9, Z_AXIS), id="tube about an axis"),
    pytest.param(cylinder(), SectorGrid(6, 9, -1.0, 2.0, Z_AXIS), id="sector"),
    pytest.param(dome(), AcrossGrid(6, 9, (0.1, 0, 1.0)), id="across"),
    pytest.param(cylinder(), author_planes(), id="planes"),
    pytest.param(cone(), author_planes(tilts=np.linspace(-0.3, 0.3, 8)), id="fanned planes"),
    pytest.param(dome(), flat_planes(), id="open planes"),
]


@pytest.mark.parametrize(("mesh", "grid"), GRIDS)
def test_lines_lie_in_their_u_planes(mesh, grid):
    """Every line of a row lies in that row's plane, and its direction is a unit vector."""
    lines = grid.line_grid(mesh)
    points, normals = lines.planes_u.points[:, None], lines.planes_u.normals[:, None]
    assert np.abs(((lines.origins - points) * normals).sum(axis=2)).max() < 1e-13
    assert np.abs((lines.directions * normals).sum(axis=2)).max() < 1e-13
    assert_allclose(np.linalg.norm(lines.directions, axis=2), 1, rtol=1e-13)
    assert lines.origins.shape[:2] == (len(lines.planes_u), len(lines.v_names))


@pytest.mark.parametrize(("mesh", "grid"), GRIDS)
def test_lines_run_so_that_the_surface_looks_outward(mesh, grid):
    """(next row) x (next line) points along the lines, out of the robot, everywhere in the grid."""
    lines = grid.line_grid(mesh)
    limit = lines.origins + 0.3 * mesh.size * lines.directions  # before fanned planes meet
    after = np.roll(limit, -1, axis=1) if lines.closed else limit[:, 1:]
    here = limit if lines.closed else limit[:, :-1]
    outward = np.cross(limit[1:, : here.shape[1]] - here[:-1], (after - here)[:-1])
    turn = (outward * lines.directions[:-1, : here.shape[1]]).sum(axis=2)
    assert (turn > 0).all()


MOVED = [p for p in GRIDS if not p.id.endswith("planes")]


@pytest.mark.parametrize(("mesh", "grid"), MOVED)
def test_moved_lines_keep_their_axis_and_their_fractions(mesh, grid):
    """On the same mesh they stay; on a cut one they go from its first to its last section, about the same axis."""
    lines = grid.line_grid(mesh)
    again = grid.moved_lines(lines, mesh)
    assert_allclose(again.origins, lines.origins, atol=1e-15)
    assert_allclose(again.directions, lines.directions, atol=1e-15)
    along = lines.planes_u.normals[0]
    height = mesh.vertices @ along
    cut = Cut(tuple(along * (0.75 * height.min() + 0.25 * height.max())), tuple(along))
    cover = cut_cover(mesh, CoverSpec("all", (cut,)))
    moved = grid.moved_lines(lines, cover)
    assert_allclose(moved.planes_u.normals, lines.planes_u.normals, atol=1e-15)
    assert_allclose(moved.t, lines.t, atol=3e-4)  # without a margin, that of a face follows its length
    before, after = ((k.planes_u.points - k.planes_u.points[0]) @ along for k in (lines, moved))
    assert_allclose(after / after[-1], before / before[-1], atol=1e-12)
    expected = grid.region.moved(lines.parametrization, cover).span
    assert_allclose((moved.s[0], moved.s[-1]), expected, atol=1e-15)
    assert expected[0] - lines.s[0] > 0.15 * np.ptp(lines.s) and abs(expected[1] - lines.s[-1]) < 1e-3


@examples(15)
@given(n=st.integers(4, 12), lines=st.integers(4, 30), turn=st.integers(0, 2**32 - 1))
def test_tube_lines_leave_the_axis_square(n, lines, turn):
    """Origins on the author's axis between the margins, directions at right angles to it, all angles different."""
    motion = Motion(turn)
    axis, mesh = motion.axis(Z_AXIS), motion.mesh(cylinder(around=24, along=12))
    grid = TubeGrid(n, lines, axis, margin=0.005).line_grid(mesh)
    along = np.array(axis.direction)
    stations = (grid.origins - axis.point) @ along
    assert np.linalg.norm(grid.origins - axis.point - stations[..., None] * along, axis=2).max() < 1e-13
    assert_allclose(stations[[0, -1]], np.tile([[0.005], [LENGTH - 0.005]], lines), rtol=0, atol=1e-13)
    assert (np.diff(stations, axis=0) > 0).all()
    assert np.abs(grid.directions @ along).max() < 1e-13
    cosines = grid.directions[0] @ grid.directions[0].T - 2 * np.eye(lines)
    assert cosines.max() < np.cos(0.05 * 2 * np.pi / lines)
    assert grid.closed and len(grid.v_names) == lines


@examples(15)
@given(start=st.floats(-3, 3), width=st.floats(0.5, 6))
def test_sector_runs_between_its_angles(start, width):
    """Angles from the side of the link's x axis; the first line of the grid is the last of the sector, clockwise."""
    stop = start + width
    grid = SectorGrid(5, 8, start, stop, Z_AXIS, 0.01).line_grid(cylinder())
    angle = np.unwrap(np.arctan2(grid.directions[0, :, 1], grid.directions[0, :, 0]))
    assert (np.diff(angle) < 0).all() and not grid.closed
    assert_allclose(angle[[0, -1]] - angle[0], (0, -width), rtol=0, atol=1e-12)
    assert_allclose(np.exp(1j * angle[0]), np.exp(1j * stop), rtol=0, atol=1e-12)


def test_sector_of_a_tube_along_x_counts_from_y():
    """Where the link's x axis is the tube's own, its y axis sets the angle."""
    motion = cylinder().vertices[:, [2, 0, 1]]
    lying = type(cylinder())(motion, cylinder().faces)
    grid = SectorGrid(5, 8, 0.0, 1.0, Axis((0, 0, 0), (1, 0, 0)), 0.01).line_grid(lying)
    assert_allclose(grid.directions[0, -1], (0, 1, 0), rtol=0, atol=1e-12)
    nearly = SectorGrid(5, 8, 0.0, 1.0, Axis((0.05, 0, 0), (1, 0.1, 0.2)), 0.03).line_grid(lying)
    assert nearly.directions[0, -1] @ (0, 1, 0) > 0.99


@pytest.mark.parametrize(("start", "stop"), [(1.0, 1.0), (1.0, 0.0), (0.0, 6.2832), (0.0, 7.0)])
def test_sector_without_angle_is_refused(start, stop):
    """Nothing, backwards, all round or more."""
    with pytest.raises(InvalidPlan, match=r"The sector from .* to .* rad must span more than 0 and less than 2 pi"):
        SectorGrid(5, 8, start, stop, Z_AXIS).line_grid(cylinder())


def test_across_lies_over_the_face_that_looks_along_the_normal():
    """Lines along the normal, between the margins of the seen face, u along its longer side."""
    block = box((0, 0, 0), (0.1, 0.25, 0.05))
    grid = AcrossGrid(6, 4, (0, 0, -2.0), margin=0.01).line_grid(block)
    assert (grid.directions == (0, 0, -1)).all()
    assert_allclose(sorted({*np.round(grid.origins[..., 1], 12).flat}), even_spans(0.01, 0.24, 6), rtol=1e-9)
    assert_allclose(sorted({*np.round(grid.origins[..., 0], 12).flat}), even_spans(0.01, 0.09, 4), rtol=1e-9)
    assert (grid.origins[..., 2] > 0.05).all()  # they start on the other side of the face, and go through the mesh
    turned = AcrossGrid(6, 4, (0, 0, -2.0), along=(1, 0, 0.3), margin=0.01).line_grid(block)
    assert_allclose(turned.origins[:, 0, 0], even_spans(0.01, 0.09, 6), rtol=1e-12)


@examples(10)
@given(seed=seeds)
@pytest.mark.parametrize("size", [(0.1, 0.1), (0.104, 0.1)])
@pytest.mark.parametrize("cut", [0.005, 0.02])
def test_across_is_along_a_side_of_a_nearly_square_face(seed, size, cut):
    """A missing corner does not turn the axis; it does not depend on the link frame."""
    face = keep(sheet(lambda x, y: 0 * x, size, (40, 40)), lambda c: c[:, 0] + c[:, 1] < sum(size) - cut)
    motion = Motion(seed)
    grid = AcrossGrid(6, 4, tuple(motion.directions((0, 0, 1)))).line_grid(motion.mesh(face))
    along = np.abs((grid.origins[-1, 0] - grid.origins[0, 0]) @ motion.rotation)
    expected = (1, 0, 0) if size[0] > size[1] else (along[0] > along[1], along[1] >= along[0], 0)
    assert_allclose(along / np.linalg.norm(along), expected, rtol=0, atol=0.01)


@pytest.mark.parametrize("turn", [0.0, 0.3, 0.7])
def test_across_is_along_the_link_frame_on_a_round_face(turn):
    """Corners of a polygon do not decide."""
    angles = turn + np.arange(32) * np.pi / 16
    rim = np.column_stack((0.05 * np.cos(angles), 0.05 * np.sin(angles), 0 * angles))
    faces = [(0, 1 + k, 1 + (k + 1) % 32) for k in range(32)]
    grid = AcrossGrid(6, 4, (0, 0, 1)).line_grid(weld(np.vstack((np.zeros(3), rim)), faces))
    along = grid.origins[-1, 0] - grid.origins[0, 0]
    assert_allclose(along / np.linalg.norm(along), link_direction(np.array((0, 0, 1.0))), rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        (AcrossGrid(6, 4, (0, 0, -1.0)), r"No mesh face has the outward normal \[0, 0, -1\.0\]\. Reverse"),
        (AcrossGrid(6, 4, (0, 0, 1.0), margin=0.04), "Margin 40 mm leaves nothing of the face"),
        (
            AcrossGrid(6, 4, (0, 0, 1.0), along=(0, 0.01, 3.0)),
            r"The axis .* is parallel to the outward normal\. Choose one in the face",
        ),
    ],
)
def test_across_refuses_what_shows_no_face(grid, message):
    """A normal that no face looks along, a margin that eats the face, an axis that stands upright on it."""
    with pytest.raises(InvalidPlan, match=message):
        grid.line_grid(dome())


@given(seed=seeds, tilted=st.booleans())
def test_author_planes_are_kept(seed, tilted):
    """Each line lies in its u-plane and in a v-plane; each v-plane gives two lines that run apart."""
    rng = np.random.default_rng(seed)
    tilts = np.linspace(-0.3, 0.3, 6) if tilted else 0.0
    grid = PlanesGrid(u_planes(np.linspace(*SPAN, 6), tilts), v_planes(5, rng.uniform(0, 3)), True)
    lines = grid.line_grid(cylinder())
    assert lines.closed and lines.origins.shape == (6, 10, 3)
    on = np.abs(lines.directions @ grid.v.normals.T) < 1e-12
    assert (on.sum(axis=2) == 1).all() and (on[0].sum(axis=0) == 2).all()
    assert (on == on[0]).all()
    names = [f"v-plane {k}" for k in on[0].argmax(axis=1)]
    assert list(lines.v_names) == names
    for k in range(5):
        a, b = np.flatnonzero(on[0, :, k])
        assert_allclose(lines.directions[:, a], -lines.directions[:, b], rtol=0, atol=1e-12)


@given(seed=seeds)
def test_author_planes_may_be_named_by_any_of_their_points(seed):
    """Other points in the same planes, normals turned round, v-planes in another order: the same surface."""
    rng = np.random.default_rng(seed)
    grid = PlanesGrid(u_planes(np.linspace(*SPAN, 8), np.linspace(-0.2, 0.2, 8)), v_planes(8, 0.1), True)

    def renamed(planes, flip):
        aside = rng.uniform(-0.2, 0.2, (len(planes), 3))
        aside -= (aside * planes.normals).sum(axis=1, keepdims=True) * planes.normals
        return planes.points + aside, planes.normals * np.where(flip, rng.choice((-1, 1), (len(planes), 1)), 1)

    order = rng.permutation(len(grid.v))
    other = PlanesGrid(
        Planes(*renamed(grid.u, False)), Planes(*(array[order] for array in renamed(grid.v, True))), True
    )
    surface, again = (fit_surface(cone(around=24, along=12), g).surface for g in (grid, other))
    assert min(np.abs(net - rolls(surface, 16)[0]).max() for net in rolls(again, 16)) < 1e-9


@given(seed=seeds, down=st.booleans())
def test_open_planes_look_out_of_the_mesh(seed, down):
    """Rays start behind the mesh and leave it on the outer side of its faces, in any position."""
    motion, mesh, grid = Motion(seed), dome(), flat_planes()
    if down:
        mesh = type(mesh)(mesh.vertices, mesh.faces[:, ::-1])
    planes = [Planes(motion.points(p.points), motion.directions(p.normals)) for p in (grid.u, grid.v)]
    lines = PlanesGrid(*planes, False).line_grid(motion.mesh(mesh))
    assert_allclose(lines.directions @ motion.directions((0, 0, -1 if down else 1)), 1, rtol=1e-12)
    heights = motion.directions(np.eye(3)) @ (lines.origins - motion.shift).reshape(-1, 3).T
    assert (heights[2] > 0.02).all() if down else (heights[2] < 0).all()


def test_planes_that_hardly_cross_are_refused():
    """Two planes less than three degrees from parallel: which, and how far."""
    v = Planes(np.zeros((3, 3)), np.array(((1.0, 0, 0), (0, 1.0, 0), (0.03, 0, 1.0))))
    with pytest.raises(InvalidPlan, match=r"angle between u-plane 0 and v-plane 2 is only 1\.7 degrees"):
        PlanesGrid(u_planes(np.linspace(*SPAN, 4)), v, True).line_grid(cylinder())


def test_closed_planes_need_two_sides():
    """One v-plane cuts a tube into two halves, which is no grid."""
    with pytest.raises(InvalidPlan, match="A closed grid needs at least two v-planes"):
        PlanesGrid(u_planes(np.linspace(*SPAN, 4)), v_planes(1), True).line_grid(cylinder())


def test_open_planes_over_a_whole_tube_are_refused():
    """Its faces point to both sides: the grid does not guess which side is meant."""
    grid = flat_planes()
    with pytest.raises(InvalidPlan, match="The mesh has faces on both sides of the planes\\. Cut it"):
        grid.line_grid(box((0, 0, 0), (0.1, 0.08, 0.05)))


@pytest.mark.parametrize(
    ("u", "v", "message"),
    [
        (u_planes([0.02, 0.04, 0.04, 0.06, 0.08]), v_planes(5), "u-plane 2 .* u-plane 1"),
        (u_planes([0.05] * 5), v_planes(5), "u-plane 1 .* u-plane 0"),
        (u_planes(np.linspace(*SPAN, 5)), Planes(np.zeros((5, 3)), v_planes(5).normals[[0, 1, 2, 1, 4]]), "v-plane 3"),
    ],
)
def test_closed_planes_that_do_not_follow_each_other_are_refused(u, v, message):
    """The same plane twice: the surface would fold; the message names the two."""
    with pytest.raises(InvalidPlan, match=message):
        PlanesGrid(u, v, True).line_grid(cylinder())


@pytest.mark.parametrize("side", ["u", "v"])
def test_open_planes_that_do_not_follow_each_other_are_refused(side):
    """The same for the planes across a sole, in both directions."""
    grid = flat_planes(4, 4)
    planes = {"u": grid.u, "v": grid.v}
    planes[side] = planes[side].at([0, 1, 1, 3])
    with pytest.raises(InvalidPlan, match=f"{side}-plane 2 .* {side}-plane 1"):
        PlanesGrid(**planes, closed=False).line_grid(dome())


@pytest.mark.parametrize("closed", [True, False])
@given(seed=seeds)
def test_planes_may_be_placed_in_any_order(closed, seed):
    """The surface is the same, seen from either end, and messages name the planes by their places in the lists."""
    rng = np.random.default_rng(seed)
    mesh = cone(around=24, along=12) if closed else dome()
    grid = PlanesGrid(u_planes(np.linspace(*SPAN, 8)), v_planes(8), True) if closed else flat_planes(5, 6)
    orders = [rng.permutation(len(planes)) for planes in (grid.u, grid.v)]
    shuffled = PlanesGrid(*(planes.at(order) for planes, order in zip((grid.u, grid.v), orders)), closed)
    lines, again = grid.line_grid(mesh), shuffled.line_grid(mesh)
    named = [again.u_names.index(f"u-plane {list(orders[0]).index(i)}") for i in range(len(grid.u))]
    assert named in (list(range(len(named))), list(range(len(named)))[::-1])
    places = {tuple(row) for row in np.round(again.origins + again.directions, 9).reshape(-1, 3).tolist()}
    assert places == {tuple(row) for row in np.round(lines.origins + lines.directions, 9).reshape(-1, 3).tolist()}
    if not closed:
        order = [int(name.split()[1]) for name in again.v_names]
        assert (np.diff(orders[1][order]) == np.sign(np.diff(orders[1][order])[0])).all()


def test_grid_with_a_tolerance_has_no_lines_of_its_own():
    """The numbers of planes and lines come from fits; the message names the function that makes them."""
    with pytest.raises(InvalidPlan, match="has a tolerance instead of numbers of planes and lines. Use fit_grid"):
        AutoGrid(1e-4).line_grid(cylinder())


def test_grids_of_planes_are_equal_where_they_were_given_the_same():
    """Points, normals with their lengths, and whether the grid is closed; normals themselves have length one."""
    grid = flat_planes()
    longer = Planes(grid.u.points, 2 * grid.u.normals)
    assert grid == flat_planes() and grid != "planes"
    assert (longer.normals == grid.u.normals).all() and (longer.directions == 2 * grid.u.normals).all()
    assert grid != PlanesGrid(longer, grid.v, False)
    assert grid != PlanesGrid(grid.u, grid.v, True)
    assert grid != PlanesGrid(grid.u, Planes(grid.v.points + 0.001, grid.v.normals), False)
