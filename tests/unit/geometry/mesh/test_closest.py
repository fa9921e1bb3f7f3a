"""Nearest points of triangles and meshes, next to slow and obvious versions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.geometry.mesh import closest
from skin_calib_addon.geometry.mesh.closest import (
    MANY_FACES,
    MeshDistance,
    NearMesh,
    closest_on_triangles,
    distance_to,
    small_parts,
)
from skin_calib_addon.geometry.mesh.triangle_mesh import weld
from tests.oracles import distance_to_mesh, nearest_on_triangle
from tests.shapes import LENGTH, RADIUS, TURN, box, cylinder, grid_of_faces

seeds = st.integers(0, 2**32 - 1)
whole = st.integers(-3, 3)
points_on_a_grid = st.tuples(whole, whole, whole).map(lambda p: np.array(p, float))


@given(corners=st.tuples(*3 * [points_on_a_grid]).map(np.array), point=points_on_a_grid, seed=seeds)
def test_closest_point_of_a_triangle_is_the_best_of_plane_and_sides(corners, point, seed):
    """Points over the inside, the sides and the corners; triangles of any shape, squeezed to a line or a point too."""
    for aside in (0.0, np.random.default_rng(seed).normal(size=3)):
        found = closest_on_triangles((point + aside)[None], corners[None])[0]
        best = nearest_on_triangle(point + aside, corners)
        gap = np.linalg.norm(found - point - aside)
        assert_allclose(gap, np.linalg.norm(best - point - aside), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e6])
def test_slivers_are_measured_like_any_triangle(scale):
    """Needles, and triangles flat to the rounding: the nearest point is on them, never a corner far away."""
    rng = np.random.default_rng(0)
    for width in (0.0, 1e-18, 1e-15, 1e-12, 1e-9, 1e-6):
        corners = scale * np.array([[0, 0, 0], [1, 0.3, -0.2], [0.4 + width, 0.12, -0.08 + width]])
        for point in scale * rng.normal(size=(10, 3)):
            gap = np.linalg.norm(closest_on_triangles(point[None], corners[None])[0] - point)
            assert_allclose(gap, np.linalg.norm(nearest_on_triangle(point, corners) - point), rtol=1e-5)


@given(seed=seeds)
def test_mesh_distance_is_the_smallest_of_all_triangles(seed):
    """A soup of small and large triangles, points near, far and on it; the face and the nearest point belong to it."""
    rng = np.random.default_rng(seed)
    sizes = 10.0 ** rng.uniform(-2, 0, (8, 1, 1))
    mesh = weld(
        (rng.uniform(-1, 1, (8, 1, 3)) + sizes * rng.normal(size=(8, 3, 3))).reshape(-1, 3), np.arange(24).reshape(8, 3)
    )
    points = np.concatenate((rng.uniform(-2, 2, (5, 3)), 100 * rng.normal(size=(1, 3)), mesh.vertices[:2]))
    distance, face, nearest = MeshDistance(mesh)(points)
    assert_allclose(distance, [distance_to_mesh(p, mesh.triangles) for p in points], rtol=1e-12, atol=1e-12)
    assert_allclose(np.linalg.norm(nearest - points, axis=1), distance, rtol=1e-12, atol=1e-15)
    on_face = [np.linalg.norm(nearest_on_triangle(q, mesh.triangles[f]) - q) for q, f in zip(nearest, face)]
    assert max(on_face) < 1e-12


def test_mesh_distance_is_exact_on_a_box():
    """Few and large faces: distances from every side are those of the formula."""
    low, high = np.array((0, 0, 0)), np.array((0.1, 0.05, 0.02))
    points = np.random.default_rng(1).uniform(-0.1, 0.2, (300, 3))
    outside = np.maximum(np.maximum(low - points, points - high), 0)
    inside = np.minimum(points - low, high - points).min(axis=1)
    expected = np.where(inside > 0, inside, np.linalg.norm(outside, axis=1))
    assert_allclose(MeshDistance(box(low, high))(points)[0], expected, rtol=1e-12, atol=1e-16)


def test_mesh_distance_of_no_points_is_empty():
    """Nothing asked, nothing answered."""
    distance, face, nearest = MeshDistance(box((0, 0, 0), (1, 1, 1)))(np.empty((0, 3)))
    assert distance.shape == face.shape == (0,) and nearest.shape == (0, 3)


def test_no_face_is_lost_between_centres_at_equal_distances():
    """Points halfway between the rings of a tube: the nearest face of all, by comparison with each."""
    tube = cylinder()
    angle, height = (x.ravel() for x in np.meshgrid(TURN * np.arange(613) / 613, LENGTH * np.arange(13) / 12))
    points = np.column_stack((1.001 * RADIUS * np.cos(angle), 1.001 * RADIUS * np.sin(angle), height))
    found = MeshDistance(tube)(points)[0]
    half = TURN / 96 / 2  # of the angle of a plane side
    phi = angle % (2 * half) - half
    side = 1.001 * RADIUS * np.cos(phi) - RADIUS * np.cos(half)
    along = 1.001 * RADIUS * np.sin(np.abs(phi)) - RADIUS * np.sin(half)
    assert_allclose(found, np.hypot(side, np.maximum(along, 0)), rtol=0, atol=1e-9)


def test_small_parts_tile_the_faces():
    """No side is longer than asked, and the areas of the parts of each face add up to it."""
    mesh = cylinder()
    corners, face = small_parts(mesh, 0.002)
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert mesh.longest_sides.max() > 0.002 >= sides.max()
    assert_allclose(np.bincount(face, areas), mesh.face_areas, rtol=1e-9)


def test_blocks_of_pairs_do_not_affect_the_distances(monkeypatch):
    """Points near and far, more pairs than one block holds."""
    mesh = cylinder()
    points = 0.2 * np.random.default_rng(0).normal(size=(40, 3))
    whole = MeshDistance(mesh)(points)
    monkeypatch.setattr(closest, "BLOCK_PAIRS", 100)
    for found, expected in zip(MeshDistance(mesh)(points), whole):
        assert_allclose(found, expected, rtol=0, atol=0)


def test_search_tree_of_a_mesh_is_built_once_and_ends_with_it():
    """It is shared by all that compare with the mesh, and is not kept after the mesh."""
    mesh = weld(cylinder().vertices, cylinder().faces)
    assert distance_to(mesh) is distance_to(mesh)
    before = len(closest._known)
    del mesh
    assert len(closest._known) < before


@pytest.mark.parametrize("shape", ["a large face over fine ones", "long strips"])
def test_distances_with_bounds_are_those_without(shape):
    """The nearest face may be far longer than the bound, so that none of its corners is within it."""
    rng = np.random.default_rng(0)
    if shape == "long strips":
        turn, z = np.meshgrid(np.linspace(0, TURN, 20_001), (0.0, 0.4), indexing="ij")
        vertices = np.stack((0.05 * np.cos(turn), 0.05 * np.sin(turn), z), axis=-1).reshape(-1, 3)
        mesh = weld(vertices, grid_of_faces(20_001, 2))
        angle, height = TURN * rng.random(4), 0.4 * rng.random(4)
        points, bound = np.column_stack((0.051 * np.cos(angle), 0.051 * np.sin(angle), height)), 0.0011
    else:
        x, y = np.meshgrid(np.linspace(0, 0.15, 151), np.linspace(0, 0.15, 151), indexing="ij")
        sheet = np.stack((x, y, 0 * x), axis=-1).reshape(-1, 3)
        large = np.array([[-0.1, -0.1, 0.004], [0.4, -0.1, 0.004], [-0.1, 0.4, 0.004]])
        added = len(sheet) + np.arange(3)
        mesh = weld(np.concatenate((sheet, large)), np.concatenate((grid_of_faces(151, 151), [added])))
        points, bound = np.column_stack((0.01 + 0.13 * rng.random((50, 2)), np.full(50, 0.0025))), 0.0026
    assert len(mesh.faces) > MANY_FACES
    found = NearMesh(mesh, np.empty(0, np.int64))(points, np.full(len(points), bound))
    assert_allclose(found, MeshDistance(mesh)(points)[0], rtol=1e-12)
