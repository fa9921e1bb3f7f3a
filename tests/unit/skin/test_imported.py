"""Taxels of a file on a surface: positions, normals, cells, neighbours and findings."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from skin_calib_addon.calibration.exchange import TaxelSet
from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.skin.imported import (
    MAX_CELL_RADIUS,
    frame_on,
    gabriel,
    imported_taxels,
    median_pitch,
    near_pairs,
    placed,
)
from tests.shapes import RADIUS, Motion, cone_surface, cylinder, plane_surface, sheet, wrist, wrist_surface

PITCH = 0.006


def taxel_set(positions, **fields):
    """Return a set of taxels with labels t0, t1, ... and channels 100, 101, ..."""
    n = len(positions)
    given = {"normals": None, "labels": tuple(f"t{i}" for i in range(n)), "channels": 100 + np.arange(n), "frame": None}
    return TaxelSet(positions=positions, **(given | fields))


def lattice(rows, columns, kind, pitch=PITCH):
    """Return flat points in squares or triangles, from the origin, shape (rows * columns, 2)."""
    i, j = (k.ravel() for k in np.indices((rows, columns)))
    if kind == "square":
        return pitch * np.column_stack((j, i))
    return pitch * np.column_stack((j + 0.5 * (i % 2), np.sqrt(0.75) * i))


def flat(places, height=0.0, corner=(0.02, 0.02)):
    """Return points of a lattice above the plane surface."""
    return np.column_stack((places + corner, np.full(len(places), height)))


def rolled(places, radius=RADIUS, height=0.03):
    """Return points of a lattice around the cylinder; arc lengths are kept at its own radius."""
    angle = places[:, 0] / RADIUS
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), height + places[:, 1]))


def on_wrist():
    """Return points on the surface of the wrist, without its ends."""
    uv = np.column_stack([k.ravel() for k in np.meshgrid(np.linspace(0.1, 0.9, 9), np.arange(24) / 24)])
    return wrist_surface().points(uv)


def codes(result):
    """Return codes and values of the findings."""
    return {finding.code: finding.value for finding in result.findings}


PATCHES = [
    pytest.param(flat(lattice(6, 7, "square"), 0.0007), plane_surface(), id="plane"),
    pytest.param(rolled(lattice(8, 36, "triangle")), cone_surface(RADIUS, RADIUS), id="cylinder"),
    pytest.param(on_wrist(), wrist_surface(), id="wrist"),
]


@pytest.mark.parametrize(("positions", "surface"), PATCHES)
def test_frames_are_orthonormal_and_corners_counter_clockwise(positions, surface):
    """Vectors are unit to 1e-12 and perpendicular; outlines are counter-clockwise in the tangent plane and have
    their area.
    """
    result = imported_taxels(taxel_set(positions), surface, "skin")
    taxels = result.taxels
    normals, tangents = taxels.normals_link, taxels.tangents_link
    for vectors in (normals, tangents):
        assert np.abs(np.linalg.norm(vectors, axis=1) - 1).max() < 1e-12
    assert np.abs((normals * tangents).sum(axis=1)).max() < 1e-12
    assert_allclose(normals, surface.normals(taxels.uv), rtol=0, atol=1e-12)
    arms = taxels.corners_link - taxels.positions_link[:, None]
    assert np.abs((arms * normals[:, None]).sum(axis=2)).max() < 1e-12
    turns = (np.cross(arms, np.roll(arms, -1, axis=1)) * normals[:, None]).sum(axis=2)
    assert (turns > 0).all()
    assert_allclose(arms[:, 0], (arms[:, 0] * tangents).sum(axis=1, keepdims=True) * tangents, rtol=0, atol=1e-12)
    assert np.linalg.norm(arms, axis=2).max() <= MAX_CELL_RADIUS * result.pitch * (1 + 1e-12)
    assert_allclose(taxels.areas, turns.sum(axis=1) / 2, rtol=1e-12)
    assert result.findings == ()


@pytest.mark.parametrize(
    ("named", "link", "is_other"),
    [
        ("r_other", "L", True),
        ("r_forearm", "l_forearm", True),
        ("left_forearm", "r_forearm_link", True),
        ("l_upper_arm", "l_upper_leg", True),
        ("left_forearm", "l_forearm", False),
        ("r_hand_dh_frame", "RightHand", False),
        ("forearm", "l_forearm", False),
        (None, "l_forearm", False),
    ],
)
def test_other_link_in_the_file_is_a_warning(named, link, is_other):
    """Parts are taken for each other. A frame of the user says how the taxels belong to the link."""
    taxels = taxel_set(flat(lattice(3, 3, "square"), 0.0007), frame=named)
    found = codes(imported_taxels(taxels, plane_surface(), "skin").on(link))
    assert found == ({"other-link": named} if is_other else {})
    moved = imported_taxels(taxels, plane_surface(), "skin", frame=(np.eye(3), np.zeros(3)))
    assert codes(moved.on(link)) == {}


def test_positions_stay_and_gaps_are_their_heights():
    """Taxels above the plane, below it and on it keep their positions; the parameters are those of the footpoint."""
    heights = np.array([0.005, -0.002, 0.0, 0.001])
    positions = np.column_stack(([0.02, 0.03, 0.05, 0.06], [0.03, 0.04, 0.05, 0.06], heights))
    result = imported_taxels(taxel_set(positions), plane_surface(), "skin")
    assert (result.taxels.positions_link == positions).all()
    assert_allclose(result.taxels.quality["gap"], heights, rtol=0, atol=1e-12)
    assert_allclose(result.taxels.uv, positions[:, :2] / (0.1, 0.08), rtol=0, atol=1e-9)
    assert_allclose(result.taxels.normals_link, np.tile((0, 0, 1.0), (4, 1)), rtol=0, atol=1e-12)
    snapped = imported_taxels(taxel_set(positions), plane_surface(), "skin", snap=True)
    assert_allclose(snapped.taxels.positions_link, positions * (1, 1, 0), rtol=0, atol=1e-9)
    assert_allclose(snapped.taxels.quality["gap"], heights, rtol=0, atol=1e-12)
    assert_allclose(snapped.taxels.corners_link[..., 2], 0, rtol=0, atol=1e-9)


def test_distances_before_and_after_are_stated():
    """The distances to surface and mesh are those of the positions in the file, and of their footpoints."""
    positions = flat(lattice(4, 5, "square"), 0.002)
    mesh = sheet(lambda x, y: 0 * x - 0.0005)
    result = imported_taxels(taxel_set(positions), plane_surface(), "skin", mesh)
    for named, expected in (
        (result.before.surface, 0.002),
        (result.before.mesh, 0.0025),
        (result.after.surface, 0),
        (result.after.mesh, 0.0005),
    ):
        assert_allclose((named.mean, named.rms, named.max), expected, rtol=1e-9, atol=1e-12)
    assert result.fit.verdict == "right" and result.findings == ()
    bare = imported_taxels(taxel_set(positions), plane_surface(), "skin")
    assert bare.before.mesh is bare.after.mesh is bare.fit is None


def test_normals_point_out_of_the_cylinder_whatever_the_file_says():
    """Normals of the file are compared and flipped ones counted, but they are not used."""
    positions = rolled(lattice(4, 30, "triangle"))
    outward = positions * (1, 1, 0) / RADIUS
    given = outward.copy()
    given[[3, 5, 60]] *= -1
    result = imported_taxels(taxel_set(positions, normals=given), cone_surface(RADIUS, RADIUS), "skin")
    assert_allclose(result.taxels.normals_link, outward, rtol=0, atol=1e-5)
    assert codes(result) == {"flipped-normals": 3}
    right = imported_taxels(taxel_set(positions, normals=outward), cone_surface(RADIUS, RADIUS), "skin")
    assert right.findings == ()


def test_tangents_run_along_the_surface_or_as_the_file_says():
    """Tangents are along u, or those of the file, projected; perpendicular ones of the file are replaced."""
    positions, surface = rolled(lattice(4, 30, "triangle")), cone_surface(RADIUS, RADIUS)
    taxels = imported_taxels(taxel_set(positions), surface, "s").taxels
    along = surface.derivatives(taxels.uv)[1, 0]
    assert_allclose((taxels.tangents_link * along).sum(axis=1), np.linalg.norm(along, axis=1), rtol=1e-9)
    given = np.tile((0, 0.6, 0.8), (len(positions), 1))
    given[7] = positions[7] * (1, 1, 0) / RADIUS
    found = imported_taxels(taxel_set(positions, tangents=given), surface, "s").taxels
    side = np.cross(found.normals_link, given)
    expected = np.cross(side, found.normals_link)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    rest = np.arange(len(positions)) != 7
    assert_allclose(found.tangents_link[rest], expected[rest], rtol=0, atol=1e-9)
    assert_allclose(np.abs(found.tangents_link[7] @ (0, 0, 1)), 1, rtol=1e-6)


@pytest.mark.parametrize("turned", [0.0, 0.3])
@pytest.mark.parametrize(("kind", "fraction"), [("square", 0.944), ("triangle", 0.969)])
def test_inner_cells_are_the_nearest_points(kind, fraction, turned):
    """A cell of a square or triangular lattice is inside the true cell and covers most of it, or all for suitable
    corners.
    """
    places = lattice(7, 7, kind)
    tangents = np.tile((np.cos(turned), np.sin(turned), 0), (49, 1))
    taxels = imported_taxels(taxel_set(flat(places), tangents=tangents), plane_surface(), "skin").taxels
    inner = [24, 23, 17, 31]
    exact = PITCH**2 * (1 if kind == "square" else np.sqrt(0.75))
    assert (taxels.areas[inner] <= exact * (1 + 1e-9)).all() and (taxels.areas[inner] >= fraction * exact).all()
    if kind == "square" and not turned:
        assert_allclose(taxels.areas[inner], exact, rtol=1e-9)
    corners = taxels.corners_link[inner].reshape(-1, 3)[:, :2] - (0.02, 0.02)
    owner = np.repeat(inner, taxels.corners_link.shape[1])
    near = cKDTree(places).query(corners)[0]
    assert_allclose(np.linalg.norm(corners - places[owner], axis=1), near, rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", ["square", "triangle"])
def test_border_cells_stay_compact(kind):
    """A cell at the border, or alone, ends a little beyond half a pitch."""
    positions = np.vstack((flat(lattice(5, 5, kind)), [[0.09, 0.07, 0]]))
    result = imported_taxels(taxel_set(positions), plane_surface(), "skin")
    assert_allclose(result.pitch, PITCH, rtol=1e-9)
    radii = np.linalg.norm(result.taxels.corners_link - positions[:, None], axis=2)
    assert_allclose(radii[25], MAX_CELL_RADIUS * PITCH, rtol=1e-9)
    assert_allclose(radii.max(), MAX_CELL_RADIUS * PITCH, rtol=1e-9)
    assert result.taxels.neighbours[25] == ()


@pytest.mark.parametrize(("kind", "inner", "corner"), [("square", 4, 2), ("triangle", 6, 2)])
def test_neighbours_touch_in_the_middle(kind, inner, corner):
    """A taxel has four neighbours in a square lattice, without the diagonals, and six in a triangular one;
    symmetric.
    """
    taxels = imported_taxels(taxel_set(flat(lattice(5, 5, kind))), plane_surface(), "skin").taxels
    place = {name: row for row, name in enumerate(taxels.ids)}
    assert len(taxels.neighbours[12]) == inner and len(taxels.neighbours[0]) == corner
    for name, adjacent in zip(taxels.ids, taxels.neighbours):
        for other in adjacent:
            gap = taxels.positions_link[place[name]] - taxels.positions_link[place[other]]
            assert np.linalg.norm(gap) < 1.01 * PITCH
            assert name in taxels.neighbours[place[other]]


def test_neighbours_exist_across_the_seam_of_a_tube():
    """Each taxel of a ring around the tube has two neighbours in its ring, one above and one below."""
    count = 36
    angle = 2 * np.pi * np.arange(count) / count
    ring = np.column_stack((RADIUS * np.cos(angle), RADIUS * np.sin(angle), 0 * angle))
    positions = np.concatenate([ring + (0, 0, 0.04 + PITCH * k) for k in range(3)])
    taxels = imported_taxels(taxel_set(positions), cone_surface(RADIUS, RADIUS), "s").taxels
    for i, adjacent in enumerate(taxels.neighbours[count : 2 * count]):
        assert set(adjacent) == {
            f"s.t{k}" for k in (i, i + 2 * count, count + (i + 1) % count, count + (i - 1) % count)
        }
    assert_allclose(taxels.areas[count : 2 * count], PITCH * 2 * RADIUS * np.pi / count, rtol=0.06)


def test_two_sides_of_a_thin_part_are_no_neighbours():
    """Taxels with opposite normals do not pair, and a taxel of the back under the middle of a pair does not
    separate it.
    """
    positions = 1e-3 * np.array([(0, 0, 0), (6, 0, 0), (3, 0, -0.5), (9, 0, -0.5)])
    normals = np.array([(0, 0, 1.0), (0, 0, 1), (0, 0, -1), (0, 0, -1)])
    pairs = near_pairs(positions, normals, 0.01, "s")
    assert sorted(map(tuple, np.sort(pairs, axis=1))) == [(0, 1), (2, 3)]
    assert sorted(map(tuple, np.sort(gabriel(positions, normals, pairs), axis=1))) == [(0, 1), (2, 3)]
    normals[2] *= -1  # now it is between them
    pairs = near_pairs(positions, normals, 0.01, "s")
    assert sorted(map(tuple, np.sort(gabriel(positions, normals, pairs), axis=1))) == [(0, 2), (1, 2)]


def test_taxel_straight_above_is_no_bound():
    """In two layers, the cell below keeps its size: a direction that is only rounding is not used."""
    positions = flat(lattice(5, 5, "square"))
    stacked = np.vstack((positions, positions[12] + (1e-12, 0, 0.002)))
    alone = imported_taxels(taxel_set(positions), plane_surface(), "s").taxels
    below = imported_taxels(taxel_set(stacked), plane_surface(), "s").taxels
    assert_allclose(below.areas[12], alone.areas[12], rtol=1e-9)


def test_neighbours_of_the_file_are_kept():
    """The ports of the file give the neighbours, at any distance; a neighbour in one direction is one in both."""
    positions = flat(lattice(2, 3, "square"))
    ports = (("t5",), ("t0", "missing"), (), ("t3",), (), ())
    taxels = imported_taxels(taxel_set(positions, neighbours=ports), plane_surface(), "s").taxels
    assert taxels.neighbours == (("s.t1", "s.t5"), ("s.t0",), (), (), (), ("s.t0",))


def test_taxels_at_one_position_have_one_cell():
    """Two taxels at one position are neighbours, with the outline of a single one."""
    positions = flat(lattice(5, 5, "square"))
    alone = imported_taxels(taxel_set(positions), plane_surface(), "s").taxels
    twins = imported_taxels(taxel_set(np.vstack((positions, positions[12]))), plane_surface(), "s").taxels
    assert_allclose(twins.corners_link[[12, 25]], alone.corners_link[[12, 12]], rtol=0, atol=1e-12)
    assert set(twins.neighbours[25]) == {*alone.neighbours[12], "s.t12"}
    assert set(twins.neighbours[12]) == {*alone.neighbours[12], "s.t25"}


def test_taxels_off_the_surface_are_named():
    """Taxels beyond an open edge or too far above are kept, and one finding names all of a kind."""
    positions = flat(lattice(4, 5, "square"))
    positions[3] = -0.002, 0.04, 0.001
    positions[[8, 9]] = (0.105, 0.03, 0), (0.109, 0.03, 0)
    positions[12] = 0, 0.05, 0.002  # over the edge, not beyond it
    positions[15, 2] = 0.02
    result = imported_taxels(taxel_set(positions), plane_surface(), "s")
    assert codes(result) == {"beyond-edge": ["s.t3", "s.t8", "s.t9"], "far": ["s.t15"]}
    texts = [str(finding) for finding in result.findings]
    assert "s.t3 is the first of 3 taxels beyond an open edge of the surface: s.t3, s.t8, s.t9" in texts[1]
    assert "s.t15 is the only taxel farther than 10 mm from the surface" in texts[0]
    assert len(result.taxels.ids) == 20
    round_it = rolled(lattice(3, 36, "triangle"))  # the seam of a closed surface is not an edge
    assert imported_taxels(taxel_set(round_it), cone_surface(RADIUS, RADIUS), "s").findings == ()


def wrist_taxels():
    """Return taxels on the wrist in another frame, and the motion into that frame."""
    motion = Motion(11)
    return motion.points(on_wrist()), motion


def test_wrong_frame_is_an_error_with_a_proposal_that_replaces_it():
    """The message has the distance before and after; the proposal replaces the frame, it is not a motion after it."""
    positions, _ = wrist_taxels()
    wrong = Motion(5)
    given = wrong.rotation, wrong.shift
    result = imported_taxels(taxel_set(positions), wrist_surface(), "skin", wrist(), frame=given)
    (found,) = (f for f in result.findings if f.severity == "error")
    assert found.code == "wrong-frame" and result.fit.verdict == "moved"
    assert re.match(r"is [0-9.]+ mm off the mesh on average, and 0\.0 mm in another frame", found.message)
    proposed = found.value["rotation"], found.value["translation"]
    right = imported_taxels(taxel_set(positions), wrist_surface(), "skin", wrist(), frame=proposed)
    assert right.findings == () and np.linalg.norm(right.taxels.positions_link - on_wrist(), axis=1).max() < 2e-4


@pytest.mark.slow
def test_frame_is_found_if_one_position_fits():
    """The frame is found from that of the file or a wrong one; none, several or no needed frames are refused with a
    reason.
    """
    positions, wrong = wrist_taxels()[0], Motion(5)
    for given in (None, (wrong.rotation, wrong.shift)):
        there = placed(taxel_set(positions), *frame_on(taxel_set(positions), wrist(), "skin", given))
        assert np.linalg.norm(there.positions - on_wrist(), axis=1).max() < 2e-4
    with pytest.raises(InvalidPlan, match="skin is on the mesh already; its frame needs no change"):
        frame_on(there, wrist(), "skin")


@pytest.mark.slow
def test_frame_is_refused_where_several_places_fit_or_none():
    """A tube round a tube may turn; points at random lie on no mesh."""
    on_tube = Motion(3).points(rolled(lattice(8, 36, "triangle")))
    with pytest.raises(InvalidPlan, match="skin is .* in several positions, so give its frame"):
        frame_on(taxel_set(on_tube), cylinder(), "skin")
    scattered = np.random.default_rng(0).uniform(-0.2, 0.2, (80, 3))
    with pytest.raises(InvalidPlan, match="skin is .* and no motion brings it nearer"):
        frame_on(taxel_set(scattered), cylinder(), "skin")


@pytest.mark.slow
def test_thick_skin_is_a_warning():
    """No motion of the frame brings it nearer to the mesh."""
    positions = rolled(lattice(8, 36, "triangle"), RADIUS + 0.006)
    findings = imported_taxels(taxel_set(positions), cone_surface(RADIUS, RADIUS), "s", cylinder()).findings
    (found,) = (f for f in findings if f.code == "off-mesh")
    assert found.severity == "warning" and "is 6.0 mm off the mesh on average, and no motion" in found.message


def test_placed_takes_a_rotation_rounded_by_hand():
    """Four decimals are sufficient, and no shear remains; a matrix that is not a rotation is refused."""
    motion = Motion(1)
    positions = flat(lattice(3, 3, "square"))
    here = placed(taxel_set(positions), motion.rotation.round(4), motion.shift)
    assert_allclose(here.positions, motion.points(positions), rtol=0, atol=1e-5)
    gaps = [np.linalg.norm(p[:, None] - p, axis=2) for p in (positions, here.positions)]
    assert_allclose(gaps[1], gaps[0], rtol=0, atol=1e-15)
    for wrong in (2 * np.eye(3), np.diag((1, 1, -1)), np.zeros((3, 3)), np.eye(3) + 0.01):
        message = "the matrix .* is not a rotation: it (mirrors|scales|stretches)"
        with pytest.raises(InvalidPlan, match=message):
            placed(taxel_set(positions), wrong, (0, 0, 0))


def test_taxels_without_spacing_are_refused():
    """The cells of a single taxel, or of taxels at one position, have no size."""
    for positions in (flat(np.zeros((1, 2))), flat(np.zeros((3, 2)))):
        with pytest.raises(InvalidPlan, match="the taxels of s have one position, so that their cells have no size"):
            imported_taxels(taxel_set(positions), plane_surface(), "s")


def test_many_taxels_at_one_position_are_refused():
    """Thousands of taxels at one position next to a lattice are refused before their pairs fill the memory."""
    heap = np.tile((0.05, 0.05, 0), (3000, 1)) + np.random.default_rng(0).normal(scale=1e-8, size=(3000, 3))
    positions = np.vstack((flat(lattice(8, 8, "square")), heap))
    with pytest.raises(InvalidPlan, match="the taxels of s are too close together for a pitch of 6 mm"):
        imported_taxels(taxel_set(positions), plane_surface(), "s")


def test_pitch_is_the_median_of_the_spacing():
    """It is the median over positions, not taxels: equal positions count once, and an isolated one has no influence."""
    positions = np.vstack((flat(lattice(5, 5, "triangle")), [[0.09, 0.07, 0]]))
    assert_allclose(median_pitch(np.repeat(positions, 2, axis=0), "s"), PITCH, rtol=1e-9)


def test_a_slightly_wrong_frame_is_a_warning():
    """Taxels above a part of the wrist, rotated by 3 degrees and moved by 4 mm: the frame of the message brings them
    back. The report has the residual before and after.
    """
    uv = imported_taxels(taxel_set(on_wrist()), wrist_surface(), "s").taxels.uv
    true = on_wrist() + 0.001 * wrist_surface().normals(uv)
    turn = Rotation.from_rotvec(np.deg2rad(3) * np.array((0.6, 0.8, 0))).as_matrix()
    wrong = (true - true.mean(axis=0)) @ turn.T + true.mean(axis=0) + (0.003, -0.002, 0.0017)
    assert imported_taxels(taxel_set(true), wrist_surface(), "s", wrist()).findings == ()
    result = imported_taxels(taxel_set(wrong), wrist_surface(), "s", wrist())
    (found,) = (f for f in result.findings if f.code == "near-frame")
    assert found.severity == "warning" and "fits the mesh better after a motion of" in found.message
    back = placed(taxel_set(wrong), found.value["rotation"], found.value["translation"]).positions
    assert np.linalg.norm(back - true, axis=1).max() < 1e-3 < np.linalg.norm(wrong - true, axis=1).max()
    assert result.fit.nearby.after < 0.2 * result.fit.nearby.before


def test_snapped_taxels_may_not_be_in_one_place():
    """A taxel above another one stays in the file's position; moved to the surface, both have one place."""
    positions = flat(lattice(5, 5, "square"))
    stacked = np.vstack((positions, positions[12] + (1e-5, 0, 0.005)))
    assert "merged" not in codes(imported_taxels(taxel_set(stacked), plane_surface(), "s"))
    result = imported_taxels(taxel_set(stacked), plane_surface(), "s", snap=True)
    (found,) = (f for f in result.findings if f.code == "merged")
    assert found.severity == "error" and found.pointer == "s.t12"
    assert (
        "and s.t25 are 5.0 mm apart in the file and in one place on the surface, the first of 1 pairs" in found.message
    )
    assert "merged" not in codes(imported_taxels(taxel_set(positions), plane_surface(), "s", snap=True))
