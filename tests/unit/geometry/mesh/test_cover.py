"""The cover: what planes leave of a mesh, and what of it one sees from outside."""

import numpy as np
import pytest
import trimesh

from skin_calib_addon.common.arrays import unit
from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.geometry.mesh import shells as shells_module
from skin_calib_addon.geometry.mesh.cover import CoverSpec, Cut, cut_cover, one_side, shells_after
from skin_calib_addon.geometry.mesh.shells import shells
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, weld
from tests.shapes import LENGTH, RADIUS, TURN, Motion, box, cylinder, keep, same_mesh, together, welded, wrist

INNER = box((-0.01, -0.01, 0.03), (0.01, 0.01, 0.07))  # a servo inside the tube
NEAR = box((0.05, -0.01, 0.03), (0.06, 0.01, 0.07))  # a bracket outside of it


@pytest.mark.parametrize(
    ("mesh", "outer"),
    [(wrist(), wrist()), (together(cylinder(), INNER), cylinder()), *[2 * (together(cylinder(), NEAR),)]],
    ids=["one shell", "a box inside", "a bracket outside"],
)
def test_cover_drops_the_inner_parts(mesh, outer):
    """Without a cut: to the bit; ``all`` keeps everything."""
    assert same_mesh(cut_cover(mesh, CoverSpec("outer")), outer)
    assert same_mesh(cut_cover(mesh, CoverSpec("all")), mesh)


def test_part_between_two_outer_shells_is_an_inner_part():
    """It is outside the hull of the tube, and inside the hull of the tube and its bracket."""
    between = box((0.045, -0.003, 0.045), (0.048, 0.003, 0.055))
    assert same_mesh(cut_cover(together(cylinder(), between), CoverSpec("outer")), together(cylinder(), between))
    expected = together(cylinder(), NEAR)
    assert same_mesh(cut_cover(together(expected, between), CoverSpec("outer")), expected)


def test_cover_isolates_shells_after_the_cut():
    """A bar that protrudes from the tube is inside it after its end is cut away."""
    mesh = together(cylinder(), box((-0.01, -0.01, 0.03), (0.01, 0.01, 0.3)))
    assert same_mesh(cut_cover(mesh, CoverSpec("outer")), mesh)
    spec = CoverSpec("outer", (Cut((0, 0, 0.09), (0, 0, -1)),))
    assert np.linalg.norm(cut_cover(mesh, spec).vertices[:, :2], axis=1).min() > 0.9 * RADIUS


def test_cover_survives_a_shell_without_area():
    """A lone triangle squeezed to a line, as exporters leave them, hides nothing and breaks nothing."""
    sliver = weld(np.array([[0, 0, 0.02], [0, 0, 0.03], [0, 0, 0.04]]), [[0, 1, 2]])
    assert same_mesh(cut_cover(together(cylinder(), sliver), CoverSpec("outer")), cylinder())


def test_shells_are_joined_over_edges_of_two_faces_only():
    """Two boxes with a common edge are two shells: four faces meet there."""
    boxes = together(box((0, 0, 0), (1, 1, 1)), box((1, 1, 0), (2, 2, 1)))
    assert np.bincount(shells(boxes)).tolist() == [12, 12]
    assert np.bincount(shells(cylinder())).tolist() == [len(cylinder().faces)]


@pytest.mark.parametrize("every", [1, 10, 400])
def test_faces_that_are_back_to_back_are_one_face(every):
    """With doubled faces, on all of a mesh or a part of it, the shells stay the same, and the cover loses no face."""
    mesh = together(cylinder(), INNER)
    doubled = weld(mesh.vertices, np.concatenate((mesh.faces, mesh.faces[::every, ::-1])))
    assert len(doubled.faces) == len(mesh.faces) + len(mesh.faces[::every])
    assert shells(doubled).max() == 1
    inside = np.linalg.norm(doubled.triangles.mean(axis=1)[:, :2], axis=1) < 0.02
    assert (shells_module.is_outer(doubled) == ~inside).all()
    for shell in ("outer", "seen"):  # of each two the outward one
        assert same_mesh(cut_cover(doubled, CoverSpec(shell)), cut_cover(mesh, CoverSpec(shell)))


def test_faces_that_are_back_to_back_within_rounding_are_one_face():
    """The second face of each two has vertices of its own, which differ by the rounding of single precision."""
    mesh = cylinder()
    moved = mesh.vertices * (1 + 5e-8 * np.random.default_rng(0).uniform(-1, 1, mesh.vertices.shape))
    faces = np.concatenate((mesh.faces, mesh.faces[::2, ::-1] + len(moved)))
    cover = cut_cover(weld(np.concatenate((mesh.vertices, moved)), faces), CoverSpec("outer"))
    assert len(cover.faces) == len(mesh.faces)
    np.testing.assert_allclose(cover.face_areas.sum(), mesh.face_areas.sum(), rtol=1e-6)
    assert (cover.face_normals[:, :2] * cover.triangles.mean(axis=1)[:, :2]).sum(axis=1).min() > 0


@pytest.mark.parametrize(
    ("cuts", "message"),
    [
        ((Cut((0, 0, 0.05), (0, 0, 1)), Cut((0, 0, 0.2), (0, 0, 1))), "Cut 1 removes the whole mesh. .* Reverse the"),
        ((Cut((0, 0, 0.05), (0, 0, 0)),), "The normal of cut 0 is zero"),
    ],
)
def test_cut_that_keeps_nothing_is_refused(cuts, message):
    """The message names the cut, and what may be wrong with it."""
    with pytest.raises(InvalidPlan, match=message):
        cut_cover(cylinder(), CoverSpec("outer", cuts))


@pytest.mark.parametrize("divided", ["nothing", "the part inside", "the part outside"])
def test_shells_are_kept_by_their_area_inside_not_by_their_faces(divided):
    """A box with 55 % of its area inside a larger one is dropped, however its faces are divided."""
    inner = box((0.01, 0.01, 0.01), (0.03, 0.03, 0.07))
    cuts = {
        "nothing": [],
        "the part inside": np.linspace(0.012, 0.04, 8),
        "the part outside": np.linspace(0.05, 0.068, 8),
    }
    for height in cuts[divided]:
        halves = [one_side(inner, np.array((0, 0, height)), np.array((0, 0, sign))) for sign in (1.0, -1.0)]
        inner = together(*(weld(*half[:2]) for half in halves))
    cover = cut_cover(together(box((0, 0, 0), (0.1, 0.1, 0.046)), inner), CoverSpec())
    assert np.ptp(cover.vertices[:, 2]) == pytest.approx(0.046)


def test_seen_keeps_what_is_outside_of_all_shells():
    """The tube without its inner box, with the bracket outside of it; of closed bodies to the bit."""
    closed, outside = box((-0.04, -0.04, 0), (0.04, 0.04, 0.1)), box((0.1, -0.01, 0.03), (0.11, 0.01, 0.07))
    mesh = together(closed, INNER, outside)
    assert same_mesh(cut_cover(mesh, CoverSpec("seen")), together(closed, outside))
    assert same_mesh(cut_cover(closed, CoverSpec("seen")), closed)


def test_seen_is_decided_before_the_cuts():
    """A cut opens the view on the inner box, which stays hidden, as with "outer"."""
    mesh = together(box((-0.04, -0.04, 0), (0.04, 0.04, 0.1)), INNER)
    cuts = (Cut((0, 0, 0.05), (0, 0, -1)),)
    cover = cut_cover(mesh, CoverSpec("seen", cuts))
    assert same_mesh(cover, cut_cover(mesh, CoverSpec("outer", cuts)))
    assert same_mesh(cover, cut_cover(box((-0.04, -0.04, 0), (0.04, 0.04, 0.1)), CoverSpec("all", cuts)))


def test_seen_removes_inner_walls_that_are_connected_to_the_outside():
    """A box with a thin wall around a cavity that a bore opens: one shell, of which the cavity goes."""
    profile = [[0.002, 0], [0.04, 0], [0.04, 0.1], [0.002, 0.1], [0.002, 0.097], [0.037, 0.097], [0.037, 0.003]]
    mesh = welded(trimesh.creation.revolve([*profile, [0.002, 0.003], [0.002, 0]], sections=48))
    centres = mesh.triangles.mean(axis=1)
    radius = np.linalg.norm(centres[:, :2], axis=1)
    outside = (radius > 0.0385) | (centres[:, 2] < 1e-4) | (centres[:, 2] > 0.0999)
    assert shells(mesh).max() == 0
    assert same_mesh(cut_cover(mesh, CoverSpec("outer")), mesh)
    kept = keep(cut_cover(mesh, CoverSpec("seen")), lambda c: np.linalg.norm(c[:, :2], axis=1) > 0.0025)  # not the bore
    assert same_mesh(kept, weld(mesh.vertices, mesh.faces[outside]))


@pytest.mark.parametrize("seed", range(3))
def test_cut_leaves_a_part_in_one_piece(seed):
    """Both faces of an edge get the same point. Pieces at the cut were shells, and were removed as inner parts."""
    rng = np.random.default_rng(seed)
    mesh = weld(wrist().vertices @ Motion(seed, 1.0).rotation.T, wrist().faces)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    point, normal = low + (high - low) * rng.uniform(0.3, 0.7, 3), unit(rng.normal(size=3))
    halves = [weld(*one_side(mesh, point, sign * normal)[:2]) for sign in (1.0, -1.0)]
    assert [shells(half).max() for half in halves] == [0, 0]
    assert sum(half.face_areas.sum() for half in halves) == pytest.approx(mesh.face_areas.sum(), rel=1e-12)
    assert shells(together(*halves)).max() == 0  # both halves have the same points at the cut
    kept = cut_cover(mesh, CoverSpec("outer", (Cut(tuple(point), tuple(normal)),)))
    assert len(kept.faces) == len(halves[0].faces)


@pytest.mark.parametrize("seed", range(4))
def test_shells_after_cuts_are_those_of_the_cut_mesh(seed):
    """A slab of a pile of parts, two of which fall apart: the same parts without welding."""
    rng = np.random.default_rng(seed)
    ring = keep(cylinder(), lambda c: np.abs(c[:, 2] - 0.05) < 0.03)
    mesh = together(ring, INNER, NEAR, box((-0.02, -0.05, 0.045), (0.02, 0.05, 0.055)))
    across = unit(rng.normal(size=3) * (1, 1, 0.1))
    planes = [((0, 0, 0.05) - sign * 0.02 * across, sign * across) for sign in (1, -1)]
    kept, of = mesh, np.arange(len(mesh.faces))
    for point, normal in planes:
        vertices, faces, parts = one_side(kept, point, normal)
        kept, of = TriangleMesh(vertices, faces), of[parts]
    # Cuts at the height of vertices leave no face without area.
    assert kept.face_areas.min() > 0
    shell, exact = shells_after(mesh, planes)[of], weld(kept.vertices, kept.faces)
    areas = np.bincount(np.unique(shell, return_inverse=True)[1], kept.face_areas)
    np.testing.assert_allclose(np.sort(areas), np.sort(np.bincount(shells(exact), exact.face_areas)), rtol=1e-9)
    assert len(areas) > 1


def test_cut_through_vertices_keeps_them():
    """A vertex on the plane is a vertex of the rim, to the bit, and no face becomes a line."""
    mesh = cylinder()
    height = np.unique(mesh.vertices[:, 2])[7]
    expected = mesh.faces[mesh.triangles[:, :, 2].min(axis=1) >= height]
    half = weld(*one_side(mesh, np.array((0, 0, height)), np.array((0.0, 0, 1)))[:2])
    assert same_mesh(half, weld(mesh.vertices, expected))
    motion = Motion(4)  # rounding moves the vertices off the plane
    point, normal = motion.points(np.array((0.01, 0.02, height))), motion.rotation @ np.array((0.0, 0, 1))
    half = weld(*one_side(motion.mesh(mesh), point, normal)[:2])
    assert len(half.faces) == len(expected) and half.face_areas.min() > 0.9 * mesh.face_areas.min()


@pytest.mark.parametrize("part", [0.1, 1.0])
def test_faces_with_corners_of_their_own_are_one_shell(part):
    """Files whose faces have the same corners but for rounding: no face is a shell, and none is removed as inner."""
    mesh, rng = wrist(), np.random.default_rng(0)
    triangles, moved = mesh.triangles.copy(), rng.random(len(mesh.faces)) < part
    triangles[moved] += rng.normal(0, 1e-9, triangles[moved].shape)
    apart = weld(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    assert shells(apart).max() == 0 and len(apart.vertices) > 1.2 * len(mesh.vertices)
    assert same_mesh(cut_cover(apart, CoverSpec("outer")), apart)


@pytest.mark.parametrize("radius", [0.9 * RADIUS, 1.1 * RADIUS])
def test_stray_faces_are_outer_shells_where_they_are_outside(radius):
    """Of hundreds of small ones, each counts by its own place, and none makes the hull larger."""
    angle, height = TURN * np.arange(300) / 300, LENGTH * (0.1 + 0.8 * (np.arange(300) % 7) / 7)
    centre = np.column_stack((radius * np.cos(angle), radius * np.sin(angle), height))
    corners = centre[:, None] + 1e-4 * np.eye(3)
    stray = TriangleMesh(corners.reshape(-1, 3), np.arange(900).reshape(-1, 3))
    kept = cut_cover(together(cylinder(), stray), CoverSpec("outer"))
    assert len(kept.faces) == len(cylinder().faces) + 300 * (radius > RADIUS)
