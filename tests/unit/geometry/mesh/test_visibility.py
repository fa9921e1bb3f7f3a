"""What of a mesh can be seen from outside: exact answers of simple bodies."""

import numpy as np
import pytest
import trimesh

from skin_calib_addon.geometry.mesh.face_points import sample_faces
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, weld
from skin_calib_addon.geometry.mesh.visibility import MAX_POINTS, are_seen, depth_buffers, point_distance, visibility
from tests.shapes import box, cylinder, same_mesh, sheet, shuffled, subdivided, together, turned, welded, wrist


def outward(mesh):
    """Normals of the side that is found to be outside."""
    return mesh.face_normals * visibility(mesh).sides[:, None]


def cup(radius, depth, wall):
    """A closed body: a cylinder with a blind hole from above."""
    outer = trimesh.creation.revolve(
        [[0, -wall], [radius + wall, -wall], [radius + wall, depth], [radius, depth], [radius, 0], [0, 0]], sections=64
    )
    return welded(outer)


def test_all_of_a_sphere_is_seen_and_its_outside_found():
    """Also if half of the faces are wound inward."""
    sphere = welded(trimesh.creation.icosphere(4, 0.05))
    mixed = turned(sphere, np.random.default_rng(0).random(len(sphere.faces)) < 0.5)
    for mesh in (sphere, mixed):
        assert visibility(mesh).seen.all()
        assert (np.einsum("fc,fc->f", outward(mesh), mesh.triangles.mean(axis=1)) > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("half", [0.15, 0.05, 0.005])
def test_a_box_in_a_box_is_hidden(half):
    """All of the outer one is seen and nothing of the inner one; to the last face, with any winding and size."""
    outer, inner = box((-half,) * 3, (half,) * 3), box((-0.6 * half,) * 3, (0.6 * half,) * 3)
    for change in (lambda m: m, subdivided, lambda m: turned(m, np.ones(len(m.faces)))):
        mesh = change(together(outer, inner))
        is_outer = np.abs(mesh.triangles).max(axis=(1, 2)) > 0.8 * half
        np.testing.assert_array_equal(visibility(mesh).seen, is_outer)
        assert visibility(mesh).fractions[is_outer].min() > 0.97
        assert visibility(mesh).fractions[~is_outer].max() == 0
        centres = mesh.triangles.mean(axis=1)
        assert (np.einsum("fc,fc->f", outward(mesh), centres)[is_outer] > 0).all()


@pytest.mark.parametrize("depth", [0.01, 0.03, 0.06, 0.12])
def test_openness_of_the_bottom_of_a_cup_is_its_view_factor(depth):
    """From the middle of its bottom to its opening: r^2 / (r^2 + h^2)."""
    radius = 0.03
    mesh = cup(radius, depth, 0.005)
    up = depth_buffers(mesh).openness(np.zeros((1, 3)), np.array([[0, 0, 1.0]]))
    assert up[0, 0] == pytest.approx(radius**2 / (radius**2 + depth**2), abs=0.06)
    assert up[1, 0] == 0  # below is the wall


def test_the_bottom_of_a_deep_hole_is_hidden():
    """A bore of 6 mm, 60 mm deep, has a view factor of .0025 at its bottom; the outside is seen."""
    mesh = cup(0.003, 0.06, 0.01)
    radius = np.linalg.norm(mesh.triangles.mean(axis=1)[:, :2], axis=1)
    height, up = mesh.triangles[:, :, 2].mean(axis=1), np.abs(mesh.face_normals[:, 2])
    bottom = (height == 0) & (up > 0.9) & (radius < 0.003)
    assert bottom.any() and not visibility(mesh).seen[bottom].any()
    assert visibility(mesh).seen[(radius > 0.0035)].all()


def test_a_plate_below_a_plate_is_seen_from_its_other_side():
    """Sheets without thickness, 2 mm apart, wound alike: each looks away from the other."""
    low, high = sheet(lambda x, y: 0 * x), sheet(lambda x, y: 0 * x + 0.002)
    mesh = together(low, high)
    is_high = mesh.triangles[:, :, 2].mean(axis=1) > 0.001
    assert visibility(mesh).seen.all()
    np.testing.assert_array_equal(visibility(mesh).sides, np.where(is_high, 1, -1))
    centres = mesh.triangles.mean(axis=1)
    inner = (np.abs(centres[:, :2] - (0.05, 0.04)) < (0.03, 0.02)).all(axis=1)
    away = np.where(is_high, 1, -1)[:, None] * (0, 0, 1.0)
    assert are_seen(mesh, centres[inner], away[inner]).all()
    assert not are_seen(mesh, centres[inner], -away[inner]).any()


def test_a_single_sheet_keeps_its_winding():
    """Both sides are open, so the winding decides, for all faces alike."""
    dome = sheet(lambda x, y: 0.02 - 2 * ((x - 0.05) ** 2 + (y - 0.04) ** 2))
    for mesh in (dome, turned(dome, np.ones(len(dome.faces)))):
        assert visibility(mesh).seen.all()
        assert (visibility(mesh).sides == 1).all()


def test_points_above_the_mesh_are_seen_and_points_below_it_are_not():
    """1 mm outside and 2 mm inside of a closed cylinder, and far away."""
    mesh = cup(0.03, 0.05, 0.01)
    angle = np.linspace(0, 6, 40)
    normals = np.column_stack((np.cos(angle), np.sin(angle), 0 * angle))
    for radius, seen in ((0.041, True), (0.038, False), (0.035, False), (3.0, True)):
        points = radius * normals + (0, 0, 0.02)
        assert (are_seen(mesh, points, normals) == seen).all()


def test_order_of_faces_and_of_corners_changes_nothing():
    """The same fractions to rounding, and the same sides with regard to the winding."""
    mesh = together(wrist(), box((-0.01, -0.01, 0.03), (0.01, 0.01, 0.07)))
    other = TriangleMesh(*shuffled(mesh, 3))
    assert same_mesh(weld(other.vertices, other.faces), mesh)
    key = [np.lexsort(m.triangles.mean(axis=1).round(9).T) for m in (mesh, other)]
    a, b = (visibility(m).fractions[k] for m, k in zip((mesh, other), key))
    assert np.abs(a - b).mean() < 0.002
    assert (visibility(mesh).seen[key[0]] != visibility(other).seen[key[1]]).mean() < 0.005
    np.testing.assert_array_equal(visibility(mesh).sides[key[0]], visibility(other).sides[key[1]])


def test_points_of_faces_are_dense_and_have_their_area():
    """Each point of a face is near a sample, at tips of slivers, too. Areas are those of the faces."""
    rng = np.random.default_rng(1)
    corners = rng.uniform(-0.02, 0.02, (60, 3, 3))
    corners[:20, 2] = corners[:20, 0] + 0.9 * (corners[:20, 1] - corners[:20, 0]) + rng.normal(0, 1e-4, (20, 3))
    mesh = weld(corners.reshape(-1, 3), np.arange(180).reshape(-1, 3))
    points, face, areas = sample_faces(mesh, 1e-3)
    np.testing.assert_allclose(np.bincount(face, areas), mesh.face_areas, rtol=1e-12)
    for f, triangle in enumerate(mesh.triangles):
        weights = rng.dirichlet((0.4, 0.4, 0.4), 50)
        away = np.linalg.norm((weights @ triangle)[:, None] - points[face == f], axis=2).min(axis=1)
        assert away.max() < 1.5e-3


def test_number_of_points_is_limited():
    """A large mesh of slivers: one point for each face, and at most the limit in addition."""
    long = cylinder(0.2, 2.0, around=2000, along=3)
    distance = point_distance(long)
    assert distance > 2e-3
    assert MAX_POINTS / 4 < len(sample_faces(long, distance)[0]) < MAX_POINTS + len(long.faces)
    assert visibility(cylinder(0.02, 0.03)).seen.all()  # and a small one
