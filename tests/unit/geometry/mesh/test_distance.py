"""Nearest points of triangles and meshes, next to slow and obvious versions."""

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import SkinCalibError
from skin_calib_addon.geometry.mesh import distance as module
from skin_calib_addon.geometry.mesh.distance import closest, closest_on_triangles
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, weld
from tests.oracles import distance_to_mesh, nearest_on_triangle
from tests.shapes import box, cylinder

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
    distance, face, nearest = closest(mesh, points)
    assert_allclose(distance, [distance_to_mesh(p, mesh.triangles) for p in points], rtol=1e-12, atol=1e-12)
    assert_allclose(np.linalg.norm(nearest - points, axis=1), distance, rtol=1e-12, atol=1e-15)
    on_face = [np.linalg.norm(nearest_on_triangle(q, mesh.triangles[f]) - q) for q, f in zip(nearest, face)]
    assert max(on_face) < 1e-12


def test_mesh_distance_of_no_points_is_empty():
    """Nothing asked, nothing answered."""
    distance, face, nearest = closest(box((0, 0, 0), (1, 1, 1)), np.empty((0, 3)))
    assert distance.shape == face.shape == (0,) and nearest.shape == (0, 3)


def test_flat_faces_do_not_hide_others():
    """Needles and faces squeezed to a line or a point among others: libigl alone takes a wrong face 394 mm away."""
    rng = np.random.default_rng(3)
    for k in range(20):
        first, sides = rng.uniform(-1, 1, (60, 3)), rng.normal(size=(2, 60, 3)) * 10 ** rng.uniform(-2, 0, (2, 60, 1))
        along = rng.uniform(-0.5, 1.5, (60, 1)) * sides[0] + 10 ** rng.uniform(-18, -6, (60, 1)) * sides[1]
        third = np.where(rng.random((60, 1)) < 0.5, along, sides[1])
        third[rng.random(60) < 0.1] = 0.0
        triangles = np.stack((first, first + sides[0], first + third), axis=1)[:, rng.permutation(3)]
        mesh = TriangleMesh(triangles.reshape(-1, 3), np.arange(180).reshape(60, 3))
        points = rng.uniform(-2, 2, (200, 3))
        every = closest_on_triangles(np.repeat(points, 60, axis=0), np.tile(triangles, (200, 1, 1)))
        least = np.linalg.norm(every.reshape(200, 60, 3) - points[:, None], axis=2).min(axis=1)
        assert_allclose(closest(mesh, points)[0], least, rtol=0, atol=1e-12, err_msg=str(k))


@pytest.mark.parametrize("shift", [0.0, 10.0])
def test_distances_keep_all_digits_far_from_the_origin(shift):
    """A wrist-sized tube at 10 m: a search with half of the digits is 1 um off."""
    mesh = weld(cylinder().vertices + shift, cylinder().faces)
    rng = np.random.default_rng(0)
    face = rng.integers(0, len(mesh.faces), 20)
    points = mesh.triangles[face].mean(axis=1) + 1e-4 * mesh.face_normals[face]
    every = [
        np.linalg.norm(closest_on_triangles(p + 0 * mesh.triangles[:, 0], mesh.triangles) - p, axis=1) for p in points
    ]
    assert_allclose(closest(mesh, points)[0], np.min(every, axis=1), rtol=1e-12)


def test_blocks_of_points_do_not_affect_the_distances(monkeypatch):
    """More points than one search has."""
    mesh, points = cylinder(), 0.2 * np.random.default_rng(0).normal(size=(40, 3))
    whole = closest(mesh, points)
    monkeypatch.setattr(module, "BLOCK_POINTS", 7)
    for found, expected in zip(closest(mesh, points), whole):
        assert_allclose(found, expected, rtol=0, atol=0)


def test_search_tree_of_a_mesh_ends_with_it():
    """It is shared by all that compare with the mesh, and is not kept after the mesh."""
    mesh = weld(cylinder().vertices, cylinder().faces)
    closest(mesh, mesh.vertices[:1])
    before = len(module._trees)
    del mesh
    assert len(module._trees) < before


def test_a_missing_library_is_named(monkeypatch):
    """With what installs it."""
    monkeypatch.setitem(sys.modules, "igl", None)
    monkeypatch.delitem(sys.modules, "bpy", raising=False)  # of a test before
    with pytest.raises(SkinCalibError, match=r"libigl, .*: pip install 'skin-calib\[author\]'"):
        closest(weld(cylinder().vertices, cylinder().faces), np.zeros((1, 3)))
